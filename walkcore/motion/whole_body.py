# pyright: basic, reportMissingImports=false
# (Pinocchio and Pink ship no types)
"""Whole-body kinematics and dynamics: CoM, feet and torso to joint angles, and back to the true centre of pressure.

Inverse kinematics: Pink's weighted tasks on Pinocchio, within joint limits. True CoP:
full inverse dynamics of the motion (`pin.rnea`), where the paper's model (5)-(6)
neglects what the turning of the body's parts adds.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from pink import Configuration, solve_ik
from pink.exceptions import PinkError
from pink.tasks import ComTask, FrameTask, PostureTask

from walkcore.errors import InverseKinematicsError
from walkcore.motion.body_model import load_model
from walkcore.motion.swing_foot import FootState
from walkcore.mpc.stance import Side
from walkcore.robot import BodyModel
from walkcore.values import Matrix, Vector, frozen_copy

LIMIT_MARGIN = 1e-3  # [rad] kept from joint limits: some joints of a posture lie on theirs
TOLERANCE = 1e-4  # [m] or [rad], on the CoM and the soles: a tenth of what a walk allows
MAX_ITERATIONS = 8  # of the inverse kinematics in one tick
MAX_ERROR = 0.01  # [m] or [rad] beyond which the body has not followed
SOLE_COST, COM_COST, TORSO_COST, POSTURE_COST = 10.0, 10.0, 1.0, 0.02
DAMPING = 1e-9  # of the inverse kinematics


@dataclass(frozen=True, slots=True, eq=False)
class BodyTarget:
    """Target of the whole body at one tick, in the world frame."""

    com: Vector
    """[m], shape (3,)."""
    left_foot: FootState
    right_foot: FootState
    heading: float
    """Yaw of the upright torso [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class Dynamics:
    """Centre of pressure and torques of a motion of the whole body."""

    true_cop: Vector
    """Centre of pressure on the ground [m], shape (2,)."""
    commanded_cop: Vector
    """Centre of pressure that the torques produce: the same, unless another one is commanded [m], shape (2,)."""
    torques: Vector
    """Torques of the joints, in Pinocchio's order [N m], shape (nv - 6,)."""


class WholeBody:
    """Kinematics and dynamics of one robot. Holds scratch memory, no state of the walk."""

    def __init__(self, body: BodyModel) -> None:
        """Load the model of a body."""
        self.model = load_model(body)
        posture = self.model.referenceConfigurations["posture"]
        has_limit = self.model.upperPositionLimit < 1e20
        has_limit[:7] = False  # the floating base
        self.model.lowerPositionLimit[has_limit] += LIMIT_MARGIN
        self.model.upperPositionLimit[has_limit] -= LIMIT_MARGIN
        lower, upper = self.model.lowerPositionLimit + LIMIT_MARGIN, self.model.upperPositionLimit - LIMIT_MARGIN
        self.posture = frozen_copy(np.where(has_limit, np.clip(posture, lower, upper), posture))
        self._data, self._data_of_dynamics = self.model.createData(), self.model.createData()
        self._configuration = Configuration(self.model, self._data, self.posture, copy_data=False)
        self._soles = {
            side: FrameTask(body.sole(side), position_cost=SOLE_COST, orientation_cost=SOLE_COST) for side in Side
        }
        self._com = ComTask(cost=COM_COST)
        self._torso = FrameTask(body.torso, position_cost=0.0, orientation_cost=TORSO_COST)
        self._posture = PostureTask(cost=POSTURE_COST)
        self._posture.set_target(self.posture)
        self._tasks = [*self._soles.values(), self._com, self._torso, self._posture]

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in Pinocchio's order."""
        return tuple(self.model.names[2:])

    @property
    def max_torques(self) -> Vector:
        """Effort limits of the URDF [N m], shape (nv - 6,)."""
        return np.array(self.model.effortLimit[6:])

    @property
    def max_speeds(self) -> Vector:
        """Velocity limits of the URDF [rad/s], shape (nv - 6,)."""
        return np.array(self.model.velocityLimit[6:])

    @property
    def mass(self) -> float:
        """Mass of all links [kg]."""
        return float(pin.computeTotalMass(self.model))

    def at_rest(self, target: BodyTarget) -> Vector:
        """A configuration that meets the target, from the robot's posture, shape (nq,).

        Raises:
            InverseKinematicsError: if there is none.
        """
        q = np.array(self.posture)
        for _ in range(100):
            q_next = self.follow(q, target, 0.1, tolerated=np.inf)
            if np.max(np.abs(pin.difference(self.model, q, q_next))) < 1e-7:
                break
            q = q_next
        return self.follow(q, target, 0.1)

    def follow(self, q: Vector, target: BodyTarget, duration: float, tolerated: float = MAX_ERROR) -> Vector:
        """The configuration that follows the target one tick later, shape (nq,), read-only.

        Args:
            q: configuration now, in Pinocchio's order, shape (nq,).
            target: to be met.
            duration: of the tick, for joint speed limits [s].
            tolerated: error of CoM or soles that is still a success [m] or [rad].

        Raises:
            InverseKinematicsError: if CoM or soles stay further away than that.
        """
        for side, foot in ((Side.LEFT, target.left_foot), (Side.RIGHT, target.right_foot)):
            self._soles[side].set_target(sole_placement(foot))
        self._com.set_target(target.com)
        self._torso.set_target(pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, target.heading), np.zeros(3)))

        if q is not self._configuration.q:  # else its kinematics are those of the last tick's end
            self._configuration = Configuration(self.model, self._data, q, copy_data=False)
        configuration = self._configuration
        error = np.inf
        for _ in range(MAX_ITERATIONS):
            try:
                velocity = solve_ik(configuration, self._tasks, duration, solver="quadprog", damping=DAMPING)
            except PinkError as failure:
                raise InverseKinematicsError(f"inverse kinematics failed: {failure}") from failure
            q_next = configuration.integrate(velocity, duration)
            configuration.update(q_next)
            error = self._error(configuration)
            if error < TOLERANCE:
                break
        if not error <= tolerated:
            raise InverseKinematicsError(f"CoM or a sole is {error:.3f} m or rad away from its target")
        return frozen_copy(configuration.q)

    def _error(self, configuration: Configuration) -> float:
        """Largest error of the CoM and the soles [m] or [rad]."""
        tasks = (self._com, *self._soles.values())
        return max(float(np.max(np.abs(task.compute_error(configuration)))) for task in tasks)

    def errors(self, q: Vector, com: Vector, feet: Mapping[Side, FootState]) -> tuple[float, float]:
        """Errors of the CoM, and of the sole that is further off [m].

        Args:
            q: configuration, shape (nq,).
            com: target, world frame [m], shape (3,).
            feet: targets.
        """
        data = self._data_of_dynamics  # the other one is what the inverse kinematics goes on from
        pin.framesForwardKinematics(self.model, data, q)
        off = [
            data.oMf[self.model.getFrameId(self._soles[side].frame)].translation - [*foot.position, foot.height]
            for side, foot in feet.items()
        ]
        com_off = pin.centerOfMass(self.model, data, q) - com
        return float(np.linalg.norm(com_off)), max(float(np.linalg.norm(one)) for one in off)

    def dynamics(
        self,
        before: Vector,
        now: Vector,
        after: Vector,
        tick: float,
        push: Vector,
        on_ground: Sequence[Side],
        command: Callable[[Vector], Vector] | None = None,
    ) -> Dynamics:
        """Full inverse dynamics of the motion through three configurations.

        Args:
            before: configuration one tick ago, shape (nq,).
            now: shape (nq,).
            after: one tick ahead, shape (nq,).
            tick: [s].
            push: horizontal force that acts on the CoM from outside [N], shape (2,).
            on_ground: feet that carry the robot.
            command: gives the CoP to be commanded from that of the motion; by default it is the same.
        """
        model, data = self.model, self._data_of_dynamics
        arriving = pin.difference(model, before, now) / tick
        leaving = pin.difference(model, now, after) / tick
        torques = pin.rnea(model, data, now, (arriving + leaving) / 2, (leaving - arriving) / tick)
        # What ground and push give the floating base, in the world; the push acts on the CoM.
        com = pin.centerOfMass(model, data, now)  # places the joints, too, which `rnea` does not
        total = data.oMi[1].act(data.f[1])
        push_force = np.array([*push, 0.0])
        force, moment = total.linear - push_force, total.angular - pin.skew(com) @ push_force
        cop = commanded = np.array([-moment[1], moment[0]]) / force[2]
        if command is not None:
            commanded = command(cop)
            moment = moment + np.cross([*(commanded - cop), 0.0], force)
        for wrench, jacobian in self._contacts(now, commanded, force, moment, on_ground):
            torques = torques - jacobian.T @ wrench
        return Dynamics(frozen_copy(cop), frozen_copy(commanded), frozen_copy(torques[6:]))

    def _contacts(
        self, q: Vector, cop: Vector, force: Vector, moment: Vector, on_ground: Sequence[Side]
    ) -> Iterator[tuple[Vector, Matrix]]:
        """Wrench on each sole and the Jacobian of that sole, both at its origin along the axes of the world.

        On two feet the ground's force is shared as the CoP lies between them.
        """
        model, data = self.model, self._data_of_dynamics
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        frames = [model.getFrameId(self._soles[side].frame) for side in on_ground]
        points = [data.oMf[frame].translation for frame in frames]
        shares = [1.0]
        if len(points) == 2:
            across = points[1][:2] - points[0][:2]
            second = float(np.clip((cop - points[0][:2]) @ across / (across @ across), 0.0, 1.0))
            shares = [1.0 - second, second]
        left_over = moment - sum(share * pin.skew(p) @ force for share, p in zip(shares, points, strict=True))
        for frame, share in zip(frames, shares, strict=True):
            jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            wrench: Vector = np.multiply(share, np.concatenate([force, left_over]))
            yield wrench, jacobian


def moved_on_ground(q: Vector, yaw: float, translation: Vector) -> Vector:
    """A configuration whose floating base is turned about the world's origin by `yaw` [rad], then moved [m].

    Args:
        q: configuration, shape (nq,).
        yaw: [rad].
        translation: [m], shape (2,).
    """
    motion = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw), np.array([*translation, 0.0]))
    return frozen_copy(np.concatenate([pin.SE3ToXYZQUAT(motion * pin.XYZQUATToSE3(q[:7])), q[7:]]))


def sole_placement(foot: FootState) -> pin.SE3:
    """T_world_sole of a flat foot."""
    return pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, foot.yaw), np.array([*foot.position, foot.height]))
