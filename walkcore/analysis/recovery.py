"""How the robot gets over its pushes, read off the walk alone: followed as the live robot's are."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from walkcore.analysis.columns import (
    Walk,
    heading,
    nb_rows_up,
    nb_ticks_of_step,
    pendulum,
    points,
    push_rows,
    reference_changes,
    timing_changes,
)
from walkcore.analysis.margins import divergent_component
from walkcore.analysis.push_follower import FollowedPush, Moment, PushFollower
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Footstep, Side
from walkcore.values import Matrix, Vector, rotation


@dataclass(frozen=True, slots=True)
class Recovery:
    """From one push."""

    t: float
    """When it began [s]."""
    impulse: tuple[float, float]
    """All of it, world frame [N s]."""
    time: float | None
    """Until the walk repeats itself [s]; None if another push came before, or the walk ended or fell."""
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
    asked = np.concatenate([reference_changes(walk), timing_changes(walk)])
    changes = sorted({0, *asked.tolist(), *(row for push in pushes for row in push)})
    return [
        Recovery(
            t=push.t,
            impulse=push.impulse,
            time=push.time,
            steps=push.steps if push.survived else None,
            com_deviation=_deviation(
                walk,
                first,
                undisturbed_since=max(row for row in changes if row < first or row == 0),
                until=min((row for row in changes if end < row < last), default=last),
            ),
        )
        for (first, end), push in zip(pushes, _followed(walk) if pushes else (), strict=True)
    ]


def _followed(walk: Walk) -> list[FollowedPush]:
    """What became of each push."""
    follower = PushFollower()
    pushes: dict[float, FollowedPush] = {}
    for moment in _moments(walk):
        follower.see(moment)
        if follower.last is not None:
            pushes[follower.last.t] = follower.last
    return list(pushes.values())


def _moments(walk: Walk) -> Iterator[Moment]:
    """Of each tick before a fall."""
    omega = pendulum(walk).omega
    push, com, cop, support = (points(walk, name) for name in ("push", "com", "cop", "support"))
    capture_point = divergent_component(walk) - push / (walk.parameters["mass"] * omega)
    for k in range(nb_rows_up(walk)):
        yield Moment(
            t=float(walk["t"][k]),
            push=push[k],
            com=com[k],
            capture_point=capture_point[k],
            cop=cop[k],
            support=Footstep(Side(int(walk["support_side"][k])), support[k], float(walk["support_yaw"][k])),
            phase=Phase(int(walk["phase"][k])),
            status=Status(int(walk["status"][k])),
        )


def _deviation(walk: Walk, push: int, undisturbed_since: int, until: int) -> float | None:
    step = nb_ticks_of_step(walk, push)
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
