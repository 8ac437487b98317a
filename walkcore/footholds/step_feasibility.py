# pyright: basic, reportMissingImports=false
# (Pinocchio ships no types)
"""Feasibility of one step of the whole body, simulated before anybody takes it: section 5.

Double support, then the swing of the left foot as `swing_foot` would do it, while the CoM
goes from between the feet to between the feet, as the pendulum of (5)-(6) does with its
CoP under the right foot:

    c(t) = (c_start sinh(w (T - t)) + c_end sinh(w t)) / sinh(w T),      w^2 = g/h.

Each instant is solved by inverse kinematics, and checked for the reach of the legs, joint
limits, collisions of the legs with each other, and joint speeds.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
import pinocchio as pin

from walkcore.errors import InvalidValueError, InverseKinematicsError
from walkcore.footholds.collisions import LegDistances, leg_joints
from walkcore.motion.swing_foot import FootState, standing, swing, swing_height
from walkcore.motion.whole_body import BodyTarget, WholeBody
from walkcore.mpc.gait import Gait, Phase
from walkcore.mpc.lipm import Pendulum
from walkcore.mpc.stance import Footstep, Side
from walkcore.robot import Robot
from walkcore.values import Vector, rotation

INSTANT = 0.02  # [s] from one check of a step to the next
KNEE_MARGIN = 0.1  # [rad] that a knee stays bent: it shortens the leg by 1 mm, and keeps its speed within bounds
MAX_IK_ERROR = 1e-3  # [m] or [rad], on CoM and soles
AT_LIMIT = 1e-3  # [rad] from a joint limit that holds up the inverse kinematics
SPEED_SHARE = 0.95  # of the URDF's joint speeds: what is measured here is the mean over an instant
NB_SETTLING = 3  # solutions of the inverse kinematics before a step begins


class Feasibility(IntEnum):
    """Feasibility of a step: safe, or the first reason against it."""

    SAFE = 0
    REACH = 1
    JOINT_LIMIT = 2
    COLLISION = 3
    JOINT_SPEED = 4

    @property
    def label(self) -> str:
        """Plain words, for tables and figures."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True, slots=True, eq=False)
class _Instant:
    """Target of the body at one time of a step, in the right foot's frame."""

    com: Vector
    left_foot: FootState


def placement_before(placement: Vector) -> Vector:
    """Place of the left foot in the right foot's frame, shape (3,), if the right one was placed against it.

    Args:
        placement: of the right foot, mirrored: x, y [m], yaw [rad], shape (3,).
    """
    x, y, yaw = placement
    return np.array([*(rotation(yaw) @ (-x, y)), yaw])


