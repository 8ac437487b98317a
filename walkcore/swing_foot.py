"""The foot in the air, towards a foothold that may still move.

Each tick starts a new quintic from the foot's position, velocity and acceleration,
at rest on the foothold at touchdown. While the foothold stays, these are all one
quintic. When it moves late, the foot goes as fast as the speed bound (30) allows:

    |foothold - foot| <= time_left * max_speed

holds at the next tick if it holds at this one, so the QP never loses a foothold
that it has planned, and no foot is ever asked to be faster.
"""

from dataclasses import dataclass

import numpy as np

from walkcore.gait import Footstep
from walkcore.values import Vector, read_only, rotation


@dataclass(frozen=True, slots=True, eq=False)
class FootState:
    """A sole in the world frame, on the ground or in the air."""

    position: Vector
    """Origin of the sole frame [m], shape (2,)."""
    velocity: Vector
    """[m/s], shape (2,)."""
    acceleration: Vector
    """[m/s^2], shape (2,)."""
    height: float
    """Of the sole above the ground [m]."""
    yaw: float
    """[rad]."""

    def __post_init__(self) -> None:
        for name in ("position", "velocity", "acceleration"):
            object.__setattr__(self, name, read_only(getattr(self, name), shape=(2,)))


def standing(foot: Footstep) -> FootState:
    """A foot at rest on the ground."""
    return FootState(foot.position, np.zeros(2), np.zeros(2), 0.0, foot.yaw)


def swing_height(progress: float, apex: float) -> float:
    """Height of the sole [m]: a bump with zero speed and acceleration at lift-off and touchdown.

    Args:
        progress: fraction of the single support that has passed.
        apex: highest point [m].
    """
    return apex * 64.0 * (progress * (1.0 - progress)) ** 3


def swing(
    foot: FootState, foothold: Footstep, time_left: float, tick: float, max_speed: Vector, support_yaw: float
) -> FootState:
    """The foot one tick later; its height is left as it is.

    Args:
        foot: now.
        foothold: where it will land.
        time_left: until touchdown [s].
        tick: [s].
        max_speed: along x and y of the support foot's frame [m/s], shape (2,).
        support_yaw: of that frame [rad].
    """
    if time_left <= 1.5 * tick:
        return standing(foothold)
    position, velocity, acceleration = _quintic(foot, foothold.position, time_left, tick)
    R = rotation(support_yaw)
    to_go = (foothold.position - foot.position) @ R
    reachable = np.maximum((time_left - tick) * max_speed, 0.0)
    move = (position - foot.position) @ R
    allowed = np.clip(np.clip(move, -max_speed * tick, max_speed * tick), to_go - reachable, to_go + reachable)
    if not np.allclose(allowed, move, rtol=0.0, atol=1e-12):
        position, velocity, acceleration = foot.position + R @ allowed, R @ allowed / tick, np.zeros(2)
    yaw = foot.yaw + (foothold.yaw - foot.yaw) * tick / time_left
    return FootState(position, velocity, acceleration, foot.height, yaw)


def _quintic(foot: FootState, target: Vector, time_left: float, tick: float) -> tuple[Vector, Vector, Vector]:
    """Position, velocity and acceleration after one tick of the quintic that rests on the target at touchdown."""
    T, s = time_left, tick / time_left
    D, V, A = target - foot.position, foot.velocity * T, foot.acceleration * T**2
    c3, c4, c5 = 10 * D - 6 * V - 1.5 * A, -15 * D + 8 * V + 1.5 * A, 6 * D - 3 * V - 0.5 * A
    position = foot.position + V * s + A / 2 * s**2 + c3 * s**3 + c4 * s**4 + c5 * s**5
    velocity = (V + A * s + 3 * c3 * s**2 + 4 * c4 * s**3 + 5 * c5 * s**4) / T
    acceleration = (A + 6 * c3 * s + 12 * c4 * s**2 + 20 * c5 * s**3) / T**2
    return position, velocity, acceleration
