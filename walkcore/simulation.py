"""The robot's state and its tick: command in, snapshot out.

The one place of the core that remembers, and the one that decides what a failed solve means. With the ideal
plant the state is the model's own: what the QP plans is what happens. Any other plant is measured at
each tick, and the model follows it by the rules of the stabiliser.
"""

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from walkcore.command import Command, Push, Reference
from walkcore.errors import InvalidValueError, InverseKinematicsError, NoSolutionFoundError, OutOfTimeError
from walkcore.motion.dynamic_filter import NO_OFFSET, Motion, Offset, dcm_offset
from walkcore.motion.swing_foot import Flight, FootState, bump_at, retimed_flight, standing, swing, swing_height
from walkcore.motion.whole_body import BodyTarget, Dynamics, WholeBody
from walkcore.mpc.gait import Gait, GaitState, Phase
from walkcore.mpc.lipm import CoMState
from walkcore.mpc.pattern_generator import PatternGenerator
from walkcore.mpc.plan import Plan, Status
from walkcore.mpc.qp import QP
from walkcore.mpc.regions import nearest_within, polygon
from walkcore.mpc.schemes import Footholds
from walkcore.mpc.stance import Footstep, Side, Stance
from walkcore.mpc.step_timing import AdaptiveTiming
from walkcore.mpc.supports import CaptureSets, WalkingProblem
from walkcore.parameters import Parameters
from walkcore.plant.driver import BodyDriver
from walkcore.plant.fall_watch import (
    FallSigns,
    LastPush,
    NeededStep,
    has_fallen,
    is_tilted,
    needed_step,
    phase_in_words,
)
from walkcore.plant.plant import ExternalForce, GroundContact, Measurement
from walkcore.plant.stabilizer import PlanarTransform, anchoring, catch_up, commanded_cop, dcm_error, is_clipped
from walkcore.plant.world import PERFECT, World
from walkcore.pushes import NO_IMPULSE, Pushes
from walkcore.robot import Robot
from walkcore.robot_file import load_robot
from walkcore.snapshot import PlantTick, Snapshot
from walkcore.stages import UNTIMED, Stages, TimeLeft, unlimited
from walkcore.state import SimulationState
from walkcore.values import Vector, freeze, frozen_copy, rotation

NOT_IN_TIME = "the last plan goes on: there was no time to solve this tick"


