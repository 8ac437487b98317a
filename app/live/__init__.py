"""The robot that walks on the page: a control process that keeps the tick rate, and the server's end of it.

In the order in which data flows: `runner` takes references, pushes and requests from routes and viewer, checks them
against the robot's limits, and knows which client drives; `supervisor` keeps a control process alive, and `link`
carries them there, by the shared memory of `channel` and by `messages`; `process` waits for ticks and requests, and
`control` carries them out, by the schedule of `tick_scheduler`. It ticks one `live_walk`, by the commands of
`command_source`. `session_log` keeps the last two minutes of that walk, which the `timeline` lists, `past` reads, and
a `fork` goes on from. Each tick comes back as a `live_state`.

Who may drive is decided before: `teleop_client`, `driver_lease`, and for a `booth` the `driver_queue`.
"""
