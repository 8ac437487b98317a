"""Routes of the API: each reads a request, hands it to runner, viewer or runs, and returns the response.

`live_robot`, `driver_lease`, `timeline`, `booth` and `sockets` command and show the robot on the page; `scripted_runs`,
`sweeps`, `lessons` and `uploads` are about walks away from it; `service` reports on the server. `dependencies` finds in
the application what a route needs.
"""
