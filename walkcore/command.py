"""Commands of one tick: a reference velocity, and a push."""

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from walkcore.errors import InvalidValueError
from walkcore.values import Vector, check_choice, check_range, check_text, check_vector, frozen_copy

Frame = Literal["robot", "world"]
FARTHEST_POINT = 2.0  # [m] of a pushed point from its joint


@dataclass(frozen=True, slots=True)
class Reference:
    """Reference velocity of the CoM, in the robot's heading frame."""

    vx: float = 0.0
    """Forward velocity [m/s]."""
    vy: float = 0.0
    """Velocity to the left [m/s]."""
    yaw_rate: float = 0.0
    """Counter-clockwise yaw rate [rad/s]."""

    def __post_init__(self) -> None:
        for name in ("vx", "vy", "yaw_rate"):
            object.__setattr__(self, name, check_range(f"reference.{name}", getattr(self, name)))

    @property
    def is_zero(self) -> bool:
        """Whether the robot is to stay where it is."""
        return self.vx == 0.0 and self.vy == 0.0 and self.yaw_rate == 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Push:
    """An impulse on the CoM, spread evenly over a duration. The model's velocity changes by impulse / mass."""

    impulse: Vector
    """[N s], shape (2,)."""
    duration: float = 0.0
    """[s]; zero gives the whole impulse in one tick."""
    frame: Frame = "robot"
    """Frame of the impulse: the robot's heading when the push begins, or the world."""
    link: str = ""
    """Joint that moves the link that is pushed; empty for the torso. The ideal plant is pushed at its CoM always."""
    point: Vector | None = None
    """Place on that link, in the frame of its joint [m], shape (3,); None at the link's own CoM."""

    def __post_init__(self) -> None:
        if len(self.impulse) != 2:
            raise InvalidValueError("push.impulse", self.impulse, "must have two components")
        impulse = [check_range(f"push.impulse[{i}]", value) for i, value in enumerate(self.impulse)]
        object.__setattr__(self, "impulse", frozen_copy(impulse, shape=(2,)))
        object.__setattr__(self, "duration", check_range("push.duration", self.duration, low=0.0))
        check_choice("push.frame", self.frame, get_args(Frame))
        check_text("push.link", self.link)
        if self.point is not None:
            is_array = isinstance(self.point, np.ndarray)  # pyright: ignore[reportUnnecessaryIsInstance]  # a list from a client
            given = self.point.tolist() if is_array else self.point
            point = check_vector("push.point", given, 3, -FARTHEST_POINT, FARTHEST_POINT)
            object.__setattr__(self, "point", point)


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """The reference that holds at this tick, and a push that begins at it."""

    reference: Reference = field(default_factory=Reference)
    push: Push | None = None