class Simulation:
    """A robot that walks to commands, tick by tick. The same commands give the same snapshots."""

    def __init__(
        self,
        robot: Robot | None = None,
        parameters: Parameters | None = None,
        stages: Stages = UNTIMED,
        world: World = PERFECT,
    ) -> None:
        """Put the robot at rest on both feet around the origin.

        Args:
            robot: Talos if none is given.
            parameters: the robot's own if none are given: the paper's, for Talos and HRP-2.
            stages: listens to the stages of each tick; it never changes what they decide.
            world: that a plant with contact physics stands in; the ideal plant and the model know only the perfect one.

        Raises:
            InvalidValueError: if this machine has not the plant that the parameters name.
            InverseKinematicsError: if the body cannot stand at this CoM height.
            EmptyRegionError: if the CoP margin leaves nothing of a sole.
        """
        self.robot = load_robot("talos") if robot is None else robot
        self.parameters = self.robot.parameters if parameters is None else parameters
        self._stages = stages
        self._generator = PatternGenerator(self.robot, self.parameters, stages)
        self._step_timing = self._make_step_timing()
        self.world = world
        if self.robot.body is None and self.parameters.plant != "ideal":
            limit = f"needs a body; {self.robot.name} is a point mass with feet"
            raise InvalidValueError("plant", self.parameters.plant, limit)
        self.body = WholeBody(self.robot.body) if self.robot.body is not None else None
        self._driver = None if self.body is None else BodyDriver(self.robot, self.body, self.parameters, world, stages)
        self._twin: Simulation | None = None
        self._spare_twin: Simulation | None = None
        self._max_foot_speed = (*self.robot.max_foot_speed.tolist(), self.robot.max_foot_yaw_rate)
        self.reset()
        self._switch_twin()

    def keep_twin_ready(self) -> None:
        """Build the twin that may be wanted later, so that no tick of a walk waits for it."""
        if self._twin is None and self._spare_twin is None and self._driver is not None and not self._driver.is_ideal:
            self._spare_twin = Simulation(self.robot, self._parameters_of_twin)

    @property
    def _parameters_of_twin(self) -> Parameters:
        return replace(self.parameters, plant="ideal", twin=False)

    def _switch_twin(self, sets: CaptureSets | None = None) -> None:
        """Let the ideal robot walk beside this one, or no longer; where this one is ideal itself there is none.

        Args:
            sets: as of `change`.
        """
        if not self.parameters.twin:
            self._spare_twin, self._twin = self._twin or self._spare_twin, None
            return
        twin = self._twin
        if twin is None:
            self.keep_twin_ready()
            twin, self._spare_twin = self._spare_twin, None
            if twin is not None:
                twin.restore(self.state)
        if twin is not None and twin.parameters != self._parameters_of_twin:
            twin.change(self._parameters_of_twin, sets)
        self._twin = twin

    def change(self, parameters: Parameters, sets: CaptureSets | None = None) -> None:
        """Walk on with other parameters; a step under way keeps its duration.

        Args:
            parameters: all of them.
            sets: of `capture_sets` for them, where somebody has computed them beforehand: they take the longest.

        Raises:
            InvalidValueError: for one that cannot change during a walk.
            EmptyRegionError: if the CoP margin leaves nothing of a sole; the old parameters stay.
        """
        generator = PatternGenerator(self.robot, self.parameters.check_change(parameters), self._stages, sets)
        self._gait = self._gait.with_timing(parameters.timing, self._tick)
        self.parameters, self._generator = parameters, generator
        self._step_timing = self._make_step_timing()
        self._switch_twin(sets)

    def _make_step_timing(self) -> AdaptiveTiming | None:
        """None for steps of fixed duration, and for a scheme whose QP does not choose the footholds."""
        p = self.parameters
        is_adaptive = p.step_timing == "adaptive" and p.formulation.footholds is Footholds.FREE
        return AdaptiveTiming(self.robot, p, self._generator, self._stages) if is_adaptive else None

    def reset(self) -> None:
        """Back to rest at the origin, at tick 0."""
        self._tick = 0
        self._gait = Gait(self.parameters.timing)
        self._flight: Flight | None = None
        self._feet = {side: standing(self.robot.foot_at_rest(side)) for side in Side}
        middle = np.mean([foot.position for foot in self._feet.values()], axis=0)
        self._com = CoMState.at_rest(middle)
        self._pushes = Pushes()
        self._why_fallen = ""
        self._last_plan: Plan | None = None
        self._offset = NO_OFFSET
        if self._driver is not None:
            self._driver.reset(self._body_target())
        if self._twin is not None:
            self._twin.reset()

    @property
    def state(self) -> SimulationState:
        """The whole state of the robot, for `restore` of this or another simulation of it."""
        return SimulationState(
            tick=self._tick,
            gait=self._gait,
            flight=self._flight,
            left_foot=self._feet[Side.LEFT],
            right_foot=self._feet[Side.RIGHT],
            com=self._com,
            pushes=self._pushes.under_way,
            why_fallen=self._why_fallen,
            com_offset=self._offset,
            driver=None if self._driver is None else self._driver.state,
            twin=None if self._twin is None else self._twin.state,
        )

    def restore(self, state: SimulationState) -> None:
        """Go on from a state of the same robot, with the parameters that are in force here.

        Raises:
            InvalidValueError: if the state is without the configuration of this robot's body.
        """
        if self._driver is not None and state.driver is None:
            raise InvalidValueError("state.q", None, f"must be a configuration of {self.robot.name}")
        self._tick, self._gait = state.tick, state.gait.with_timing(self.parameters.timing, state.tick)
        self._feet = {Side.LEFT: state.left_foot, Side.RIGHT: state.right_foot}
        self._flight = state.flight
        last = self._pushes.last  # of the walk so far, unless that went on for longer than to this state
        self._pushes = Pushes(state.pushes, last if last is not None and last.tick < state.tick else None)
        self._com, self._why_fallen = state.com, state.why_fallen
        self._offset, self._last_plan = state.com_offset, None
        if self._driver is not None and state.driver is not None:
            self._driver.restore(state.driver)
        if self._twin is not None:
            self._twin.restore(state if state.twin is None else state.twin)

    @property
    def heading(self) -> float:
        """Mean yaw of the feet [rad]."""
        return (self._feet[Side.LEFT].yaw + self._feet[Side.RIGHT].yaw) / 2

    def step(self, command: Command | None = None, time_left: TimeLeft = unlimited) -> Snapshot:
        """Advance by one tick. Never raises for what happens to the robot: that is in `status`.

        Args:
            command: holds for this tick; by default the robot stays where it is.
            time_left: for the decision [s]. Once it is over no other solve begins: the best plan so far counts, or
                the one of the last tick goes on, which `reason` then says. By default every tick is solved.

        Raises:
            InvalidValueError: for a push on a link that the body does not have; nothing has happened then.

        Returns:
            The state that the QP saw, after this tick's push, and what it decided.
        """
        self._stages.start()
        command = Command() if command is None else command
        if command.push is not None and self._driver is not None:
            self._driver.check_link(command.push.link)
        snapshot = self._step(command, time_left)
        if self._twin is not None:
            snapshot = replace(snapshot, twin=self._twin.step(command))
            self._stages.lap("twin")
        return snapshot

    def _step(self, command: Command, time_left: TimeLeft) -> Snapshot:
        impulse, forces = self._pushed(command.push)
        plant = self._observe(impulse)
        plan = self._last_plan = self._decide(command.reference, time_left)
        gait = self._gait.at(self._tick)
        snapshot = self._snapshot(command.reference, impulse, plan, gait, plant)
        self._stages.lap("snapshot")
        if plan is not None:
            self._advance(plan, gait)
        if self._driver is not None:
            snapshot = self._drive(self._driver, snapshot, forces)
        self._tick += 1
        return snapshot

    def _observe(self, impulse: Vector) -> PlantTick | None:
        """Take in the push of this tick and the measured plant; None if all went as planned."""
        driver = self._driver
        measured = None if driver is None else driver.plant.measure()
        if driver is None or measured is None:
            if impulse is not NO_IMPULSE:
                self._com = self._com.pushed(impulse / self.robot.mass)
            return None
        contact, error, caught_up = driver.plant.ground(), np.zeros(2), NO_IMPULSE
        assert contact is not None
        if not self._why_fallen:
            if self._gait.begins_step(self._tick):
                self._move_model(anchoring(self._feet[self._support_side], measured.soles[self._support_side]))
            error = driver.late(self._dcm_error(driver, measured, contact))
            caught_up = self._catch_up(error)
            self._watch_for_fall(measured)
        self._stages.lap("plant")
        return PlantTick(measured, contact, freeze(error), driver.q, caught_up)

    def _catch_up(self, error: Vector) -> Vector:
        """Let the model follow the body, and return the velocity that it takes over [m/s], shape (2,)."""
        pendulum, stance = self._generator.pendulum, self._stance(self._gait.at(self._tick))
        velocity = catch_up(pendulum.cop(self._com), error, stance, pendulum.omega, self.parameters.control_period)
        self._com = self._com.pushed(velocity)
        return freeze(velocity)

    @property
    def _support_side(self) -> Side:
        return self._gait.support_side(self._tick)

    def _move_model(self, motion: PlanarTransform) -> None:
        """Move the whole model over the ground; it goes on as before, elsewhere."""
        assert self._driver is not None
        self._com, self._offset = motion.com(self._com), motion.offset(self._offset)
        self._feet = {side: motion.foot(foot) for side, foot in self._feet.items()}
        self._driver.move_model(motion)
        self._last_plan = None  # it was elsewhere

    def _dcm_error(self, driver: BodyDriver, truth: Measurement, contact: GroundContact) -> Vector:
        gait, omega = self._gait.at(self._tick), self._generator.pendulum.omega
        standing = list(Side) if gait.phase is Phase.STANDING else [gait.support_side]
        sensed = driver.sensed(truth, contact, standing, self._tick)
        return dcm_error(sensed, self._com, self._offset, self._feet, standing, omega)

    def _watch_for_fall(self, measured: Measurement) -> None:
        if has_fallen(measured, self._generator.pendulum.height):
            self._fall_down("")

    def preview(self, command: Command) -> Snapshot:
        """The snapshot of the next tick if this command came; nothing of the robot changes.

        Without the body: its joints are those of the present, its true CoP and torques are None.
        """
        ghost = copy(self)
        ghost._feet, ghost.body, ghost._driver, ghost._stages = dict(self._feet), None, None, UNTIMED
        ghost._twin = ghost._spare_twin = None
        return ghost.step(command)

    def _pushed(self, push: Push | None) -> tuple[Vector, tuple[ExternalForce, ...]]:
        """All pushes under way at this tick: their impulse in the world frame [N s], shape (2,), and their forces."""
        period = self.parameters.control_period
        if push is not None:
            goes_on = self._pushes.goes_on(self._tick, period)
            self._pushes = self._pushes.with_push(push, self.heading, self._tick, period)
            self._remember_push(goes_on)
        if not self._pushes.under_way:
            return NO_IMPULSE, ()
        pushes, self._pushes = self._pushes, self._pushes.one_tick_later()
        return NO_IMPULSE if self._why_fallen else pushes.impulse, pushes.forces(period)

    def _remember_push(self, goes_on: bool) -> None:
        """Keep the last push, or another piece of one that is held, for the words that tell a fall of the body."""
        push = self._pushes.last
        if push is None or self._driver is None or self._why_fallen:
            return
        gait, (forward, left) = self._gait.at(self._tick), (rotation(self.heading).T @ push.impulse).tolist()
        words = phase_in_words(gait.phase is Phase.SINGLE_SUPPORT, gait.phase is Phase.STANDING, gait.support_side)
        self._driver.signs = self._driver.signs.pushed(LastPush(self._tick, forward, left, words), goes_on)

    def _decide(self, reference: Reference, time_left: TimeLeft) -> Plan | None:
        """The plan of this tick, or none if the robot has fallen."""
        if self._why_fallen:
            return None
        support, _ = self._support_and_swing(self._gait.support_side(self._tick))
        distance, limit = math.dist(self._com.position.tolist(), support.position.tolist()), self.robot.max_com_distance
        if distance > limit:
            self._fall_down(f"the CoM is {distance:.2f} m beside the support foot, the leg reaches {limit:.2f} m")
            return None
        if not self.parameters.formulation.is_constrained:
            x, y = cop = self._generator.pendulum.cop(self._com)
            if polygon(self._stance(self._gait.at(self._tick)).corners).excess(cop) > 0.0:
                self._fall_down(f"the CoP left the soles at ({x:.3f}, {y:.3f}) m")
                return None
        walks = self.parameters.stepping_in_place or not reference.is_zero
        candidates = self._gait.candidates(self._tick, walks, _first_support(reference))
        if self._step_timing is None:
            return self._first_that_works(candidates, reference, time_left)
        return self._adapted(self._step_timing, candidates, reference, time_left)

    def _adapted(
        self, step_timing: AdaptiveTiming, candidates: tuple[Gait, ...], reference: Reference, time_left: TimeLeft
    ) -> Plan | None:
        """Take the gait of adaptive step timing."""
        last, swing = self._last_plan, self._feet[self._gait.support_side(self._tick).other]
        is_pushed = self._pushes.last is not None and self._pushes.last.tick == self._tick
        try:
            gait, plan = step_timing.decide(
                candidates,
                self._tick,
                swing.height,
                lambda gait: self._problem(gait, reference),
                is_disturbed=is_pushed or (last is not None and last.status is Status.RELAXED),
                time_left=unlimited if last is None else time_left,
            )
        except OutOfTimeError:
            assert last is not None
            return self._generator.continued(last, self._problem(self._gait, reference))
        except NoSolutionFoundError as failure:
            self._fall_down(f"no step can catch the robot: {failure}")
            return None
        self._retime_flight(gait)
        self._gait = gait
        return plan

    def _retime_flight(self, gait: Gait) -> None:
        """The foot in the air goes to the ground by the touchdown of this gait, if it is another one than so far."""
        before, tick, p = self._gait, self._tick, self.parameters
        (begin, touchdown), (_, new_touchdown) = before.step_ticks(tick), gait.step_ticks(tick)
        now = before.at(tick)
        if now.phase is not Phase.SINGLE_SUPPORT or new_touchdown == touchdown:
            return
        lift_off = begin + p.timing.ticks_per_sample
        if self._flight is not None:
            height = self._flight.at(tick, p.control_period)
        else:
            height = bump_at(now.swing_progress, p.swing_height, (touchdown - lift_off) * p.control_period)
        apex = p.swing_height * (new_touchdown - lift_off) / (touchdown - lift_off)
        self._flight = retimed_flight(height, tick, new_touchdown, p.control_period, apex)

    def _first_that_works(self, candidates: tuple[Gait, ...], reference: Reference, time_left: TimeLeft) -> Plan | None:
        """Take the first gait whose plan keeps every margin, else the first that does not lead to a fall."""
        last = self._last_plan
        plans: list[tuple[Gait, Plan]] = []
        reasons: list[str] = []
        for gait in candidates:
            try:
                plan = self._generator.plan(self._problem(gait, reference), unlimited if last is None else time_left)
            except OutOfTimeError:
                if last is not None and not plans:
                    return self._generator.continued(last, self._problem(self._gait, reference))
                break
            except NoSolutionFoundError as failure:
                reasons.append(str(failure))
                continue
            plans.append((gait, plan))
            if plan.status is Status.SOLVED:
                break
        if not plans:
            self._fall_down(f"no step can catch the robot: {reasons[0]}")
            return None
        gait, plan = max(plans, key=lambda choice: _promise(choice[1]))
        self._gait = gait
        return plan

    def qp(self, reference: Reference) -> QP:
        """The paper's QP of the coming tick, if the gait goes on as it is."""
        return self._generator.qp(self._problem(self._gait, reference))

    def _problem(self, gait: Gait, reference: Reference) -> WalkingProblem:
        support, swing = self._support_and_swing(gait.support_side(self._tick))
        horizon = gait.horizon(self._tick)
        problem = WalkingProblem(self._com, support, swing, horizon, reference, self.heading)
        self._stages.lap("gait")
        return problem

    def _support_and_swing(self, side: Side) -> tuple[Footstep, Footstep]:
        """The foot of a side, and the other one, where they are."""
        feet = self._feet
        return _footstep(side, feet[side]), _footstep(side.other, feet[side.other])

    def _stance(self, gait: GaitState) -> Stance:
        """The foot, or both feet, on the ground."""
        support, swing = self._support_and_swing(gait.support_side)
        return Stance((support,) if gait.phase is Phase.SINGLE_SUPPORT else (support, swing), self.robot.sole)

    def _fall_down(self, reason: str) -> None:
        """Let the robot lie until a reset, for a reason, which the push and the limits that were reached explain."""
        driver, p = self._driver, self.parameters
        if driver is not None:
            if driver.is_ideal and driver.signs.push is not None:
                driver.signs = driver.signs.seen(("not_capturable",), self._tick, p.control_period, self._needed_step())
            told = driver.signs.explain(self._tick, p.control_period)
            if not driver.is_ideal:
                reason = f"{told}; {reason}" if reason else told
            elif driver.signs.push is not None or driver.signs.signs:
                reason = told
        self._why_fallen, self._flight = reason, None
        self._com = CoMState.at_rest(self._com.position)

    def _needed_step(self) -> NeededStep | None:
        """The step that would stop the robot, if it is out of reach, with the CoP as near to the DCM as it can be."""
        gait, pendulum = self._gait.at(self._tick), self._generator.pendulum
        time = gait.time_to_touchdown if gait.phase is not Phase.STANDING else self.parameters.step_duration
        dcm = pendulum.dcm(self._com)
        cop = nearest_within(self._stance(gait).polygon, dcm)
        support = self._feet[gait.support_side]
        away = cop + (dcm - cop) * np.exp(pendulum.omega * time) - support.position
        region = self.robot.foothold_region_at(0.0, gait.support_side.other)
        return needed_step(rotation(support.yaw).T @ away, region, self.robot.sole)

    def _snapshot(
        self, reference: Reference, impulse: Vector, plan: Plan | None, gait: GaitState, plant: PlantTick | None
    ) -> Snapshot:
        stance = self._stance(gait)
        horizon = plan or self._gait.horizon(self._tick).stances
        step_duration, next_step_duration = self._gait.step_durations(self._tick)
        return Snapshot(
            tick=self._tick,
            t=self._tick * self.parameters.control_period,
            com=self._com,
            pendulum=self._generator.pendulum,
            jerk=NO_IMPULSE if plan is None else plan.jerks[0],
            cop=freeze(self._generator.pendulum.cop(self._com)),
            true_cop=None,
            torques=None if plant is None else plant.measured.torques,
            reference=reference,
            heading=self.heading,
            phase=gait.phase,
            support=stance.feet[0],
            stance=stance,
            samples_on_support=horizon.samples_on_support,
            time_to_touchdown=gait.time_to_touchdown,
            step_duration=step_duration,
            next_step_duration=next_step_duration,
            steps_to_stand=gait.steps_to_stand,
            left_foot=self._feet[Side.LEFT],
            right_foot=self._feet[Side.RIGHT],
            push=frozen_copy(impulse),
            last_push=self._pushes.last,
            status=Status.FALLEN if plan is None else plan.status,
            reason=NOT_IN_TIME if plan is not None and plan.is_continued else self._why_fallen,
            plan=plan,
            com_offset=self._offset.position,
            q=self._configuration if plant is None else plant.measured.q,
            plant=plant,
        )

    @property
    def _configuration(self) -> Vector | None:
        return None if self._driver is None else self._driver.q

    def _advance(self, plan: Plan, now: GaitState) -> None:
        """CoM and feet at the next tick."""
        p, tick = self.parameters, self._tick
        if p.dynamic_filter and self._driver is not None:
            self._offset = self._next_offset(plan, now)
            self._stages.lap("dynamic_filter")
        if now.phase is Phase.SINGLE_SUPPORT:
            self._swing_foot(plan.footholds[0], now)
        self._com = self._com.integrated(plan.jerks[0], p.control_period)
        if self._gait.has_ended(tick + 1):
            self._gait = Gait(p.timing, self._gait.support_side(tick + 1))
        else:
            self._gait = self._gait.at_next_step(p.timing, tick + 1)
        self._stages.lap("swing_foot")

    def _swing_foot(self, foothold: Footstep, now: GaitState) -> None:
        """The foot in the air at the next tick."""
        p, side = self.parameters, now.support_side.other
        if self._flight is None:
            height = swing_height(now.next_swing_progress, p.swing_height)
        else:
            height, _, _ = self._flight.at(self._tick + 1, p.control_period)
        self._feet[side] = swing(
            self._feet[side],
            foothold,
            time_left=now.time_to_touchdown,
            tick=p.control_period,
            max_speed=self._max_foot_speed,
            support_yaw=self._feet[now.support_side].yaw,
            height=height,
        )
        if self._flight is not None and self._flight.touchdown == self._tick + 1:
            self._flight = None

    def _next_offset(self, plan: Plan, now: GaitState) -> Offset:
        p, side = self.parameters, now.support_side
        motion = Motion(
            p.sampling_period,
            *self._gait.step_durations(self._tick),
            now.time_to_touchdown,
            p.swing_height,
            self._com,
            support=self._feet[side],
            swing=self._feet[side.other],
            plan=plan,
        )
        omega = self._generator.pendulum.omega
        dcm = dcm_offset(motion, self.robot.swing_moments, omega)
        return self._offset.towards(dcm, omega, self.parameters.control_period)

    def _body_target(self) -> BodyTarget:
        com = np.array([*(self._com.position + self._offset.position), self._generator.pendulum.height])
        return BodyTarget(com, self._feet[Side.LEFT], self._feet[Side.RIGHT], self.heading)

    def _drive(self, driver: BodyDriver, snapshot: Snapshot, forces: tuple[ExternalForce, ...]) -> Snapshot:
        """The body follows to the next tick, from which the true CoP at this one is known."""
        if self._why_fallen:
            driver.let_go(forces)
            return snapshot
        on_ground, plant = [foot.side for foot in snapshot.stance.feet], snapshot.plant
        if plant is not None:
            margin = self.robot.tipping_margin
            command = partial(commanded_cop, error=plant.dcm_error, stance=snapshot.stance, margin=margin)
            has_already = self.robot.mass * plant.caught_up / self.parameters.control_period
            dynamics = driver.drive(self._body_target(), on_ground, has_already, forces, command)
            driver.signs = self._signs_of_fall(driver, snapshot, plant, dynamics)
            plant = replace(plant, commanded_cop=dynamics.commanded_cop)
            return replace(snapshot, true_cop=dynamics.true_cop, plant=plant)
        try:
            push = snapshot.push / self.parameters.control_period
            dynamics = driver.drive(self._body_target(), on_ground, push, (), None)
        except InverseKinematicsError as failure:
            self._fall_down(str(failure))
            return replace(snapshot, status=Status.FALLEN, reason=self._why_fallen, plan=None)
        driver.signs = self._signs_of_model(driver, snapshot)
        return replace(snapshot, true_cop=dynamics.true_cop, torques=dynamics.torques)

    def _signs_of_model(self, driver: BodyDriver, snapshot: Snapshot) -> FallSigns:
        """The limits that the plan reached at this tick, added to those before, where nothing measures the body."""
        is_lost = snapshot.plan is not None and not snapshot.plan.is_capturable
        reached = {"step_too_short": snapshot.status is Status.RELAXED, "not_capturable": is_lost}
        now = [name for name, is_reached in reached.items() if is_reached]
        return self._seen(driver, now, is_lost)

    def _seen(self, driver: BodyDriver, now: Sequence[str], is_lost: bool) -> FallSigns:
        step = self._needed_step() if is_lost and driver.signs.step is None else None
        return driver.signs.seen(now, self._tick, self.parameters.control_period, step)

    def _signs_of_fall(self, driver: BodyDriver, snapshot: Snapshot, plant: PlantTick, dynamics: Dynamics) -> FallSigns:
        """The limits that are reached at this tick, added to those before."""
        reached = {
            "cop_at_edge": is_clipped(dynamics.true_cop, plant.dcm_error, dynamics.commanded_cop),
            "torque_saturated": driver.saturated(plant.measured.torques),
            "step_too_short": snapshot.status is Status.RELAXED,
            "not_capturable": snapshot.plan is not None and not snapshot.plan.is_capturable,
            "sole_tilted": any(is_tilted(plant.measured.soles[foot.side]) for foot in snapshot.stance.feet),
        }
        now = [name for name, is_reached in reached.items() if is_reached]
        return self._seen(driver, now, reached["not_capturable"])


def _promise(plan: Plan) -> tuple[bool, bool, bool]:
    """Rank of a plan: the greatest keeps all margins, then come those that can catch the robot, then those that try."""
    return plan.status is Status.SOLVED, plan.is_capturable, plan.is_capturable or bool(plan.footholds)


def _first_support(reference: Reference) -> Side:
    """The foot that carries the first step: the other one goes where the reference leads."""
    goes_left = reference.vy > 0.0 or (reference.vy == 0.0 and reference.yaw_rate > 0.0)
    return Side.RIGHT if goes_left else Side.LEFT


@lru_cache(maxsize=8)  # a tick reads its feet several times
def _footstep(side: Side, foot: FootState) -> Footstep:
    return Footstep(side, foot.position, foot.yaw)
