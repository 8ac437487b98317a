"""The control loop's work: ticks the simulation, and carries out the server's requests between two ticks.

There are neither processes nor waiting in it, so that all of it can be tested tick by tick: `app.live.process` calls
`tick` when one is due.
"""

import logging
import math
import pickle
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.live.command_source import CommandSource
from app.live.fork import Fork, ForkedWalk, restored
from app.live.live_state import NO_REFERENCE, LiveState, RandomPushes, ReferenceCommand, SolveCounts
from app.live.messages import reason
from app.live.plant_choice import AS_CHOSEN, PlantChoice, suitable_plant
from app.live.session_log import SessionLog, read_packed
from app.live.tick_scheduler import TickScheduler
from app.live.timeline import Marks, Timeline
from walkcore import Command, Parameters, Push, Reference, Robot, Simulation, Snapshot
from walkcore.analysis.push_recovery import PushRecoveryMonitor, balance_state
from walkcore.analysis.twin import TwinMonitor
from walkcore.errors import InvalidValueError
from walkcore.mpc.plan import Status
from walkcore.plant.world import PERFECT, World
from walkcore.stages import CountedTime, Stopwatch, TimeLeft, unlimited
from walkcore.state import SimulationState

logger = logging.getLogger(__name__)

MAX_TICK_TIME = 0.05  # [s] of a tick, after which no solve begins any more and the last plan goes on


class NotPausedError(Exception):
    """Single ticks were requested of a robot that is running."""


class NothingToSaveError(Exception):
    """There was no walk before the last reset."""


