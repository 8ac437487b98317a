"""A small offset of the body's CoM that brings the true CoP back to the model's.

The model (5) has the whole mass in one point. What it leaves out is nearly all the leg that
swings: it is accelerated below the CoM, and its knee goes forward when the foot goes up.
Together they move the true CoP by

    e = foot ddf + knee ddz n + com ddc

with ddf, ddz the accelerations of the foot in the air, n its direction and ddc the CoM's. An
offset d of the CoM moves the true CoP by d - ddd/omega^2, so it has to solve
d - ddd/omega^2 = -e. Its bounded solution looks ahead, as an inverted pendulum has to:

    xi = -omega * integral of exp(-omega s) e(t + s) ds from 0 on,      dd = omega (xi - d)

What is planned may change from one tick to the next, and with it xi, which would jerk the body. So xi is taken
SMOOTHING later, and approached with that time constant.

The dynamic filter of Kajita et al. 2003, section 5, with a model of e for its second preview.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from walkcore.motion.swing_foot import FootState, standing, swing_accelerations
from walkcore.mpc.lipm import CoMState
from walkcore.mpc.plan import Plan
from walkcore.robot import SwingMoments
from walkcore.values import Vector, freeze, frozen_copy

LOOK_AHEAD, STEP = 1.2, 0.025  # [s]; exp(-omega * 1.2 s) is 2 %
SMOOTHING = 0.04  # [s]
AHEAD = np.arange(0.5, LOOK_AHEAD / STEP) * STEP
TIMES = SMOOTHING + AHEAD


@dataclass(frozen=True, slots=True, eq=False)
class Offset:
    """Offset of the body's CoM from the model's, world frame."""

    position: Vector
    """d [m], shape (2,)."""
    dcm: Vector
    """xi, the DCM of the offset, smoothed [m], shape (2,)."""

    def velocity(self, omega: float) -> Vector:
        """Velocity dd = omega (xi - d) [m/s], shape (2,).

        Args:
            omega: sqrt(g/h) [1/s].
        """
        return omega * (self.dcm - self.position)

    def towards(self, dcm: Vector, omega: float, period: float) -> "Offset":
        """The offset one tick later, on its way to the DCM offset of the plan.

        Args:
            dcm: DCM offset `SMOOTHING` from now, world frame [m], shape (2,).
            omega: sqrt(g/h) [1/s].
            period: duration of the tick [s].
        """
        smoothed = self.dcm + (1.0 - math.exp(-period / SMOOTHING)) * (dcm - self.dcm)
        position = self.position + (1.0 - math.exp(-omega * period)) * (smoothed - self.position)
        return Offset(frozen_copy(position), frozen_copy(smoothed))


NO_OFFSET = Offset(frozen_copy(np.zeros(2)), frozen_copy(np.zeros(2)))


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The motion that is planned at one tick."""

    sampling_period: float
    """T, and the duration of a double support [s]."""
    step_duration: float
    """Duration of the step under way [s]."""
    next_step_duration: float
    """Duration of each step after it [s]."""
    time_to_touchdown: float
    """[s]; NaN if no step is planned."""
    swing_height: float
    """Highest point of the sole in the air [m]."""
    com: CoMState
    support: FootState
    swing: FootState
    plan: Plan


def dcm_offset(motion: Motion, moments: SwingMoments, omega: float) -> Vector:
    """The DCM offset xi, `SMOOTHING` from now, that the offset has to follow, world frame [m], shape (2,).

    Args:
        motion: planned at this tick.
        moments: of the robot's swinging masses.
        omega: sqrt(g/h) [1/s].
    """
    return freeze(_of_swings(motion, moments, omega) + moments.com * _of_com(motion, omega))


def _of_com(motion: Motion, omega: float) -> Vector:
    """Part of xi that the CoM's acceleration causes, if it moved the CoP by as many metres, shape (2,)."""
    plan = motion.plan
    of_jerks = _weights_of_jerks(float(plan.times[0]), motion.sampling_period, len(plan.times), omega)
    return _weights(omega).sum() * motion.com.acceleration + of_jerks @ plan.jerks


def _of_swings(motion: Motion, moments: SwingMoments, omega: float) -> Vector:
    """Part of xi that the coming swings cause, shape (2,)."""
    landing, step_duration = motion.time_to_touchdown, motion.step_duration
    xi = np.zeros(2)
    foot, waiting = motion.swing, motion.support
    for foothold in motion.plan.footholds:
        lift_off = landing - (step_duration - motion.sampling_period)
        of_motion, of_height = _weights_of_flight(lift_off, landing, omega)
        direction = np.array([math.cos(foothold.yaw), math.sin(foothold.yaw)])
        horizontal = of_motion @ [*foot.matrix[:, :2], foothold.position]
        xi += moments.foot * horizontal + moments.knee * motion.swing_height * of_height * direction
        foot, waiting = waiting, standing(foothold)
        step_duration = motion.next_step_duration
        landing += step_duration
    return xi


# What follows depends on the phase of the gait alone, and comes back with every step.


@lru_cache(maxsize=16)
def _weights(omega: float) -> Vector:
    """Quadrature weights that integrate the CoP error at TIMES into xi, shape (len(TIMES),)."""
    return frozen_copy(-omega * STEP * np.exp(-omega * AHEAD))


@lru_cache(maxsize=4096)
def _weights_of_jerks(first_interval: float, interval: float, count: int, omega: float) -> Vector:
    """Weights of the jerks of a plan in the part of xi that the CoM's acceleration causes, shape (N,)."""
    starts = np.concatenate([[0.0], first_interval + interval * np.arange(count - 1)])
    durations = np.concatenate([[first_interval], np.full(count - 1, interval)])
    acted = np.minimum(np.maximum(TIMES[:, None] - starts, 0.0), durations)  # for so long each jerk has
    return frozen_copy(_weights(omega) @ acted)


@lru_cache(maxsize=4096)
def _weights_of_flight(lift_off: float, landing: float, omega: float) -> tuple[Vector, float]:
    """Weights in xi of pose, velocity, acceleration and target of a foot in flight, shape (4,), and of its apex."""
    flies = (TIMES > lift_off) & (TIMES < landing)
    horizontal, vertical = swing_accelerations(max(lift_off, 0.0), landing, lift_off, TIMES[flies])
    weights = _weights(omega)[flies]
    return frozen_copy(weights @ horizontal), float(weights @ vertical)
