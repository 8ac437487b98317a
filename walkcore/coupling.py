"""The coupling of the model with the body: the body follows the model that plans, the model the body that is measured.

    model, seen = body.observe(model)                 at the beginning of a tick
    snapshot = body.follow(model, after, snapshot)    at its end, to the model at the next tick

The ideal plant does what is commanded, so there is nothing to observe. Of any other one the stabiliser's rules
(`plant/stabilizer.py`) say how the one follows the other. What led to a fall is noted on the way.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from walkcore.model import ModelState
from walkcore.motion.whole_body import Dynamics, WholeBody
from walkcore.mpc.gait import Phase
from walkcore.mpc.lipm import Pendulum
from walkcore.mpc.plan import Status
from walkcore.mpc.regions import nearest_within
from walkcore.mpc.stance import Side
from walkcore.parameters import Parameters
from walkcore.plant.driver import BodyDriver
from walkcore.plant.fall_watch import (
    SIGNS,
    LastPush,
    NeededStep,
    has_fallen,
    is_tilted,
    needed_step,
    phase_in_words,
)
from walkcore.plant.plant import ExternalForce, GroundContact, Measurement
from walkcore.plant.stabilizer import anchoring, catch_up, commanded_cop, dcm_error, is_clipped
from walkcore.plant.world import World
from walkcore.pushes import GivenPush
from walkcore.robot import BodyModel, Robot
from walkcore.snapshot import PlantTick, Snapshot
from walkcore.stages import Stages
from walkcore.values import Vector, freeze, rotation


class DrivenBody:
    """The body of a robot, driven by the motion of its model."""

    def __init__(
        self, robot: Robot, body: BodyModel, parameters: Parameters, pendulum: Pendulum, world: World, stages: Stages
    ) -> None:
        """Build the body and its plant; its driver's `reset` puts it at rest.

        Args:
            robot: with that body.
            body: its kinematics and inertias.
            parameters: name the plant.
            pendulum: that the model's CoM follows.
            world: that a plant with contact physics stands in.
            stages: listens to the stages of each tick.

        Raises:
            InvalidValueError: if this machine has not that plant.
        """
        self.whole_body = WholeBody(body)
        self.driver = BodyDriver(robot, self.whole_body, parameters, world, stages)
        """Drives the plant."""
        self._robot, self._pendulum, self._stages = robot, pendulum, stages
        self._period = parameters.control_period

    def observe(self, model: ModelState) -> tuple[ModelState, PlantTick | None]:
        """Let the model follow the body.

        Args:
            model: at this tick.

        Returns:
            The model after that, and the body; None instead of the ideal one.
        """
        driver = self.driver
        measured, contact = driver.plant.measure(), driver.plant.ground()
        if measured is None or contact is None:
            return model, None
        if model.gait.begins_step(model.tick):
            model = self._anchored(model, measured)
        error = driver.late(self._dcm_error(model, measured, contact))
        pendulum, stance = self._pendulum, model.stance(self._robot.sole)
        velocity = catch_up(pendulum.cop(model.com), error, stance, pendulum.omega, self._period)
        seen = PlantTick(measured, contact, freeze(error), driver.q, freeze(velocity))
        return model.pushed(velocity), seen

    def observe_fallen(self) -> PlantTick | None:
        """The body of a robot that has fallen, which no model follows; None instead of the ideal one."""
        driver = self.driver
        measured, contact = driver.plant.measure(), driver.plant.ground()
        if measured is None or contact is None:
            return None
        zero = freeze(np.zeros(2))
        return PlantTick(measured, contact, zero, driver.q, zero)

    def has_fallen(self, seen: PlantTick) -> bool:
        """Whether the body lies, or can no longer be caught."""
        return has_fallen(seen.measured, self._pendulum.height)

    def _anchored(self, model: ModelState, measured: Measurement) -> ModelState:
        """The whole model moved over the ground to where its support foot stands; it goes on as before, elsewhere."""
        motion = anchoring(model.support_foot, measured.soles[model.gait_state.support_side])
        self.driver.move_model(motion)
        return replace(
            model,
            com=motion.com(model.com),
            com_offset=motion.offset(model.com_offset),
            left_foot=motion.foot(model.left_foot),
            right_foot=motion.foot(model.right_foot),
        )

    def _dcm_error(self, model: ModelState, truth: Measurement, contact: GroundContact) -> Vector:
        gait = model.gait_state
        standing = list(Side) if gait.phase is Phase.STANDING else [gait.support_side]
        sensed = self.driver.sensed(truth, contact, standing, model.tick)
        return dcm_error(sensed, model.com, model.com_offset, model.feet, standing, self._pendulum.omega)

    def follow(
        self, model: ModelState, after: ModelState, snapshot: Snapshot, forces: tuple[ExternalForce, ...]
    ) -> Snapshot:
        """Move the body to the next tick.

        Args:
            model: at this tick.
            after: the model at the next one.
            snapshot: of this tick.
            forces: that push the body.

        Returns:
            The snapshot with the true CoP, and in the ideal plant with the torques that this motion takes.

        Raises:
            InverseKinematicsError: if the ideal body cannot follow; it is where it was.
        """
        on_ground, target = [foot.side for foot in snapshot.stance.feet], after.body_target(self._pendulum.height)
        plant = snapshot.plant
        if plant is None:
            dynamics = self.driver.drive(target, on_ground, snapshot.push / self._period, (), None)
            self._note(self._limits_of_plan(snapshot), model)
            return replace(snapshot, true_cop=dynamics.true_cop, torques=dynamics.torques)
        margin = self._robot.tipping_margin
        command = partial(commanded_cop, error=plant.dcm_error, stance=snapshot.stance, margin=margin)
        has_already = self._robot.mass * plant.caught_up / self._period
        dynamics = self.driver.drive(target, on_ground, has_already, forces, command)
        self._note(self._limits_of_body(plant, dynamics, snapshot) | self._limits_of_plan(snapshot), model)
        plant = replace(plant, commanded_cop=dynamics.commanded_cop)
        return replace(snapshot, true_cop=dynamics.true_cop, plant=plant)

    def _limits_of_plan(self, snapshot: Snapshot) -> dict[str, bool]:
        """Which of its limits the plan has reached, by the names of `SIGNS`."""
        return {
            "step_too_short": snapshot.status is Status.RELAXED,
            "not_capturable": snapshot.plan is not None and not snapshot.plan.is_capturable,
        }

    def _limits_of_body(self, plant: PlantTick, dynamics: Dynamics, snapshot: Snapshot) -> dict[str, bool]:
        """Which of its limits the body has reached, by the names of `SIGNS`."""
        return {
            "cop_at_edge": is_clipped(dynamics.true_cop, plant.dcm_error, dynamics.commanded_cop),
            "torque_saturated": self.driver.saturated(plant.measured.torques),
            "sole_tilted": any(is_tilted(plant.measured.soles[foot.side]) for foot in snapshot.stance.feet),
        }

    def _note(self, reached: dict[str, bool], model: ModelState) -> None:
        """Remember the limits that are reached at this tick."""
        signs, now = self.driver.signs, [name for name in SIGNS if reached.get(name)]
        step = self._step_out_of_reach(model) if "not_capturable" in now and signs.step is None else None
        self.driver.signs = signs.seen(now, model.tick, self._period, step)

    def note_push(self, push: GivenPush, model: ModelState, goes_on: bool) -> None:
        """Remember a push, for the words that tell a fall.

        Args:
            push: that begins at this tick.
            model: at this tick, before the push.
            goes_on: whether it is another piece of the last one, which is held.
        """
        gait, (forward, left) = model.gait_state, (rotation(model.heading).T @ push.impulse).tolist()
        words = phase_in_words(gait.phase is Phase.SINGLE_SUPPORT, gait.phase is Phase.STANDING, gait.support_side)
        self.driver.signs = self.driver.signs.pushed(LastPush(push.tick, forward, left, words), goes_on)

    def reason_of_fall(self, reason: str, model: ModelState) -> str:
        """The words that tell a fall, by the last push and the limits that were reached.

        Args:
            reason: as the planner or the inverse kinematics gave it; empty of a body that lies.
            model: at the tick of the fall.
        """
        signs = self.driver.signs
        if self.driver.is_ideal and signs.push is not None:
            self._note({"not_capturable": True}, model)
            signs = self.driver.signs
        told = signs.explain(model.tick, self._period)
        if self.driver.is_ideal:
            return told if signs.push is not None or signs.signs else reason
        return f"{told}; {reason}" if reason else told

    @property
    def needed_step(self) -> NeededStep | None:
        """The step that was needed when the DCM left the capturable set, where it was out of reach."""
        return self.driver.signs.step

    def _step_out_of_reach(self, model: ModelState) -> NeededStep | None:
        """The step that would stop the robot, if it is out of reach, with the CoP as near to the DCM as it can be."""
        gait, pendulum, support = model.gait_state, self._pendulum, model.support_foot
        time = model.gait.timing.step_duration if gait.phase is Phase.STANDING else gait.time_to_touchdown
        dcm = pendulum.dcm(model.com)
        cop = nearest_within(model.stance(self._robot.sole).polygon, dcm)
        away = cop + (dcm - cop) * np.exp(pendulum.omega * time) - support.position
        region = self._robot.foothold_region_at(0.0, gait.support_side.other)
        foot = model.footstep(gait.support_side)
        return needed_step(foot, rotation(support.yaw).T @ away, region, self._robot.sole)