class Control:
    """One robot that walks as it is commanded. Belongs to one thread.

    The methods that return a `LiveState` are requests of the server, and return the state that they lead to.
    """

    def __init__(
        self,
        robot: Robot,
        parameters: Parameters,
        publish: Callable[[LiveState], None],
        clock: Callable[[], float] = time.perf_counter,
        resumed: LiveState | None = None,
    ) -> None:
        """Put the robot at rest and take the first tick, so that there is a state to show; or go on with a walk.

        Args:
            robot: to walk.
            parameters: to begin with.
            publish: called with the state after each tick, and after each request that changes it.
            clock: reads the time on the wall [s].
            resumed: latest state of the walk to go on with, with these parameters; the robot stands at rest instead
                where it cannot.

        Raises:
            WalkError: if the robot cannot stand with these parameters.
        """
        self.parameters = parameters
        self._publish, self._clock = publish, clock
        self._stopwatch = Stopwatch(clock)
        world = PERFECT if resumed is None else resumed.world
        self._simulation = Simulation(robot, parameters, self._stopwatch, world=world)
        self._simulation.keep_twin_ready()
        self._scheduler = TickScheduler(parameters.control_period, clock)
        self._is_started = self._is_asleep = False
        self._attended_until = math.inf
        self._commands = CommandSource(parameters.control_period, clock)
        self._prepared_for, self._prepared = 0, list[bytes]()
        self._robot, self._recovery = robot, PushRecoveryMonitor()
        self._twin = TwinMonitor()
        self._log, self._marks = SessionLog(self._simulation), Marks()
        self._forked: ForkedWalk | None = None
        self.latest = self._first_state() if resumed is None else self._resumed_state(resumed)
        publish(self.latest)

    def _first_state(self) -> LiveState:
        self._log.begin()
        first = self._simulation.step()
        self._log.end(Command(), first)
        return LiveState(
            first,
            self._scheduler.timing,
            running=True,
            driver=NO_REFERENCE.driver,
            robot=self._robot.name,
            plant=self.parameters.plant,
            next_state=self._simulation.state,
            world=self._simulation.world,
        )

    def _resumed_state(self, resumed: LiveState) -> LiveState:
        self._commands.push_at_random(resumed.random_pushes)
        self._scheduler.set_speed(resumed.speed)
        if resumed.next_state is None or not self._can_restore(resumed.next_state):
            self._simulation.reset()
            return replace(
                self._first_state(),
                running=resumed.running,
                speed=resumed.speed,
                random_pushes=resumed.random_pushes,
                plant_reason=resumed.plant_reason,
            )
        self._scheduler.real_t = resumed.real_t
        return replace(
            resumed,
            timing=self._scheduler.timing,
            driver=NO_REFERENCE.driver,
            driver_client=NO_REFERENCE.client,
            walk=resumed.walk + 1,
            comparison=None,
            was=None,
        )

    def _can_restore(self, state: SimulationState) -> bool:
        """Go on from a state; False if there is no next tick."""
        try:
            self._simulation.restore(state)
            self._simulation.preview(Command())
        except Exception as error:
            logger.warning("the walk cannot go on (%s): the robot stands at rest", reason(error))
            return False
        return True

    @property
    def time_left(self) -> float:
        """Time until the next tick is due [s]; infinite while none is."""
        is_due = self._is_started and self.latest.running and not self._is_asleep
        return self._scheduler.time_left if is_due else math.inf

    def tick(self) -> None:
        """Take the tick that is due; an unexpected error pauses the robot."""
        self._scheduler.start_tick()
        end = self._clock() + MAX_TICK_TIME
        try:
            self._take_tick(lambda: end - self._clock())
        except Exception as error:
            self.fail(error)

    def start(self) -> LiveState:
        """Let time pass for the first time."""
        self._is_started = True
        self._scheduler.restart()
        return self.latest

    def attend(self, duration: float) -> None:
        """Stay awake: a robot that stands at rest, which nobody has attended for some time, sleeps, and its time stops.

        Args:
            duration: of that time, from now [s]; until the first call it never sleeps.
        """
        self._attended_until = self._clock() + duration
        if self._is_asleep:
            self._is_asleep = False
            self._scheduler.restart()

    def set_reference(self, command: ReferenceCommand) -> None:
        """Follow a reference from the next tick on."""
        self._commands.set_reference(command)
        if self._forked is not None:
            self._forked.follows = False  # somebody drives

    def push(self, push: Push) -> None:
        """Begin a push at the next tick; of several before it the last one counts."""
        self._commands.push(push)

    def pause(self) -> LiveState:
        """Stop time."""
        return self._show(running=False)

    def resume(self) -> LiveState:
        """Let time pass again, after a fault too."""
        if not self.latest.running:
            self._scheduler.restart()
        return self._show(running=True, fault="")

    def step(self, ticks: int) -> LiveState:
        """Take single ticks, as fast as they can be computed.

        Raises:
            NotPausedError: if the robot is running.
        """
        if self.latest.running:
            raise NotPausedError("the robot is running; pause it to take single ticks")
        for _ in range(ticks):
            self._take_tick()
        return self.latest

    def step_samples(self, samples: int) -> LiveState:
        """Take the ticks up to a coming sample of the gait's grid.

        Args:
            samples: 1 goes to the next sample, 2 to the one after it, and so on.

        Raises:
            NotPausedError: if the robot is running.
        """
        per_sample = self.parameters.timing.ticks_per_sample
        present = self.latest.snapshot.tick
        return self.step((present // per_sample + samples) * per_sample - present)

    def prepare(self, token: int, part: bytes) -> None:
        """Keep a part of the `BalanceSets` of a coming change, which would take the time of many ticks.

        Args:
            token: number of the change.
            part: the next piece of the pickled sets.
        """
        if token != self._prepared_for:
            self._prepared_for, self._prepared = token, []
        self._prepared.append(part)

    def change(self, values: Mapping[str, Any], token: int = 0, nb_parts: int = 0) -> Parameters:
        """Walk on with some parameters changed, and return all of them.

        Args:
            values: of parameters by name.
            token: of the parts that were prepared for it; 0 where none were.
            nb_parts: number of them; where one was lost, all is computed here.

        Raises:
            WalkError: if that cannot be; nothing has changed then.
        """
        parameters, prepared = self.parameters.changed(values), self._prepared
        if parameters == self.parameters:
            return parameters
        is_prepared = 0 < len(prepared) == nb_parts and token == self._prepared_for
        self._simulation.change(parameters, pickle.loads(b"".join(prepared)) if is_prepared else None)
        self._marks.change(self.latest.snapshot.tick + 1, self.parameters, parameters)
        self.parameters = self._simulation.parameters
        self._log.change(self.parameters)
        return self.parameters

    def reset(self) -> LiveState:
        """Put the robot back to rest at tick 0, with no reference and no push; time passes as before."""
        self._log.reset(self._simulation)
        self._simulation.reset()
        return self._begin()

    def choose_plant(self, choice: PlantChoice) -> Parameters:
        """Begin anew with a plant, or with the one that suits this machine, and return all parameters."""
        parameters, why = suitable_plant(self._robot, self.parameters, choice, self._clock)
        self._publish(self.latest)  # the measurement was silent
        return self._begin_with(parameters, self.latest.world, why)

    def begin(self, values: Mapping[str, Any], world: Mapping[str, Any]) -> Parameters:
        """Begin anew with some parameters changed, the plant among them, in another world; return all parameters.

        Args:
            values: of parameters by name.
            world: values of `World` by name; the ideal plant knows the perfect world only.

        Raises:
            WalkError: if that cannot be; nothing has changed then.
        """
        parameters = self.parameters.changed(values)
        self.parameters.check_change(replace(parameters, plant=self.parameters.plant))
        changed = self.latest.world.changed(world)
        if parameters.plant == "ideal":
            if world and changed != PERFECT:
                raise InvalidValueError("world", dict(world), "needs plant: mujoco; the ideal plant has no other world")
            changed = PERFECT
        why = self.latest.plant_reason
        if parameters.plant != self.parameters.plant:
            why = AS_CHOSEN[parameters.plant]
        return self._begin_with(parameters, changed, why)

    def _begin_with(self, parameters: Parameters, world: World, why: str) -> Parameters:
        is_same = (parameters, world) == (self.parameters, self.latest.world)
        simulation = None if is_same else Simulation(self._robot, parameters, self._stopwatch, world=world)
        self.latest = replace(self.latest, plant=parameters.plant, plant_reason=why, world=world)
        if simulation is None:
            self._publish(self.latest)
            return self.parameters
        simulation.keep_twin_ready()
        self._log.reset(simulation)
        self._simulation, self.parameters = simulation, parameters
        self._begin()
        return self.parameters

    def _begin(self) -> LiveState:
        """Take the first tick of a robot at rest."""
        self._commands.begin()
        self._recovery, self._twin = PushRecoveryMonitor(), TwinMonitor()
        self._marks, self._forked = Marks(), None
        self.latest = replace(self.latest, walk=self.latest.walk + 1, comparison=None, was=None)
        self._scheduler.real_t = 0.0
        self._take_tick()
        self._scheduler.restart()
        return self.latest

    def set_speed(self, speed: float) -> LiveState:
        """Let simulated time pass `speed` times as fast as real time."""
        self._scheduler.set_speed(speed)
        return self._show(speed=speed, timing=self._scheduler.timing)

    def preview(self, push: Push) -> Snapshot:
        """The next tick as it would be if a push came all at once; the robot does not feel it."""
        return self._simulation.preview(Command(self._commands.reference, replace(push, duration=0.0)))

    def push_at_random(self, pushes: RandomPushes | None) -> LiveState:
        """Let pushes come by themselves; None ends them."""
        self._commands.push_at_random(pushes)
        return self._show(random_pushes=pushes)

    def save(self, is_before_reset: bool) -> Iterator[bytes]:
        """Packed segments of the last minute since the last reset, or of the walk before it.

        Raises:
            NothingToSaveError: if there was none.
        """
        segments = self._log.segments(is_before_reset)
        if not segments:
            raise NothingToSaveError("there was no walk before the last reset")
        return iter(segments)

    def timeline(self) -> Timeline:
        """The ticks that are kept, and what happened at them."""
        first, last = self._log.first_tick, self.latest.snapshot.tick
        return Timeline(self.latest.walk, first, last, self.parameters.control_period, self._marks.since(first))

    def past(self, tick: int) -> bytes:
        """The packed segment that holds a tick of the present walk, or the nearest one of those that are kept.

        Raises:
            InvalidValueError: if none is.
        """
        segment = self._log.around(min(max(tick, self._log.first_tick), self.latest.snapshot.tick))
        if segment is None:
            raise InvalidValueError("tick", tick, "must be kept; nothing is yet")
        return segment.data

    def fork(self, fork: Fork, segments: Path | None = None) -> Parameters:
        """Go on from an earlier tick, and return all parameters; time passes as before.

        The walk that was counts as the walk before the last reset, for whoever wants to save it.

        Args:
            fork: the tick, and what is to be different.
            segments: file of another walk of this robot that holds the tick; None for the present walk.

        Raises:
            WalkError: if that cannot be; the present walk goes on then.
        """
        kept = self._log.kept() if segments is None else read_packed(segments)
        simulation = restored(self._robot, kept, fork.tick, self._stopwatch)
        if (period := simulation.parameters.control_period) != self.parameters.control_period:
            limit = f"must be {self.parameters.control_period:g} s, as that of the robot that walks"
            raise InvalidValueError("control_period", period, limit)
        base = self.parameters if fork.has_present_parameters else simulation.parameters
        parameters = base.changed(fork.parameters)
        simulation.change(parameters)
        simulation.keep_twin_ready()
        self._forked = ForkedWalk(fork, kept, self._robot, parameters)
        self._log.fork(simulation, kept, fork.tick)
        if segments is not None:
            why = "as in the recorded walk"
            self.latest = replace(self.latest, plant=parameters.plant, plant_reason=why, world=simulation.world)
            self._marks = Marks()
        self._marks.fork(fork.tick)
        self._simulation, self.parameters = simulation, parameters
        reference = Reference() if fork.reference is None else fork.reference
        self._commands.begin(ReferenceCommand(reference, "rest" if fork.reference else "none"), fork.push)
        self._recovery, self._twin = self._forked.monitor, TwinMonitor()
        self.latest = replace(self.latest, walk=self.latest.walk + 1)
        self._take_tick()
        self._scheduler.restart()
        return self.parameters

    def tidy(self) -> None:
        """Do the work that can wait for the pause between two ticks; takes about 1 ms."""
        self._log.pack()

    def fail(self, error: Exception) -> LiveState:
        """Pause because of an unexpected error, and show it."""
        logger.error("tick %d failed", self.latest.snapshot.tick + 1, exc_info=error)
        return self._show(running=False, fault=reason(error))

    def _take_tick(self, time_left: TimeLeft = unlimited) -> None:
        started = self._clock()
        command, driver = self._commands.next(started, self._forked)
        if self._forked is not None:
            time_left = self._forked.time_left(time_left)
        self._log.begin()
        counted = CountedTime(time_left)
        snapshot = self._simulation.step(command, counted)
        self._scheduler.record(self._clock() - started, self._stopwatch.laps)
        self._log.end(command, snapshot, counted.solves_in_time)
        self._recovery.update(balance_state(snapshot, self._robot.mass))
        self._twin.update(snapshot)
        self._marks.update(command, snapshot)
        if self._forked is not None:
            self._forked.update(snapshot)
        self._show(
            counts=_counted(self.latest.counts, self.latest.snapshot, snapshot),
            snapshot=snapshot,
            timing=self._scheduler.timing,
            driver=driver.driver,
            driver_client=driver.client,
            real_t=self._scheduler.real_t,
            last_push=self._recovery.last,
            next_state=self._simulation.state,
            twin_difference=self._twin.difference,
            comparison=None if self._forked is None else self._forked.comparison,
            was=None if self._forked is None else self._forked.was,
        )
        self._is_asleep = started > self._attended_until and self._repeats_itself(snapshot)

    def _repeats_itself(self, snapshot: Snapshot) -> bool:
        """Whether the coming ticks would be like this one."""
        return (
            snapshot.is_at_rest
            and not self._commands.pushes_at_random
            and self._forked is None
            and not self._simulation.state.pushes
        )

    def _show(self, **changed: Any) -> LiveState:
        self.latest = replace(self.latest, **changed)
        self._publish(self.latest)
        return self.latest


def _counted(counts: SolveCounts, before: Snapshot, now: Snapshot) -> SolveCounts:
    """The counts with one more tick in them."""
    if now.status is Status.RELAXED:
        return replace(counts, relaxed=counts.relaxed + 1)
    if now.status is Status.FALLEN and before.status is not Status.FALLEN:
        return replace(counts, failed=counts.failed + 1)
    return counts
