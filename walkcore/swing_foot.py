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
from walkcore.values import Matrix, Vector, read_only, rotation


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


def swing_accelerations(
    foot: FootState, foothold: Footstep, start: float, landing: float, lift_off: float, apex: float, times: Vector
) -> tuple[Matrix, Vector]:
    """Of a flight as it is planned now.

    Args:
        foot: in flight or before it.
        foothold: where it will land.
        start: of the quintic: the present, or the lift-off to come [s].
        landing: when it will land [s].
        lift_off: when it leaves or left the ground, from which its height is counted [s].
        apex: highest point [m].
        times: at which accelerations are wanted, from start to landing [s], shape (k,).

    Returns:
        Horizontal, shape (k, 2), and vertical, shape (k,) [m/s^2].
    """
    left, flight = landing - start, landing - lift_off
    coefficients = _coefficients(foot, _pose(foothold), left)
    s = ((times - start) / left)[:, None]
    second = 2 * coefficients[2] + 6 * coefficients[3] * s + 12 * coefficients[4] * s**2 + 20 * coefficients[5] * s**3
    s = (times - lift_off) / flight
    bump = 64.0 * apex * (6 * s - 36 * s**2 + 60 * s**3 - 30 * s**4)  # second derivative of `swing_height`
    return second[:, :2] / left**2, bump / flight**2


def _pose(foot: Footstep) -> Vector:
    return np.array([*foot.position, foot.yaw])


def _coefficients(foot: FootState, target: Vector, duration: float) -> Matrix:
    """Of s^0 to s^5, for the fraction s of `duration` that has passed, shape (6, 3)."""
    T = duration
    D, V, A = target - foot.pose, foot.velocity * T, foot.acceleration * T**2
    c3, c4, c5 = 10 * D - 6 * V - 1.5 * A, -15 * D + 8 * V + 1.5 * A, 6 * D - 3 * V - 0.5 * A
    return np.stack([foot.pose, V, A / 2, c3, c4, c5])


def _quintic(foot: FootState, target: Vector, time_left: float, tick: float) -> tuple[Vector, Vector, Vector]:
    """Pose, velocity and acceleration after one tick of the quintic that rests on the target at touchdown."""
    T, s = time_left, tick / time_left
    c = _coefficients(foot, target, T)
    position = s ** np.arange(6)
    velocity = np.arange(1, 6) * s ** np.arange(5)
    acceleration = np.array([2.0, 6.0, 12.0, 20.0]) * s ** np.arange(4)
    return position @ c, velocity @ c[1:] / T, acceleration @ c[2:] / T**2
