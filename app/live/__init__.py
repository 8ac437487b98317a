"""The robot that walks on the page: a control process that keeps the tick rate, and the way to it.

In the order in which data flows: `hand` and `runner` take what is asked, `link` and `channel` carry it to the
`process`, where `control` ticks the simulation at the `pace`, and the `state` comes back through a `slot` in
memory that both share.
"""
