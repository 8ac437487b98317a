# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false
# (Pinocchio and MuJoCo ship no types that hold)
"""Contact physics: a body that stands on the ground by the forces of its soles, is shoved, and falls.

MuJoCo integrates the body at 1 kHz. Its joints are driven by position servos with feed-forward torques,

    torque = kp (q_ref - q) + kd (dq_ref - dq) + torque_ff,    within the effort limits of the URDF,

and q_ref runs from one configuration of the walk to the next in a straight line.
"""

import math

import mujoco
import numpy as np
import pinocchio as pin

from walkcore.errors import InvalidValueError
from walkcore.mpc.stance import Side
from walkcore.plant.mujoco_model import PHYSICS_PERIOD, build
from walkcore.plant.plant import ExternalForce, GroundContact, JointCommand, Measurement, PlantState, SolePose
from walkcore.plant.world import World
from walkcore.robot import Robot
from walkcore.values import Vector, frozen_copy

BASE = 7  # numbers of the floating base in a configuration
WRENCH = 8  # numbers that tell the forces of the ground: force, moment, normal force on each sole
CARRIES = 20.0  # [N] below which a sole carries next to nothing
LIMP_DAMPING = 2.0  # [N m s/rad] of a joint whose servo is off
STATE = mujoco.mjtState.mjSTATE_INTEGRATION.value


class MujocoPlant:
    """One robot in MuJoCo. Belongs to one thread."""

    def __init__(self, robot: Robot, pinocchio: pin.Model, world: World, gravity: float) -> None:
        """Build the world.

        Args:
            robot: with a body.
            pinocchio: model of that body, with its free flyer.
            world: the ground, and what the robot carries.
            gravity: magnitude of its acceleration [m/s^2].
        """
        self._built = build(robot, pinocchio, world, gravity)
        self._model = self._built.model
        self._data = mujoco.MjData(self._model)
        self._kp, self._kd = np.ascontiguousarray(self._built.servos.T)
        self._servo = self._model.actuator_gainprm.copy(), self._model.actuator_biasprm.copy()
        self._is_limp = False
        self._wrench, self._torques = np.zeros(WRENCH), frozen_copy(np.zeros(self._model.nu))

    def reset(self, q: Vector) -> None:
        """See `Plant`."""
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:] = _mujoco_order(q)
        self._data.ctrl[:] = q[BASE:]
        self._switch_servos(is_limp=False)
        mujoco.mj_forward(self._model, self._data)
        self._wrench, self._torques = self._contact_wrench(), frozen_copy(self._data.actuator_force)

    def measure(self) -> Measurement:
        """See `Plant`."""
        model, data = self._model, self._data
        mujoco.mj_subtreeVel(model, data)
        soles = {side: _pose(data.site_xpos[site], data.site_xmat[site]) for side, site in self._built.soles.items()}
        upright = float(np.clip(data.xmat[self._built.torso][8], -1.0, 1.0))
        return Measurement(
            com=frozen_copy(data.subtree_com[1]),
            com_velocity=frozen_copy(data.subtree_linvel[1]),
            soles=soles,
            q=frozen_copy(_pinocchio_order(data.qpos)),
            tilt=math.acos(upright),
            torques=self._torques,
        )

    def ground(self) -> GroundContact:
        """See `Plant`."""
        force, moment, (left, right) = self._wrench[:3], self._wrench[3:6], self._wrench[6:]
        cop = None if force[2] < CARRIES else frozen_copy(np.array([-moment[1], moment[0]]) / force[2])
        return GroundContact(cop, {Side.LEFT: float(left), Side.RIGHT: float(right)}, frozen_copy(force))

    def _contact_wrench(self) -> Vector:
        """Force of the ground on the soles, its moment about the origin, then the normal force on each sole."""
        model, data = self._model, self._data
        mujoco.mj_rnePostConstraint(model, data)
        wrench = np.zeros(WRENCH)
        for number, side in enumerate(Side):
            foot = self._built.feet[side]
            on_foot = data.cfrc_ext[foot]  # moment about the whole body's CoM, then force
            wrench[:3] += on_foot[3:]
            wrench[3:6] += on_foot[:3] + np.cross(data.subtree_com[model.body_rootid[foot]], on_foot[3:])
            wrench[6 + number] = on_foot[5]
        return wrench

    def advance(self, command: JointCommand, duration: float) -> None:
        """See `Plant`."""
        model, data = self._model, self._data
        if command.is_limp is not self._is_limp:
            self._switch_servos(command.is_limp)
        data.xfrc_applied[:] = 0.0
        for force in command.forces:
            self._apply(force)
        start, end = command.q[BASE:], command.q_next[BASE:]
        speed = (end - start) / duration
        ahead = (self._kd * speed + command.torques) / self._kp
        nb_steps = round(duration / PHYSICS_PERIOD)
        for k in range(nb_steps):
            data.ctrl[:] = start + (k + 1) / nb_steps * (end - start) + ahead
            mujoco.mj_step2(model, data)
            mujoco.mj_step1(model, data)  # so that what is measured is of the same instant
        self._wrench, self._torques = self._contact_wrench(), frozen_copy(data.actuator_force)

    @property
    def state(self) -> PlantState:
        """See `Plant`."""
        numbers = np.empty(mujoco.mj_stateSize(self._model, STATE))
        mujoco.mj_getState(self._model, self._data, numbers, STATE)
        return PlantState(frozen_copy([*numbers, *self._wrench, *self._torques]), self._is_limp)

    def restore(self, state: PlantState) -> None:
        """See `Plant`."""
        size = mujoco.mj_stateSize(self._model, STATE)
        if len(state.numbers) != size + WRENCH + self._model.nu:
            raise InvalidValueError("state.plant.numbers", len(state.numbers), "is not of this robot and this plant")
        self._wrench = np.array(state.numbers[size : size + WRENCH])
        self._torques = frozen_copy(state.numbers[size + WRENCH :])
        mujoco.mj_resetData(self._model, self._data)
        mujoco.mj_setState(self._model, self._data, np.array(state.numbers[:size]), STATE)
        self._switch_servos(state.is_limp)
        mujoco.mj_step1(self._model, self._data)

    def _apply(self, push: ExternalForce) -> None:
        """Add a force to the link that it acts on."""
        data = self._data
        body = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, push.link) if push.link else self._built.torso
        data.xfrc_applied[body, :3] += push.force
        if push.point is not None:
            at = data.xpos[body] + data.xmat[body].reshape(3, 3) @ push.point
            data.xfrc_applied[body, 3:] += np.cross(at - data.xipos[body], push.force)

    def _switch_servos(self, is_limp: bool) -> None:
        self._is_limp = is_limp
        gain, bias = self._servo
        self._model.actuator_gainprm[:] = 0.0 if is_limp else gain
        self._model.actuator_biasprm[:] = 0.0 if is_limp else bias
        if is_limp:
            self._model.actuator_biasprm[:, 2] = -LIMP_DAMPING


def _pose(position: Vector, rotation: Vector) -> SolePose:
    upright = float(np.clip(rotation[8], -1.0, 1.0))
    return SolePose(frozen_copy(position), math.atan2(rotation[3], rotation[0]), math.acos(upright))


def _mujoco_order(q: Vector) -> Vector:
    """Pinocchio's quaternions are xyzw, MuJoCo's wxyz; the joints come in the same order."""
    return np.concatenate([q[:3], q[6:7], q[3:6], q[BASE:]])


def _pinocchio_order(qpos: Vector) -> Vector:
    return np.concatenate([qpos[:3], qpos[4:7], qpos[3:4], qpos[BASE:]])
