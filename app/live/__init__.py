"""The robot that walks on the page: a control process that keeps the tick rate, and the server's end of it.

In the order in which data flows: `runner` takes references, pushes and requests from routes and viewer and decides
which client drives; `link` starts the control process and carries them there, over the `channel` that both share;
`process` waits for ticks and requests, by the schedule of `tick_scheduler`; `control` ticks the simulation, and
`session_log` keeps the last two minutes of it, which the `timeline` lists and a `fork` goes on from; each tick
comes back as a `live_state`.
"""
