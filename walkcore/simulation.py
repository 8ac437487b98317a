"""The robot's state and its tick: command in, snapshot out.

The one place of the core that remembers, and the one that decides what a failed solve means. With the ideal
plant the state is the model's own: what the QP plans is what happens. Any other plant is measured at
each tick, and the model follows it (`coupling.py`).
"""

from copy import copy
from dataclasses import replace

import numpy as np

from walkcore.command import Command, Push, Reference
from walkcore.coupling import DrivenBody
from walkcore.errors import FallError, InvalidValueError, InverseKinematicsError
from walkcore.model import ModelMotion, ModelState, model_at_rest
from walkcore.motion.whole_body import WholeBody
from walkcore.mpc.balance_sets import BalanceSets
from walkcore.mpc.plan import Plan, Status
from walkcore.mpc.qp import QP
from walkcore.parameters import Parameters
from walkcore.planner import Planner
from walkcore.plant.plant import ExternalForce
from walkcore.plant.world import PERFECT, World
from walkcore.pushes import NO_IMPULSE, Pushes
from walkcore.robot import Robot
from walkcore.robot_file import DEFAULT_ROBOT, load_robot
from walkcore.snapshot import PlantTick, Snapshot
from walkcore.stages import UNTIMED, Stages, TimeLeft, unlimited
from walkcore.state import SimulationState
from walkcore.values import Vector, freeze, frozen_copy

