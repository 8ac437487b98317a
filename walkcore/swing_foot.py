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

    pose: Vector
    """x, y of the sole frame's origin [m] and yaw [rad], shape (3,)."""
    velocity: Vector
    """[m/s] and [rad/s], shape (3,)."""
    acceleration: Vector
    """[m/s^2] and [rad/s^2], shape (3,)."""
    height: float
    """Of the sole above the ground [m]."""

    def __post_init__(self) -> None:
        for name in ("pose", "velocity", "acceleration"):
            object.__setattr__(self, name, read_only(getattr(self, name), shape=(3,)))

    @property
    def position(self) -> Vector:
        """Origin of the sole frame [m], shape (2,)."""
        return self.pose[:2]

    @property
    def yaw(self) -> float:
        """[rad]."""
        return float(self.pose[2])


def standing(foot: Footstep) -> FootState:
    """A foot at rest on the ground."""
    return FootState(_pose(foot), np.zeros(3), np.zeros(3), 0.0)


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
        max_speed: along x and y of the support foot's frame [m/s], and of the yaw [rad/s], shape (3,).
        support_yaw: of that frame [rad].
    """
    if time_left <= 1.5 * tick:
        return standing(foothold)
    target = _pose(foothold)
    pose, velocity, acceleration = _quintic(foot, target, time_left, tick)
    R = np.eye(3)
    R[:2, :2] = rotation(support_yaw)
    to_go = (target - foot.pose) @ R
    reachable = np.maximum((time_left - tick) * max_speed, 0.0)
    move = (pose - foot.pose) @ R
    allowed = np.clip(np.clip(move, -max_speed * tick, max_speed * tick), to_go - reachable, to_go + reachable)
    if np.any(np.abs(allowed - move) > 1e-12):
        pose, velocity, acceleration = foot.pose + R @ allowed, R @ allowed / tick, np.zeros(3)
    return FootState(pose, velocity, acceleration, foot.height)


def _pose(foot: Footstep) -> Vector:
    return np.array([*foot.position, foot.yaw])


def _quintic(foot: FootState, target: Vector, time_left: float, tick: float) -> tuple[Vector, Vector, Vector]:
    """Pose, velocity and acceleration after one tick of the quintic that rests on the target at touchdown."""
    T, s = time_left, tick / time_left
    D, V, A = target - foot.pose, foot.velocity * T, foot.acceleration * T**2
    c3, c4, c5 = 10 * D - 6 * V - 1.5 * A, -15 * D + 8 * V + 1.5 * A, 6 * D - 3 * V - 0.5 * A
    pose = foot.pose + V * s + A / 2 * s**2 + c3 * s**3 + c4 * s**4 + c5 * s**5
    velocity = (V + A * s + 3 * c3 * s**2 + 4 * c4 * s**3 + 5 * c5 * s**4) / T
    acceleration = (A + 6 * c3 * s + 12 * c4 * s**2 + 20 * c5 * s**3) / T**2
    return pose, velocity, acceleration
