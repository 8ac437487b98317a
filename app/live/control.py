"""The control loop's work: ticks the simulation, and carries out the server's requests between two ticks.

There are neither processes nor waiting in it, so that all of it can be tested tick by tick: `app.live.process` calls
`tick` when one is due.
"""

import logging
import math
import pickle
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.live.command_source import CommandSource
from app.live.fork import Fork
from app.live.live_state import NO_REFERENCE, LiveState, RandomPushes, ReferenceCommand
from app.live.live_walk import LiveWalk
from app.live.messages import reason
from app.live.plant_choice import AS_CHOSEN, PlantChoice, suitable_plant, with_plant_and_world
from app.live.session_log import PackedSegment
from app.live.tick_scheduler import TickScheduler
from app.live.timeline import Timeline
from walkcore import Command, Parameters, Push, Robot, Simulation, Snapshot
from walkcore.plant.world import PERFECT, World
from walkcore.stages import Stopwatch, TimeLeft, unlimited

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
        self._publish, self._clock = publish, clock
        self._stopwatch = Stopwatch(clock)
        self._scheduler = TickScheduler(parameters.control_period, clock)
        self._commands = CommandSource(parameters.control_period)
        self._is_started = self._is_asleep = False
        self._attended_until = math.inf
        self._walk_before: list[PackedSegment] = []
        """Last minute of the walk before the present one began."""
        world = PERFECT if resumed is None else resumed.world
        simulation = Simulation(robot, parameters, self._stopwatch, world=world)
        self.latest = self._first_state(simulation, resumed)
        publish(self.latest)

    def _first_state(self, simulation: Simulation, resumed: LiveState | None) -> LiveState:
        """Begin the first walk of this process, at rest or where another one left it."""
        timing, driver = self._scheduler.timing, NO_REFERENCE.driver
        if resumed is None:
            walk = self._walk = LiveWalk(simulation)
            state = LiveState(walk.step(Command()), timing, running=True, driver=driver, robot=simulation.robot.name)
            return walk.told_in(state)
        walk = self._walk = LiveWalk(simulation, resumed.walk + 1, resumed.plant_reason)
        self._commands.push_at_random(resumed.random_pushes)
        self._scheduler.set_speed(resumed.speed)
        state = replace(resumed, timing=timing, driver=driver, driver_client=NO_REFERENCE.client)
        if not walk.restore(resumed.next_state):
            state = replace(state, snapshot=walk.step(Command()), fault="", real_t=0.0)
        self._scheduler.real_t = state.real_t
        return walk.told_in(state)

    @property
    def parameters(self) -> Parameters:
        """The parameters in force."""
        return self._walk.parameters

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
            logger.error("tick %d failed", self.latest.snapshot.tick + 1, exc_info=error)
            self._show(running=False, fault=reason(error))

    def start(self) -> None:
        """Let time pass for the first time."""
        self._is_started = True
        self._scheduler.restart()

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
        if self._walk.forked is not None:
            self._walk.forked.follows = False  # somebody drives

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

    def change(self, values: Mapping[str, Any], sets: bytes = b"") -> Parameters:
        """Walk on with some parameters changed, and return all of them.

        Args:
            values: of parameters by name.
            sets: their `packed_sets`, which take the time of many ticks; empty to compute them here.

        Raises:
            WalkError: if that cannot be; nothing has changed then.
        """
        self._walk.change(values, pickle.loads(zlib.decompress(sets)) if sets else None)
        return self.parameters

    def reset(self) -> LiveState:
        """Put the robot back to rest at tick 0, with no reference and no push; time passes as before."""
        self._walk.simulation.reset()
        return self._begin_at_rest(self._walk.simulation, self._walk.plant_reason)

    def choose_plant(self, choice: PlantChoice) -> Parameters:
        """Begin anew with a plant, or with the one that suits this machine, and return all parameters."""
        parameters, why = suitable_plant(self._walk.simulation.robot, self.parameters, choice, self._clock)
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
        parameters, changed = with_plant_and_world(self.parameters, self.latest.world, values, world)
        is_same = parameters.plant == self.parameters.plant
        why = self._walk.plant_reason if is_same else AS_CHOSEN[parameters.plant]
        return self._begin_with(parameters, changed, why)

    def _begin_with(self, parameters: Parameters, world: World, why: str) -> Parameters:
        if (parameters, world) == (self.parameters, self.latest.world):
            self._walk.plant_reason = why
            self._show(plant_reason=why)
        else:
            robot = self._walk.simulation.robot
            self._begin_at_rest(Simulation(robot, parameters, self._stopwatch, world=world), why)
        return self.parameters

    def _begin_at_rest(self, simulation: Simulation, why: str) -> LiveState:
        self._scheduler.real_t = 0.0
        return self._begin(LiveWalk(simulation, self._walk.number + 1, why))

    def _begin(self, walk: LiveWalk, command: ReferenceCommand = NO_REFERENCE, push: Push | None = None) -> LiveState:
        """Take the first tick of another walk, with a reference and a push; the walk that was can still be saved."""
        self._walk_before, self._walk = self._walk.log.last_minute(), walk
        self._commands.begin(command, push)
        self._take_tick()
        self._scheduler.restart()
        return self.latest

    def set_speed(self, speed: float) -> LiveState:
        """Let simulated time pass `speed` times as fast as real time."""
        self._scheduler.set_speed(speed)
        return self._show(speed=speed, timing=self._scheduler.timing)

    def preview(self, push: Push) -> Snapshot:
        """The next tick as it would be if a push came all at once; the robot does not feel it."""
        return self._walk.simulation.preview(Command(self._commands.reference, replace(push, duration=0.0)))

    def push_at_random(self, pushes: RandomPushes | None) -> LiveState:
        """Let pushes come by themselves; None ends them."""
        self._commands.push_at_random(pushes)
        return self._show(random_pushes=pushes)

    def save(self, is_before_reset: bool) -> Iterator[PackedSegment]:
        """The last minute since the last reset, or of the walk before it, segment by segment.

        Raises:
            NothingToSaveError: if there was none.
        """
        segments = self._walk_before if is_before_reset else self._walk.log.last_minute()
        if not segments:
            raise NothingToSaveError("there was no walk before the last reset")
        return iter(segments)

    def timeline(self) -> Timeline:
        """The ticks of the present walk that are kept, and what happened at them."""
        return self._walk.timeline()

    def past(self, tick: int) -> PackedSegment:
        """The segment that holds a tick of the present walk, or the nearest one of those that are kept.

        Raises:
            InvalidValueError: if none is.
        """
        return self._walk.log.around(tick)

    def fork(self, fork: Fork, segments: Path | None = None) -> Parameters:
        """Go on from an earlier tick, and return all parameters; time passes as before.

        The walk that was counts as the walk before the last reset, for whoever wants to save it.

        Args:
            fork: the tick, and what is to be different.
            segments: file of another walk of this robot that holds the tick; None for the present walk.

        Raises:
            WalkError: if that cannot be; the present walk goes on then.
        """
        command = NO_REFERENCE if fork.reference is None else ReferenceCommand(fork.reference, "rest")
        self._begin(self._walk.fork(fork, segments, self._stopwatch), command, fork.push)
        return self.parameters

    def tidy(self) -> None:
        """Do the work that can wait for the pause between two ticks; takes about 1 ms."""
        self._walk.log.pack()

    def _take_tick(self, time_left: TimeLeft = unlimited) -> None:
        started = self._clock()
        command, driver = self._commands.next(started, self._walk.forked)
        snapshot = self._walk.step(command, time_left)
        self._scheduler.record(self._clock() - started, self._stopwatch.laps)
        self.latest = self._walk.told_in(self.latest)
        self._show(
            counts=self.latest.counts.with_tick(self.latest.snapshot, snapshot),
            snapshot=snapshot,
            timing=self._scheduler.timing,
            driver=driver.driver,
            driver_client=driver.client,
            real_t=self._scheduler.real_t,
        )
        may_sleep = started > self._attended_until and not self._commands.pushes_at_random
        self._is_asleep = may_sleep and self._walk.repeats_itself(snapshot)

    def _show(self, **changed: Any) -> LiveState:
        self.latest = replace(self.latest, **changed)
        self._publish(self.latest)
        return self.latest