class StepFeasibility:
    """Simulates steps of one body at one CoM height. Holds scratch memory only: no step knows of another."""

    def __init__(self, robot: Robot, com_height: float | None = None, step_duration: float | None = None) -> None:
        """Load the body and its collision meshes.

        Args:
            robot: with a body.
            com_height: [m]; None takes the robot's own.
            step_duration: time from one touchdown to the next [s]; None takes the robot's own.

        Raises:
            InvalidValueError: if the robot has no body.
            InverseKinematicsError: if it cannot stand at that height.
        """
        if robot.body is None:
            raise InvalidValueError("robot", robot.name, "has no body that could be checked")
        p = robot.parameters
        duration = p.step_duration if step_duration is None else step_duration
        self._robot, self._parameters = robot, replace(p, control_period=INSTANT, step_duration=duration)
        self._gait = Gait(self._parameters.timing, Side.RIGHT, start=0)
        self.com_height = robot.com_height if com_height is None else com_height
        self._body = WholeBody(robot.body)
        model = self._body.model
        self._distances = LegDistances(robot.body, model)
        legs = [leg_joints(robot.body, model, side) for side in Side]
        self._leg_angles = np.array([model.joints[joint].idx_q for leg in legs for joint in leg])
        self._knee_angles = np.array([model.joints[leg[-3]].idx_q for leg in legs])  # a knee moves the shin
        feet = [standing(robot.foot_at_rest(side)) for side in Side]
        self._rest = self._body.at_rest(BodyTarget(np.array([0.0, 0.0, self.com_height]), *feet, heading=0.0))

    def placement(self, placement: Vector) -> Feasibility:
        """Feasibility of a placement in a walk of steps that mirror each other.

        Args:
            placement: x, y [m], yaw [rad] of the left foot in the right foot's frame, shape (3,).
        """
        return self.step(placement_before(placement), placement)

    def flies_in_time(self, before: Vector, after: Vector) -> bool:
        """Whether the speed bound (30) lets the foot of a step get from one placement to the other.

        Args:
            before: as of `step`.
            after: as of `step`.
        """
        p, robot = self._parameters, self._robot
        reach = np.array([*robot.max_foot_speed, robot.max_foot_yaw_rate]) * (p.step_duration - p.sampling_period)
        return bool(np.all(np.abs(after - before) <= reach))

    def step(self, before: Vector, after: Vector) -> Feasibility:
        """Feasibility of a step of the left foot.

        Args:
            before: where it stands, x, y [m], yaw [rad] in the right foot's frame, shape (3,).
            after: where it lands, shape (3,).
        """
        targets = [self._body_target(instant) for instant in self._instants(before, after)]
        q = self._rest
        for _ in range(NB_SETTLING):
            q = self._body.follow(q, targets[0], duration=1.0, tolerated=np.inf)
        is_too_fast = False  # returned last: a leg about to run out of reach is also fast
        for k, target in enumerate(targets):
            try:
                q_before, q = q, self._body.follow(q, target, INSTANT, tolerated=MAX_IK_ERROR)
            except InverseKinematicsError:
                return self._reason(self._body.follow(q, target, INSTANT, tolerated=np.inf))
            if np.any(self._bend(q) < KNEE_MARGIN):
                return Feasibility.REACH
            if self._distances.clearance(q) < 0.0:
                return Feasibility.COLLISION
            is_too_fast |= k > 0 and self._is_too_fast(q_before, q)
        return Feasibility.JOINT_SPEED if is_too_fast else Feasibility.SAFE

    def _instants(self, before: Vector, after: Vector) -> Iterator[_Instant]:
        """The step at times `INSTANT` apart, from touchdown to touchdown."""
        p, gait = self._parameters, self._gait
        nb_ticks = p.timing.ticks_per_step
        landing = Footstep(Side.LEFT, after[:2], float(after[2]))
        foot = standing(Footstep(Side.LEFT, before[:2], float(before[2])))
        max_speed = (*self._robot.max_foot_speed.tolist(), self._robot.max_foot_yaw_rate)
        for tick in range(nb_ticks + 1):
            yield _Instant(self._com(before[:2] / 2, after[:2] / 2, tick * INSTANT), foot)
            now = gait.at(tick)
            if tick < nb_ticks and now.phase is Phase.SINGLE_SUPPORT:
                height = swing_height(now.next_swing_progress, p.swing_height)
                foot = swing(foot, landing, now.time_to_touchdown, INSTANT, max_speed, 0.0, height)

    def _com(self, start: Vector, end: Vector, t: float) -> Vector:
        """CoM of the pendulum whose CoP stays at the origin [m], shape (3,)."""
        T, w = self._parameters.step_duration, Pendulum(self.com_height, self._parameters.gravity).omega
        horizontal = (start * math.sinh(w * (T - t)) + end * math.sinh(w * t)) / math.sinh(w * T)
        return np.array([*horizontal, self.com_height])

    def _body_target(self, instant: _Instant) -> BodyTarget:
        right_foot = standing(Footstep(Side.RIGHT, np.zeros(2), 0.0))
        return BodyTarget(instant.com, instant.left_foot, right_foot, heading=instant.left_foot.yaw / 2)

    def _bend(self, q: Vector) -> Vector:
        """Angles of the knees from straight [rad], shape (2,)."""
        model, knees = self._body.model, self._knee_angles
        straight = np.clip(0.0, model.lowerPositionLimit[knees], model.upperPositionLimit[knees])
        return np.abs(q[knees] - straight)

    def _reason(self, q: Vector) -> Feasibility:
        """The reason for which the inverse kinematics came no closer than to `q`."""
        lower, upper, legs = self._body.model.lowerPositionLimit, self._body.model.upperPositionLimit, self._leg_angles
        is_at_limit = np.minimum(q[legs] - lower[legs], upper[legs] - q[legs]) < AT_LIMIT
        is_straight = np.any(self._bend(q) < KNEE_MARGIN)
        return Feasibility.JOINT_LIMIT if np.any(is_at_limit) and not is_straight else Feasibility.REACH

    def _is_too_fast(self, before: Vector, now: Vector) -> bool:
        speed = np.abs(pin.difference(self._body.model, before, now))[6:] / INSTANT
        return bool(np.any(speed > SPEED_SHARE * self._body.model.velocityLimit[6:]))
