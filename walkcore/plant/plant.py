"""The plant: the body that moves when its joints are driven, and the measurements of it.

The ideal plant does what is planned, to the last bit, so nothing has to be measured; `mujoco_plant` stands on the
ground by contact forces, and may fall.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from walkcore.mpc.stance import Side
from walkcore.values import Vector, frozen_copy


@dataclass(frozen=True, slots=True, eq=False)
class SolePose:
    """Place of a sole frame in the world."""

    position: Vector
    """[m], shape (3,)."""
    yaw: float
    """[rad]."""
    tilt: float
    """Angle between the sole and the ground [rad]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", frozen_copy(self.position, shape=(3,)))


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """The body as it is, in the world frame."""

    com: Vector
    """[m], shape (3,)."""
    com_velocity: Vector
    """[m/s], shape (3,)."""
    soles: Mapping[Side, SolePose]
    q: Vector
    """Configuration in Pinocchio's order, shape (nq,)."""
    tilt: float
    """Angle of the torso's axis from the vertical [rad]."""
    torques: Vector
    """Torques of the joints over the last instant, within their limits, in Pinocchio's order [N m], shape (nv - 6,)."""


@dataclass(frozen=True, slots=True, eq=False)
class GroundContact:
    """The forces of the ground on the soles."""

    cop: Vector | None
    """Centre of pressure of both soles, world frame [m], shape (2,); None where they carry next to nothing."""
    forces: Mapping[Side, float]
    """Normal force on each sole [N]."""
    total: Vector
    """Force on both soles, world frame [N], shape (3,)."""


@dataclass(frozen=True, slots=True, eq=False)
class ExternalForce:
    """A force on the body from outside, through one tick."""

    force: Vector
    """World frame [N], shape (3,)."""
    link: str = ""
    """Joint that moves the link it acts on; empty for the torso."""
    point: Vector | None = None
    """Place on that link, in the frame of that joint [m], shape (3,); None at the link's centre of mass."""


@dataclass(frozen=True, slots=True, eq=False)
class JointCommand:
    """The command to the joints for one tick."""

    q: Vector
    """Configuration at its beginning, in Pinocchio's order, shape (nq,)."""
    q_next: Vector
    """At its end, shape (nq,)."""
    torques: Vector
    """Feed-forward torques of the joints [N m], shape (nv - 6,)."""
    forces: tuple[ExternalForce, ...] = ()
    is_limp: bool = False
    """Whether the servos are off, as of a robot that has fallen."""


@dataclass(frozen=True, slots=True, eq=False)
class PlantState:
    """The whole state of a plant between two ticks."""

    numbers: Vector = field(default_factory=lambda: frozen_copy(np.zeros(0)))
    """In an order that the plant knows."""
    is_limp: bool = False


class Plant(Protocol):
    """A body whose joints can be driven."""

    def reset(self, q: Vector) -> None:
        """Put the body at rest in a configuration, in Pinocchio's order, shape (nq,)."""
        ...

    def measure(self) -> Measurement | None:
        """The body as it is; None if it is as planned."""
        ...

    def ground(self) -> GroundContact | None:
        """The forces of the ground that have just acted; None if they are as planned."""
        ...

    def advance(self, command: JointCommand, duration: float) -> None:
        """Drive the joints for a duration [s]."""
        ...

    @property
    def state(self) -> PlantState:
        """The whole state, for `restore`."""
        ...

    def restore(self, state: PlantState) -> None:
        """Go on from a state of the same plant."""
        ...


class IdealPlant:
    """The body does what is planned."""

    state = PlantState()
    """Nothing is remembered."""

    def reset(self, q: Vector) -> None:
        """See `Plant`."""

    def measure(self) -> None:
        """See `Plant`."""

    def ground(self) -> None:
        """See `Plant`."""

    def advance(self, command: JointCommand, duration: float) -> None:
        """See `Plant`."""

    def restore(self, state: PlantState) -> None:
        """See `Plant`."""
