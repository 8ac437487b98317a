"""The foot in the air, towards a foothold that may still move.

Each tick starts a new quintic from the foot's position, velocity and acceleration,
at rest on the foothold at touchdown. While the foothold stays, these are all one
quintic. When it moves late, the foot goes as fast as the speed bound (30) allows:

    |foothold - foot| <= time_left * max_speed

holds at the next tick if it holds at this one, so the QP never loses a foothold
that it has planned, and no foot ever has to be faster.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from operator import sub

import numpy as np

from walkcore.mpc.stance import Footstep
from walkcore.values import Matrix, Vector, freeze, frozen_copy, rotation

# Coefficients of s^0 to s^5, for the fraction s of a time T that has passed, from x, T dx, T^2 ddx and the target.
QUINTIC = frozen_copy(
    [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.5, 0.0],
        [-10.0, -6.0, -1.5, 10.0],
        [15.0, 8.0, 1.5, -15.0],
        [-6.0, -3.0, -0.5, 6.0],
    ]
)


@dataclass(frozen=True, slots=True, eq=False)
class FootState:
    """A sole in the world frame, on the ground or in the air."""

    matrix: Matrix
    """Pose, velocity and acceleration, one below the other, each for x, y [m] and yaw [rad], shape (3, 3)."""
    height: float
    """Height of the sole above the ground [m]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "matrix", frozen_copy(self.matrix, shape=(3, 3)))

    @property
    def pose(self) -> Vector:
        """x, y of the sole frame's origin [m] and yaw [rad], shape (3,)."""
        return self.matrix[0]

    @property
    def velocity(self) -> Vector:
        """Velocity of x, y [m/s] and yaw [rad/s], shape (3,)."""
        return self.matrix[1]

    @property
    def acceleration(self) -> Vector:
        """Acceleration of x, y [m/s^2] and yaw [rad/s^2], shape (3,)."""
        return self.matrix[2]

    @property
    def position(self) -> Vector:
        """Origin of the sole frame [m], shape (2,)."""
        return self.matrix[0, :2]

    @property
    def yaw(self) -> float:
        """Yaw, counter-clockwise [rad]."""
        return float(self.matrix[0, 2])


@dataclass(frozen=True, slots=True)
class Flight:
    """Height of a sole whose touchdown was moved while it was in the air: a quintic to the ground, and a bump on it."""

    start: int
    """Tick at which the touchdown was moved."""
    touchdown: int
    """Tick of the new one."""
    height: float
    """At the start [m]."""
    velocity: float
    """At the start, upwards [m/s]."""
    acceleration: float
    """At the start, upwards [m/s^2]."""
    bump: float
    """Highest point of the bump [m]; zero for a foot that is on its way down."""

    def at(self, tick: int, control_period: float) -> tuple[float, float, float]:
        """Height [m], vertical velocity [m/s] and acceleration [m/s^2] at a tick.

        Args:
            tick: from the start to the touchdown.
            control_period: duration of a tick [s].
        """
        T = (self.touchdown - self.start) * control_period
        s = (tick - self.start) / (self.touchdown - self.start)
        start = np.array([self.height, T * self.velocity, T**2 * self.acceleration, 0.0])
        height, velocity, acceleration = (_derivatives(s) @ QUINTIC @ start / [1.0, T, T**2]).tolist()
        bump = bump_at(s, self.bump, T)
        return max(height + bump[0], 0.0), velocity + bump[1], acceleration + bump[2]


def retimed_flight(now: tuple[float, float, float], tick: int, touchdown: int, period: float, apex: float) -> Flight:
    """The flight of a foot whose touchdown is moved now, continuous in height, velocity and acceleration.

    Args:
        now: height [m], vertical velocity [m/s] and acceleration [m/s^2] of the foot.
        tick: now.
        touchdown: tick of the new one.
        period: duration of a tick [s].
        apex: that a foot on its way up still has to reach [m].
    """
    straight = Flight(tick, touchdown, *now, bump=0.0)
    highest = max(straight.at(t, period)[0] for t in range(tick, touchdown + 1))
    return replace(straight, bump=max(apex - highest, 0.0) if now[1] >= 0.0 else 0.0)


def standing(foot: Footstep) -> FootState:
    """A foot at rest on the ground."""
    matrix = np.zeros((3, 3))
    matrix[0, :2], matrix[0, 2] = foot.position, foot.yaw
    return FootState(freeze(matrix), 0.0)


def swing_height(progress: float, apex: float) -> float:
    """Height of the sole [m]: a bump with zero speed and acceleration at lift-off and touchdown.

    Args:
        progress: fraction of the single support that has passed.
        apex: highest point [m].
    """
    return apex * 64.0 * (progress * (1.0 - progress)) ** 3