NO_JERK = freeze(np.zeros(2))
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
            robot: `DEFAULT_ROBOT` if none is given.
            parameters: the robot's own if none are given.
            stages: listens to the stages of each tick; it never changes what they decide.
            world: that a plant with contact physics stands in; the ideal plant and the model know only the perfect one.

        Raises:
            InvalidValueError: if this machine has not the plant that the parameters name.
            InverseKinematicsError: if the body cannot stand at this CoM height.
            EmptyRegionError: if the CoP margin leaves nothing of a sole.
        """
        self.robot = load_robot(DEFAULT_ROBOT) if robot is None else robot
        self.world, self._stages = world, stages
        self._use(self.robot.parameters if parameters is None else parameters)
        self._body = self._make_body()
        self._twin: Simulation | None = None
        self._spare_twin: Simulation | None = None
        self.reset()
        self._switch_twin()

    def _use(self, parameters: Parameters, sets: BalanceSets | None = None) -> None:
        """Decide and move by these parameters from now on."""
        self._planner = Planner(self.robot, parameters, self._stages, sets)
        self._motion = ModelMotion(self.robot, parameters, self._planner.pendulum, self._stages)
        self.parameters = parameters

    def _make_body(self) -> DrivenBody | None:
        robot, p = self.robot, self.parameters
        if robot.body is None:
            if p.plant != "ideal":
                raise InvalidValueError("plant", p.plant, f"needs a body; {robot.name} is a point mass with feet")
            return None
        return DrivenBody(robot, robot.body, p, self._planner.pendulum, self.world, self._stages)

    @property
    def body(self) -> WholeBody | None:
        """Kinematics and dynamics of the body; None for a point mass with feet."""
        return None if self._body is None else self._body.whole_body

    def keep_twin_ready(self) -> None:
        """Build the twin that may be wanted later, so that no tick of a walk waits for it."""
        if (
            self._twin is None
            and self._spare_twin is None
            and self._body is not None
            and not self._body.driver.is_ideal
        ):
            self._spare_twin = Simulation(self.robot, self._parameters_of_twin)

    @property
    def _parameters_of_twin(self) -> Parameters:
        return replace(self.parameters, plant="ideal", twin=False)

    def _switch_twin(self, sets: BalanceSets | None = None) -> None:
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

    def change(self, parameters: Parameters, sets: BalanceSets | None = None) -> None:
        """Walk on with these parameters; a step under way keeps its duration.

        Args:
            parameters: all of them.
            sets: of `balance_sets` for them, where somebody has computed them beforehand: they take the longest.

        Raises:
            InvalidValueError: for one that cannot change during a walk.
            EmptyRegionError: if the CoP margin leaves nothing of a sole; the old parameters stay.
        """
        if parameters == self.parameters:
            return
        self._use(self.parameters.check_change(parameters), sets)
        self._model = self._model.with_timing(parameters.timing)
        self._switch_twin(sets)

    def reset(self) -> None:
        """Back to rest at the origin, at tick 0."""
        self._model = model_at_rest(self.robot, self.parameters.timing)
        self._pushes = Pushes()
        self._why_fallen = ""
        self._last_plan: Plan | None = None
        if self._body is not None:
            self._body.driver.reset(self._model.body_target(self._planner.pendulum.height))
        if self._twin is not None:
            self._twin.reset()

    @property
    def state(self) -> SimulationState:
        """The whole state of the robot, for `restore` of this or another simulation of it."""
        return SimulationState(
            model=self._model,
            pushes=self._pushes.under_way,
            why_fallen=self._why_fallen,
            driver=None if self._body is None else self._body.driver.state,
            twin=None if self._twin is None else self._twin.state,
        )

    def restore(self, state: SimulationState) -> None:
        """Go on from a state of the same robot, with the parameters that are in force here.

        Raises:
            InvalidValueError: if the state is without the configuration of this robot's body.
        """
        if self._body is not None and state.driver is None:
            raise InvalidValueError("state.q", None, f"must be a configuration of {self.robot.name}")
        self._model = state.model.with_timing(self.parameters.timing)
        last = self._pushes.last  # of the walk so far, unless that went on for longer than to this state
        self._pushes = Pushes(state.pushes, last if last is not None and last.tick < state.model.tick else None)
        self._why_fallen, self._last_plan = state.why_fallen, None
        if self._body is not None and state.driver is not None:
            self._body.driver.restore(state.driver)
        if self._twin is not None:
            self._twin.restore(state if state.twin is None else state.twin)

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
        if command.push is not None and self._body is not None:
            self._body.driver.check_link(command.push.link)
        snapshot = self._step(command, time_left)
        if self._twin is not None:
            snapshot = replace(snapshot, twin=self._twin.step(command))
            self._stages.lap("twin")
        return snapshot

    def preview(self, command: Command) -> Snapshot:
        """The snapshot of the next tick if this command came; nothing of the robot changes.

        Without the body: its joints are those of the present, its true CoP and torques are None.
        """
        future = copy(self)
        future._body, future._stages = None, UNTIMED
        future._twin = future._spare_twin = None
        return future.step(command)

    def qp(self, reference: Reference) -> QP:
        """The paper's QP of the coming tick, if the gait goes on as it is."""
        return self._planner.qp(self._model, reference)

    def _step(self, command: Command, time_left: TimeLeft) -> Snapshot:
        impulse, forces = self._pushed(command.push)
        plant = self._observe(impulse)
        plan = self._last_plan = self._decide(command.reference, time_left)
        snapshot = self._snapshot(command.reference, impulse, plan, plant)
        self._stages.lap("snapshot")
        model = self._model
        self._model = model.one_tick_later() if plan is None else self._motion.advance(model, plan)
        return snapshot if self._body is None else self._follow(self._body, model, snapshot, forces)

    def _pushed(self, push: Push | None) -> tuple[Vector, tuple[ExternalForce, ...]]:
        """All pushes under way at this tick: their impulse in the world frame [N s], shape (2,), and their forces."""
        period, model = self.parameters.control_period, self._model
        if push is not None:
            goes_on = self._pushes.goes_on(model.tick, period)
            self._pushes = self._pushes.with_push(push, model.heading, model.tick, period)
            if self._body is not None and self._pushes.last is not None and not self._why_fallen:
                self._body.note_push(self._pushes.last, model, goes_on)
        if not self._pushes.under_way:
            return NO_IMPULSE, ()
        pushes, self._pushes = self._pushes, self._pushes.one_tick_later()
        return NO_IMPULSE if self._why_fallen else pushes.impulse, pushes.forces(period)

    def _observe(self, impulse: Vector) -> PlantTick | None:
        """The measured plant; None of the ideal one, whose model takes the push of this tick here."""
        if self._body is None or self._body.driver.is_ideal:
            if impulse is not NO_IMPULSE:
                self._model = self._model.pushed(impulse / self.robot.mass)
            return None
        if self._why_fallen:
            seen = self._body.observe_fallen()
        else:
            before = self._model
            self._model, seen = self._body.observe(before)
            if self._model.support_foot is not before.support_foot:  # the plan was made for another place
                self._last_plan = None
            if seen is not None and self._body.has_fallen(seen):
                self._fall("")
        self._stages.lap("plant")
        return seen

    def _decide(self, reference: Reference, time_left: TimeLeft) -> Plan | None:
        """The plan of this tick, or none if the robot has fallen."""
        if self._why_fallen:
            return None
        is_pushed = self._pushes.last is not None and self._pushes.last.tick == self._model.tick
        try:
            gait, plan = self._planner.decide(
                self._model, reference, self._last_plan, is_pushed=is_pushed, time_left=time_left
            )
        except FallError as failure:
            self._fall(str(failure))
            return None
        self._model = self._model.with_gait(gait, self.parameters.swing_height)
        return plan

    def _fall(self, reason: str) -> None:
        """Let the robot lie until a reset, for a reason, which the push and the limits that were reached explain."""
        self._why_fallen = reason if self._body is None else self._body.reason_of_fall(reason, self._model)
        self._model = self._model.fallen()

    def _follow(
        self, body: DrivenBody, model: ModelState, snapshot: Snapshot, forces: tuple[ExternalForce, ...]
    ) -> Snapshot:
        """The body follows to the next tick, from which the true CoP at this one is known."""
        if self._why_fallen:
            body.driver.let_go(forces)
            return snapshot
        try:
            return body.follow(model, self._model, snapshot, forces)
        except InverseKinematicsError as failure:
            self._fall(str(failure))
            step = body.needed_step
            return replace(snapshot, status=Status.FALLEN, reason=self._why_fallen, plan=None, needed_step=step)

    def _snapshot(self, reference: Reference, impulse: Vector, plan: Plan | None, plant: PlantTick | None) -> Snapshot:
        model, pendulum, gait = self._model, self._planner.pendulum, self._model.gait_state
        stance = model.stance(self.robot.sole)
        horizon = plan or model.gait.horizon(model.tick).stances
        step_duration, next_step_duration = model.gait.step_durations(model.tick)
        return Snapshot(
            tick=model.tick,
            t=model.tick * self.parameters.control_period,
            com=model.com,
            pendulum=pendulum,
            jerk=NO_JERK if plan is None else plan.jerk,
            cop=freeze(pendulum.cop(model.com)),
            true_cop=None,
            torques=None if plant is None else plant.measured.torques,
            reference=reference,
            heading=model.heading,
            phase=gait.phase,
            support=stance.feet[0],
            stance=stance,
            samples_on_support=horizon.samples_on_support,
            time_to_touchdown=gait.time_to_touchdown,
            step_duration=step_duration,
            next_step_duration=next_step_duration,
            steps_to_stand=gait.steps_to_stand,
            left_foot=model.left_foot,
            right_foot=model.right_foot,
            push=frozen_copy(impulse),
            last_push=self._pushes.last,
            status=Status.FALLEN if plan is None else plan.status,
            reason=NOT_IN_TIME if plan is not None and plan.is_continued else self._why_fallen,
            plan=plan,
            com_offset=model.com_offset.position,
            needed_step=self._body.needed_step if plan is None and self._body is not None else None,
            q=self._configuration if plant is None else plant.measured.q,
            plant=plant,
        )

    @property
    def _configuration(self) -> Vector | None:
        return None if self._body is None else self._body.driver.q
