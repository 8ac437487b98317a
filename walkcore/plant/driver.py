"""The driver of one body: from targets of the CoM and the feet to joint configurations, torques, and the plant."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from walkcore.errors import InvalidValueError
from walkcore.motion.whole_body import BodyTarget, Dynamics, WholeBody, moved_on_ground
from walkcore.mpc.stance import Side
from walkcore.parameters import Parameters
from walkcore.plant.driver_state import DriverState, SensorState
from walkcore.plant.fall_watch import FallSigns
from walkcore.plant.plant import ExternalForce, GroundContact, IdealPlant, JointCommand, Measurement, Plant
from walkcore.plant.sensors import Estimate, NoisySensors
from walkcore.plant.stabilizer import PlanarTransform
from walkcore.plant.world import World
from walkcore.robot import Robot
from walkcore.stages import Stages
from walkcore.values import Vector, check_choice


class BodyDriver:
    """The joints of one body, the plant that they move, and the sensors that see it."""

    def __init__(self, robot: Robot, body: WholeBody, parameters: Parameters, world: World, stages: Stages) -> None:
        """Put the plant in place; `reset` puts the body at rest.

        Args:
            robot: with that body.
            body: its kinematics and dynamics.
            parameters: name the plant.
            world: that a plant with contact physics stands in.
            stages: listens to the stages of each tick.

        Raises:
            InvalidValueError: if this machine has not that plant.
        """
        self._body, self._period, self._stages = body, parameters.control_period, stages
        self.is_ideal = parameters.plant == "ideal"
        self.plant = IdealPlant() if self.is_ideal else _mujoco_plant(robot, body, world, parameters.gravity)
        self._sensors = _noisy_sensors(robot, body, world) if world.sensors == "noisy" and not self.is_ideal else None
        self._nb_delayed = round(world.delay / self._period)
        self._delayed: tuple[Vector, ...] = ()
        self._max_torques = body.max_torques
        self.signs = FallSigns()
        self.q = self._q_before = body.posture

    def reset(self, target: BodyTarget) -> None:
        """Put the body at rest on a target.

        Raises:
            InverseKinematicsError: if it cannot stand there.
        """
        self.q = self._q_before = self._body.at_rest(target)
        self.plant.reset(self.q)
        self._forget()

    def _forget(self, sensors: SensorState | None = None, signs: FallSigns | None = None) -> None:
        sensors = SensorState() if sensors is None else sensors
        self._delayed, self.signs = sensors.delayed, FallSigns() if signs is None else signs
        if self._sensors is not None:
            self._sensors.estimate = sensors.estimate

    def move_model(self, motion: PlanarTransform) -> None:
        """Move the commanded configurations over the ground; no joint moves."""
        self.q = moved_on_ground(self.q, motion.yaw, motion.translation)
        self._q_before = moved_on_ground(self._q_before, motion.yaw, motion.translation)

    def sensed(self, truth: Measurement, contact: GroundContact, standing: Sequence[Side], tick: int) -> Measurement:
        """The body as the robot's own sensors see it.

        Args:
            truth: the body as it is.
            contact: the forces of the ground.
            standing: sides of the soles that stand.
            tick: of the measurement.
        """
        if self._sensors is None:
            return truth
        return self._sensors.observe(truth, contact, standing, tick, self._period)

    def late(self, error: Vector) -> Vector:
        """The measured error of the DCM that has arrived by now, for one that is measured now [m], shape (2,)."""
        if self._nb_delayed == 0:
            return error
        self._delayed = (*self._delayed, error)[-self._nb_delayed - 1 :]
        return self._delayed[0] if len(self._delayed) > self._nb_delayed else np.zeros(2)

    def check_link(self, link: str) -> None:
        """Refuse a link that the body does not have; empty stands for the torso.

        Raises:
            InvalidValueError: naming the links.
        """
        if link:
            check_choice("push.link", link, self._body.joint_names)

    def saturated(self, torques: Vector) -> bool:
        """Whether a joint gives all the torque that it has [N m], shape (nv - 6,)."""
        return bool(np.any(np.abs(torques) >= SATURATED * self._max_torques))

    def drive(
        self,
        target: BodyTarget,
        on_ground: Sequence[Side],
        push: Vector,
        forces: tuple[ExternalForce, ...],
        command_cop: Callable[[Vector], Vector] | None,
    ) -> Dynamics:
        """Follow a target for one tick.

        A body that really moves follows as far as it can; the ideal one has fallen where it cannot.

        Args:
            target: of the coming tick.
            on_ground: feet that carry the robot.
            push: horizontal force on the CoM that the motion accounts for [N], shape (2,).
            forces: on the plant.
            command_cop: see `WholeBody.dynamics`.

        Returns:
            CoP and torques of the motion.

        Raises:
            InverseKinematicsError: if the ideal body cannot follow.
        """
        now, period = self.q, self._period
        tolerated = {} if self.is_ideal else {"tolerated": np.inf}
        after = self._body.follow(now, target, period, **tolerated)
        self._stages.lap("inverse_kinematics")
        dynamics = self._body.dynamics(self._q_before, now, after, period, push, on_ground, command_cop)
        self._stages.lap("true_cop")
        self.plant.advance(JointCommand(now, after, dynamics.torques, forces), period)
        if not self.is_ideal:
            self._stages.lap("physics")
        self._q_before, self.q = now, after
        return dynamics

    def let_go(self, forces: tuple[ExternalForce, ...]) -> None:
        """Let the joints be limp for one tick, as those of a robot that has fallen."""
        nothing = np.zeros(len(self.q) - 7)
        self.plant.advance(JointCommand(self.q, self.q, nothing, forces, is_limp=True), self._period)

    @property
    def state(self) -> DriverState:
        """The state, for `restore`."""
        estimate = Estimate() if self._sensors is None else self._sensors.estimate
        return DriverState(self.q, self._q_before, self.plant.state, SensorState(estimate, self._delayed), self.signs)

    def restore(self, state: DriverState) -> None:
        """Go on from a state of the same body; from one of another plant, at rest in its configuration."""
        self.q, self._q_before = state.q, state.q_before
        if self.is_ideal or len(state.plant.numbers):
            self.plant.restore(state.plant)
        else:
            self.plant.reset(state.q)
        self._forget(state.sensors, state.signs)


SATURATED = 0.999  # of a limit


def _noisy_sensors(robot: Robot, body: WholeBody, world: World) -> NoisySensors:
    assert robot.body is not None
    return NoisySensors(robot.body, _model(body), world)


def _model(body: WholeBody) -> Any:
    return body.model  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType] (Pinocchio ships no types)


def _mujoco_plant(robot: Robot, body: WholeBody, world: World, gravity: float) -> Plant:
    try:
        from walkcore.plant.mujoco_plant import MujocoPlant
    except ImportError as error:
        limit = "needs the package mujoco-core, which is not installed here; 'ideal' does without"
        raise InvalidValueError("plant", "mujoco", limit) from error
    return MujocoPlant(robot, _model(body), world, gravity)
