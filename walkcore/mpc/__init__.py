"""The paper: from the state of the CoM and a reference velocity to footsteps and a motion, by one QP a tick.

Read in the order in which data flows: `lipm` (1)-(10), `gait` (20)-(22), `orientation`, `regions` and `capture`
(sections 4 and 5), `supports`, `preview` (18), `schemes`, `walking_qp` (23)-(30), `qp`, `pattern_generator`; then
`viability` and `step_timing`, which move touchdowns where a push calls for it.
"""