def bump_at(progress: float, apex: float, duration: float) -> tuple[float, float, float]:
    """Height [m], vertical velocity [m/s] and acceleration [m/s^2] of the same bump.

    Args:
        progress: fraction of the single support that has passed.
        apex: highest point [m].
        duration: of the single support [s].
    """
    s, q = progress, progress * (1.0 - progress)
    velocity = 3.0 * q**2 * (1.0 - 2.0 * s)
    acceleration = 6.0 * s - 36.0 * s**2 + 60.0 * s**3 - 30.0 * s**4
    return (
        swing_height(progress, apex),
        apex * 64.0 * velocity / duration,
        apex * 64.0 * acceleration / duration**2,
    )


def swing(
    foot: FootState,
    foothold: Footstep,
    time_left: float,
    tick: float,
    max_speed: Sequence[float],
    support_yaw: float,
    height: float,
) -> FootState:
    """The foot one tick later.

    Args:
        foot: now.
        foothold: where it will land.
        time_left: until touchdown [s].
        tick: [s].
        max_speed: along x and y of the support foot's frame [m/s], and of the yaw [rad/s].
        support_yaw: of that frame [rad].
        height: of the sole one tick later [m], if it has not landed by then.
    """
    if time_left <= 1.5 * tick:
        return standing(foothold)
    start = np.empty((4, 3))
    start[:3], start[3, :2], start[3, 2] = foot.matrix, foothold.position, foothold.yaw
    after = _one_tick(time_left, tick) @ start
    R = _rotation(support_yaw)
    move, to_go = ((np.array([after[0], start[3]]) - foot.matrix[0]) @ R).tolist()
    allowed = [_within_speed(*axis, time_left, tick) for axis in zip(move, to_go, max_speed, strict=True)]
    if max(map(abs, map(sub, allowed, move))) > 1e-12:
        after[0], after[1], after[2] = foot.pose + R @ allowed, R @ allowed / tick, 0.0
    return FootState(freeze(after), height)


def _within_speed(move: float, to_go: float, max_speed: float, time_left: float, tick: float) -> float:
    """The move of one tick that is nearest to a given one, no faster than allowed, now or in the time that is left."""
    step, reachable = tick * max_speed, max((time_left - tick) * max_speed, 0.0)
    slowed = min(max(move, -step), step)
    return min(max(slowed, to_go - reachable), to_go + reachable)


def swing_accelerations(start: float, landing: float, lift_off: float, times: Vector) -> tuple[Matrix, Vector]:
    """Accelerations of a flight, linear in its beginning, its target and its apex.

    Args:
        start: of the quintic: the present, or the lift-off to come [s].
        landing: when the foot will land [s].
        lift_off: when it leaves or left the ground, from which its height is counted [s].
        times: at which accelerations are wanted, from start to landing [s], shape (k,).

    Returns:
        For pose, velocity, acceleration and target: the horizontal acceleration, shape (k, 4);
        for the apex: the vertical one, shape (k,) [1/s^2].
    """
    T, flight = landing - start, landing - lift_off
    s = (times - start) / T
    second = np.column_stack([0 * s, 0 * s, 0 * s + 2, 6 * s, 12 * s**2, 20 * s**3]) @ QUINTIC
    s = (times - lift_off) / flight
    bump = 64.0 * (6 * s - 36 * s**2 + 60 * s**3 - 30 * s**4)  # second derivative of `swing_height`
    return second * [1.0, T, T**2, 1.0] / T**2, bump / flight**2


@lru_cache(maxsize=4096)  # the flights of a walk pass the same times
def _one_tick(time_left: float, tick: float) -> Matrix:
    """Map from pose, velocity, acceleration and target to the first three one tick later, shape (3, 4)."""
    T, s = time_left, tick / time_left
    scale = np.array([1.0, T, T**2])
    return frozen_copy(_derivatives(s) @ QUINTIC * [*scale, 1.0] / scale[:, None])


def _derivatives(s: float) -> Matrix:
    """The powers s^0 to s^5 and their first two derivatives, shape (3, 6)."""
    return np.array(
        [
            [1.0, s, s**2, s**3, s**4, s**5],
            [0.0, 1.0, 2 * s, 3 * s**2, 4 * s**3, 5 * s**4],
            [0.0, 0.0, 2.0, 6 * s, 12 * s**2, 20 * s**3],
        ]
    )


@lru_cache(maxsize=256)
def _rotation(yaw: float) -> Matrix:
    """Rotation from the frame of a foot to the world, for x, y and yaw, shape (3, 3)."""
    R = np.eye(3)
    R[:2, :2] = rotation(yaw)
    return frozen_copy(R)
