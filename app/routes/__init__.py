"""Routes of the API: each reads a request, hands it to runner, viewer or runs, and returns the response.

`live_robot` and `sockets` command and show the robot on the page, `scripted_runs` takes scenarios, and `service`
reports on the server. `dependencies` finds in the application what a route needs.
"""
