"""How the robot gets over its pushes, read off the walk alone.

It has recovered once the walk repeats itself: for a whole step, the CoM's velocity in the
heading frame is the one of a gait cycle later. Standing repeats itself too.
"""

from dataclasses import dataclass

import numpy as np

from walkcore.values import Matrix, Vector, rotation
from walkcore.walk import (
    Walk,
    heading,
    heading_velocity,
    nb_rows_up,
    nb_ticks_of,
    points,
    push_rows,
    reference_changes,
    touchdowns,
)

SAME_VELOCITY = 0.02  # [m/s]


@dataclass(frozen=True, slots=True)
class Recovery:
    """From one push."""

    t: float
    """When it began [s]."""
    impulse: tuple[float, float]
    """All of it, world frame [N s]."""
    time: float | None
    """Until the walk repeats itself [s]; None if something else came before, or the walk ended or fell."""
    steps: int | None
    """Touchdowns until then."""
    com_deviation: float | None
    """Largest, of the CoM from the gait cycle before the push, repeated, until something else comes [m].

    None where that cycle was not steady itself: within a cycle and a step of a change or another push.
    """


def recoveries(walk: Walk) -> list[Recovery]:
    """One for each push, in the order of time."""
    last = nb_rows_up(walk)
    pushes = [push for push in push_rows(walk) if push[0] < last]
    changes = sorted({0, *reference_changes(walk).tolist(), *(row for push in pushes for row in push)})
    return [
        _recovery(
            walk,
            push,
            undisturbed_since=max(row for row in changes if row < push[0] or row == 0),
            until=min((row for row in changes if push[1] < row < last), default=last),
        )
        for push in pushes
    ]


def _recovery(walk: Walk, push: tuple[int, int], undisturbed_since: int, until: int) -> Recovery:
    first, end = push
    impulse = points(walk, "push")[first:end].sum(axis=0)
    calm = _repeats_from(walk, end, until)
    period = float(walk.parameters["control_period"])
    return Recovery(
        t=float(walk["t"][first]),
        impulse=(float(impulse[0]), float(impulse[1])),
        time=None if calm is None else (calm - first) * period,
        steps=None if calm is None else int(np.sum((touchdowns(walk) > first) & (touchdowns(walk) <= calm))),
        com_deviation=_deviation(walk, first, undisturbed_since, until),
    )


def _repeats_from(walk: Walk, first: int, until: int) -> int | None:
    """The first row from which on the walk repeats itself for a step; None if there is none before `until`."""
    step = nb_ticks_of(walk, walk.parameters["step_duration"])
    velocity = heading_velocity(walk)[first:until]
    if len(velocity) < 3 * step:
        return None
    differs = np.hypot(*(velocity[2 * step :] - velocity[: -2 * step]).T) > SAME_VELOCITY
    nb_differing = np.concatenate([[0], np.cumsum(differs)])
    calm = np.flatnonzero(nb_differing[step:] == nb_differing[:-step])
    return first + int(calm[0]) if len(calm) else None


def _deviation(walk: Walk, push: int, undisturbed_since: int, until: int) -> float | None:
    step = nb_ticks_of(walk, walk.parameters["step_duration"])
    if push - undisturbed_since < 3 * step:
        return None
    com = points(walk, "com")
    expected = _repeated(com, heading(walk), push, 2 * step, until)
    return float(np.max(np.hypot(*(com[push:until] - expected).T)))


def _repeated(com: Matrix, yaw: Vector, push: int, cycle: int, until: int) -> Matrix:
    """Where the CoM would be from row `push` to `until` if the cycle before went on, turned as that cycle turns."""
    R = rotation(float(yaw[push] - yaw[push - cycle]))
    blocks = [com[push - cycle : push]]
    while sum(map(len, blocks)) < cycle + until - push:
        blocks.append(com[push] + (blocks[-1] - com[push - cycle]) @ R.T)
    return np.vstack(blocks[1:])[: until - push]
