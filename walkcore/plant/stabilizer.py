"""Stabiliser: keeps the body that really moves near the motion of the model.

    e = (c - c_ref) + (dc - dc_ref) / omega         error of the divergent component of motion (DCM)
    p = p_ref + k_p e, clipped to the stance        the CoP that is commanded
    dc_ref += omega (k_c e + k_s (1 - s) e) dt      the model follows the body

The DCM runs away from the CoP, so it alone has to be held: by pushing the CoP beyond it, as far as the soles reach,
which is the share s of the error. What the soles cannot take back, the model takes over: its velocity follows the
measured DCM, the faster the more the soles lack, and the QP replans from there. Only the velocity: a jump of the
position would be differentiated twice on its way to the joints, and a millimetre of noise would become centimetres of
CoP. The body has that velocity already, so no torque is commanded to give it once more.

The error is measured against the soles that stand, so that a robot which slips or turns on the ground is no error:
at each touchdown the model as a whole is moved to where its support foot has really come to stand.

Sources: Sugihara 2009, "Standing stabilizability and stepping maneuver in planar bipedalism based on the best COM-ZMP
regulator" (the feedback); Englsberger et al. 2015, "Three-dimensional bipedal walking control based on divergent
component of motion" (that the DCM is what it acts on); Caron et al. 2019, "Stair climbing stabilization of the HRP-4
humanoid robot using whole-body admittance control" (the model that gives way).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from walkcore.motion.dynamic_filter import Offset
from walkcore.motion.swing_foot import FootState
from walkcore.mpc.lipm import CoMState
from walkcore.mpc.regions import depths, nearest_within, shrunk
from walkcore.mpc.stance import Side, Stance
from walkcore.plant.plant import Measurement, SolePose
from walkcore.values import Matrix, Vector, freeze, frozen_copy, rotation

COP_GAIN = 3.0  # k_p: a CoP beyond the DCM error by this brings it back in 1 / (omega (k_p - 1)), 0.15 s
MODEL_GAIN = 4.0  # k_c [1/s]
SATURATED_GAIN = 10.0  # k_s [1/s]: at 20 and more the joints cannot follow the model any longer


@dataclass(frozen=True, slots=True, eq=False)
class PlanarTransform:
    """A motion of the plane: a rotation about the origin, then a translation."""

    yaw: float
    """[rad]."""
    translation: Vector
    """[m], shape (2,)."""

    def point(self, position: Vector) -> Vector:
        """A point after the motion [m], shape (2,)."""
        return rotation(self.yaw) @ position + self.translation

    def com(self, com: CoMState) -> CoMState:
        """A state of the CoM after the motion."""
        R = rotation(self.yaw)
        return CoMState(np.array([self.point(com.position), R @ com.velocity, R @ com.acceleration]))

    def foot(self, foot: FootState) -> FootState:
        """A sole after the motion."""
        matrix = np.array(foot.matrix)
        matrix[:, :2] = foot.matrix[:, :2] @ rotation(self.yaw).T
        matrix[0] += [*self.translation, self.yaw]
        return FootState(freeze(matrix), foot.height)

    def offset(self, offset: Offset) -> Offset:
        """An offset of the CoM after the motion."""
        R = rotation(self.yaw)
        return Offset(frozen_copy(R @ offset.position), frozen_copy(R @ offset.dcm))


def anchoring(model: FootState, measured: SolePose) -> PlanarTransform:
    """The motion of the plane that puts the model's sole on the measured one."""
    yaw = (measured.yaw - model.yaw + np.pi) % (2.0 * np.pi) - np.pi
    return PlanarTransform(float(yaw), measured.position[:2] - rotation(float(yaw)) @ model.position)


def dcm_error(
    measured: Measurement,
    com: CoMState,
    offset: Offset,
    feet: Mapping[Side, FootState],
    standing: Sequence[Side],
    omega: float,
) -> Vector:
    """The DCM of the body against that of the model, both seen from the soles that stand [m], shape (2,).

    Args:
        measured: the body.
        com: the model's.
        offset: of the body's CoM from the model's, by the dynamic filter.
        feet: the model's.
        standing: sides of the feet that stand.
        omega: of the pendulum [1/s].
    """
    soles = np.mean([measured.soles[side].position[:2] for side in standing], axis=0)
    model_soles = np.mean([feet[side].position for side in standing], axis=0)
    position = (measured.com[:2] - soles) - (com.position + offset.position - model_soles)
    velocity = measured.com_velocity[:2] - (com.velocity + offset.velocity(omega))
    return position + velocity / omega


def catch_up(cop: Vector, error: Vector, stance: Stance, omega: float, period: float) -> Vector:
    """Velocity that the model takes over from the body in one period [m/s], shape (2,).

    Args:
        cop: of the model [m], shape (2,).
        error: of the DCM [m], shape (2,).
        stance: the soles that stand.
        omega: of the pendulum [1/s].
        period: [s].
    """
    lacking = 1.0 - share_inside(stance.polygon, cop, COP_GAIN * error)
    return omega * period * (MODEL_GAIN + SATURATED_GAIN * lacking) * error


def commanded_cop(cop: Vector, error: Vector, stance: Stance, margin: float) -> Vector:
    """The CoP to be commanded, world frame [m], shape (2,).

    Args:
        cop: of the motion of the body, if it were exact [m], shape (2,).
        error: of the DCM [m], shape (2,).
        stance: the soles that stand.
        margin: that it keeps from their edges [m]: nearer, they tip over them.
    """
    return nearest_within(_shrunk(stance.polygon, margin), cop + COP_GAIN * error)


def is_clipped(cop: Vector, error: Vector, commanded: Vector) -> bool:
    """Whether the soles cannot give the CoP that the feedback asks for; arguments as of `commanded_cop` [m]."""
    return float(np.max(np.abs(cop + COP_GAIN * error - commanded))) > 1e-3


def _shrunk(corners: Matrix, margin: float) -> Matrix:
    """A convex polygon, counter-clockwise, shrunk about its middle, where it is narrowest by a margin [m]."""
    return shrunk(corners, 1.0 - margin / depths(corners, corners.mean(axis=0)).min())


def share_inside(corners: Matrix, start: Vector, way: Vector) -> float:
    """The share of a way, from 0 to 1, after which it leaves a convex polygon; 0 if it starts outside.

    Args:
        corners: of the polygon, counter-clockwise, shape (V, 2).
        start: shape (2,).
        way: shape (2,).
    """
    depth, at_end = depths(corners, start), depths(corners, start + way)
    if np.any(depth < 0.0):
        return 0.0
    leaves = at_end < 0.0
    return float(np.min(depth[leaves] / (depth - at_end)[leaves], initial=1.0))
