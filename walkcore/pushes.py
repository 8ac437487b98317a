"""Pushes on the robot, each spread evenly over its duration."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from walkcore.command import FARTHEST_POINT, Push
from walkcore.plant.plant import ExternalForce
from walkcore.robot import Robot
from walkcore.values import (
    MAX_TICK,
    Vector,
    check_complete,
    check_list,
    check_mapping,
    check_text,
    check_vector,
    check_whole,
    frozen_copy,
    rotation,
)

NO_IMPULSE = frozen_copy(np.zeros(2))
PAUSE_OF_A_PUSH = 0.05  # [s] between the pieces of a push that is held
MAX_PUSHES = 1000  # under way at once
ROUNDING = 1e-9  # by which a push may exceed the strongest one


@dataclass(frozen=True, slots=True)
class GivenPush:
    """A push as it was given."""

    tick: int
    """Tick at which the push began."""
    impulse: tuple[float, float]
    """Whole impulse, world frame [N s]."""
    duration: float
    """[s]; zero gives the whole impulse in one tick."""


@dataclass(frozen=True, slots=True, eq=False)
class PushUnderWay:
    """The rest of a push."""

    impulse_per_tick: Vector
    """World frame [N s], shape (2,)."""
    ticks_left: int
    link: str = ""
    """As of `Push`."""
    point: Vector | None = None
    """As of `Push`."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "impulse_per_tick", frozen_copy(self.impulse_per_tick, shape=(2,)))

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, from which `pushes_from_list` makes the same."""
        return (
            {"impulse_per_tick": self.impulse_per_tick.tolist(), "ticks_left": self.ticks_left}
            | ({"link": self.link} if self.link else {})
            | ({} if self.point is None else {"point": self.point.tolist()})
        )


@dataclass(frozen=True, slots=True)
class Pushes:
    """The pushes under way at one tick, and the latest one that was given."""

    under_way: tuple[PushUnderWay, ...] = ()
    last: GivenPush | None = None

    def with_push(self, push: Push, heading: float, tick: int, control_period: float) -> "Pushes":
        """The pushes once one more begins.

        Args:
            push: that begins.
            heading: of the robot in the world [rad].
            tick: now.
            control_period: duration of a tick [s].
        """
        nb_ticks = max(1, round(push.duration / control_period))
        impulse = rotation(heading) @ push.impulse if push.frame == "robot" else push.impulse
        begun = PushUnderWay(impulse / nb_ticks, nb_ticks, push.link, push.point)
        given = GivenPush(tick, (float(impulse[0]), float(impulse[1])), push.duration)
        return Pushes((*self.under_way, begun), given)

    def goes_on(self, tick: int, control_period: float) -> bool:
        """Whether a push that begins now is another piece of the last one, which is held.

        Args:
            tick: now.
            control_period: duration of a tick [s].
        """
        last = self.last
        return last is not None and (tick - last.tick) * control_period <= last.duration + PAUSE_OF_A_PUSH

    @property
    def impulse(self) -> Vector:
        """Impulse of all of them in this tick, world frame [N s], shape (2,)."""
        return sum((push.impulse_per_tick for push in self.under_way), NO_IMPULSE)

    def forces(self, control_period: float) -> tuple[ExternalForce, ...]:
        """The force of each during this tick, which lasts so long [s]."""
        return tuple(
            ExternalForce(np.array([*push.impulse_per_tick, 0.0]) / control_period, push.link, push.point)
            for push in self.under_way
        )

    def one_tick_later(self) -> "Pushes":
        """The pushes that are left."""
        left = tuple(replace(push, ticks_left=push.ticks_left - 1) for push in self.under_way if push.ticks_left > 1)
        return replace(self, under_way=left)


def pushes_from_list(where: str, data: Any, robot: Robot) -> tuple[PushUnderWay, ...]:
    """The pushes under way, from the plain values of each.

    Args:
        where: its name in an error.
        data: a list, as YAML or JSON gives it.
        robot: that is pushed.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
    """
    pushes: list[PushUnderWay] = []
    for i, item in enumerate(check_list(where, data, MAX_PUSHES)):
        item = {"link": "", "point": None} | check_mapping(f"{where}[{i}]", item)
        values = check_complete(f"{where}[{i}]", item, ("impulse_per_tick", "ticks_left", "link", "point"))
        limit, point = robot.max_push * (1.0 + ROUNDING), values["point"]
        if point is not None:
            point = check_vector(f"{where}[{i}].point", point, 3, -FARTHEST_POINT, FARTHEST_POINT)
        impulse = check_vector(f"{where}[{i}].impulse_per_tick", values["impulse_per_tick"], 2, -limit, limit)
        ticks_left = check_whole(f"{where}[{i}].ticks_left", values["ticks_left"], 1, MAX_TICK)
        pushes.append(PushUnderWay(impulse, ticks_left, check_text(f"{where}[{i}].link", values["link"]), point))
    return tuple(pushes)
