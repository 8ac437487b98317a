"""The control loop's work: ticks the simulation and grants what is wished of it between two ticks.

Knows neither processes nor waiting, so that all of it can be tested tick by tick: `app.live.process`
calls `tick` when one is due.
"""

import logging
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from app.live.pace import Pace
from app.live.random_pushes import RandomPusher
from app.live.session import SessionLog
from app.live.state import Counts, LiveState, RandomPushes
from walkcore import Command, Parameters, Push, Reference, Robot, Simulation, Snapshot
from walkcore.analysis.push_recovery import PushRecoveryMonitor, balance_state
from walkcore.mpc.plan import Status
from walkcore.stages import Stopwatch

logger = logging.getLogger(__name__)


class NotPausedError(Exception):
    """Single ticks were asked of a robot that is running."""


class NothingToSaveError(Exception):
    """There was no walk before the last reset."""


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A reference, whose it is, and how long it holds."""

    reference: Reference
    driver: str
    expires_after: float = math.inf
    """[s]."""
    client: str = ""
    """The browser whose it is."""


NOBODY = Drive(Reference(), "none")


class Control:
    """One robot that walks as it is told. Belongs to one thread."""

    def __init__(
        self,
        robot: Robot,
        parameters: Parameters,
        publish: Callable[[LiveState], None],
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        """Put the robot at rest and take the first tick, so that there is a state to show.

        Args:
            robot: to walk.
            parameters: to begin with.
            publish: called with the state after each tick, and after each wish that changes it.
            clock: [s].

        Raises:
            WalkError: if the robot cannot stand with these parameters.
        """
        self.parameters = parameters
        self._publish, self._clock = publish, clock
        self._stopwatch = Stopwatch(clock)
        self._simulation = Simulation(robot, parameters, self._stopwatch)
        self._pace = Pace(parameters.control_period, clock)
        self._is_started = False
        self._drive, self._driven_at = NOBODY, 0.0
        self._push: Push | None = None
        self._pusher: RandomPusher | None = None
        self._robot, self._follower = robot, PushRecoveryMonitor()
        self._log = SessionLog(self._simulation)
        self._log.begin()
        first = self._simulation.step()
        self._log.end(Command(), first)
        self.latest = LiveState(first, self._pace.timing, True, NOBODY.driver)
        publish(self.latest)

    @property
    def time_left(self) -> float:
        """Until the next tick is due [s]; infinite while none is."""
        return self._pace.time_left if self._is_started and self.latest.running else math.inf

    def tick(self) -> None:
        """Take the tick that is due; an error that nobody foresaw pauses the robot."""
        self._pace.begin()
        try:
            self._take_tick()
        except Exception as error:
            self.fail(error)

    def start(self) -> LiveState:
        """Let time pass for the first time."""
        self._is_started = True
        self._pace.restart()
        return self.latest

    def drive(self, drive: Drive) -> None:
        """Take a reference from the next tick on."""
        self._drive, self._driven_at = drive, self._clock()

    def push(self, push: Push) -> None:
        """Begin a push at the next tick; of several the last one counts."""
        self._push = push

    def pause(self) -> LiveState:
        """Stop time."""
        return self._show(running=False)

    def resume(self) -> LiveState:
        """Let time pass again, after a fault too."""
        if not self.latest.running:
            self._pace.restart()
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
        """Take the ticks up to the next sample of the gait's grid, or to the one so many samples on; as `step`."""
        per_sample = self.parameters.timing.ticks_per_sample
        present = self.latest.snapshot.tick
        return self.step((present // per_sample + samples) * per_sample - present)

    def change(self, values: Mapping[str, Any]) -> Parameters:
        """Walk on with some parameters changed; tells all of them.

        Raises:
            WalkError: if that cannot be; nothing has changed then.
        """
        self._simulation.change(self.parameters.changed(values))
        self.parameters = self._simulation.parameters
        self._log.change(self.parameters)
        return self.parameters

    def reset(self) -> LiveState:
        """Put the robot back to rest at tick 0, with no reference and no push; time passes as before."""
        self._drive, self._push = NOBODY, None
        self._follower = PushRecoveryMonitor()
        self._log.reset()
        self._simulation.reset()
        self._pace.forget_real_t()
        self._take_tick()
        self._pace.restart()
        return self.latest

    def set_speed(self, speed: float) -> LiveState:
        """Let simulated time pass so many times as fast as real time."""
        self._pace.set_speed(speed)
        return self._show(speed=speed, timing=self._pace.timing)

    def preview(self, push: Push) -> Snapshot:
        """What the next tick would be if this push came all at once; the robot does not feel it."""
        return self._simulation.preview(Command(self._drive.reference, replace(push, duration=0.0)))

    def push_at_random(self, pushes: RandomPushes | None) -> LiveState:
        """Let pushes come by themselves, or no more."""
        self._pusher = None if pushes is None else RandomPusher(pushes, self.parameters.control_period)
        return self._show(random_pushes=pushes)

    def save(self, is_before_reset: bool) -> Iterator[bytes]:
        """The last minute since the last reset, or of the walk before it, piece by piece.

        Raises:
            NothingToSaveError: if there was none.
        """
        segments = self._log.segments(is_before_reset)
        if not segments:
            raise NothingToSaveError("there was no walk before the last reset")
        return iter(segments)

    def tidy(self) -> None:
        """What there is to do between two ticks; takes less than 1 ms."""
        self._log.pack()

    def fail(self, error: Exception) -> LiveState:
        """An error that nobody foresaw: pause, and tell."""
        logger.error("tick %d failed", self.latest.snapshot.tick + 1, exc_info=error)
        return self._show(running=False, fault=f"{type(error).__name__}: {error}")

    def _take_tick(self) -> None:
        started = self._clock()
        if started > self._driven_at + self._drive.expires_after:
            self._drive = NOBODY
        command = Command(self._drive.reference, self._next_push())
        self._log.begin()
        snapshot = self._simulation.step(command)
        self._pace.record(self._clock() - started, self._stopwatch.laps)
        self._log.end(command, snapshot)
        self._follower.update(balance_state(snapshot, self._robot.mass))
        self._show(
            counts=_counted(self.latest.counts, self.latest.snapshot, snapshot),
            snapshot=snapshot,
            timing=self._pace.timing,
            driver=self._drive.driver,
            driver_client=self._drive.client,
            real_t=self._pace.real_t,
            last_push=self._follower.last,
        )

    def _next_push(self) -> Push | None:
        """The push that was asked for, else a random one where one is due."""
        push, self._push = self._push, None
        if push is None and self._pusher is not None:
            push = self._pusher.at_next_tick()
        return push

    def _show(self, **changed: Any) -> LiveState:
        self.latest = replace(self.latest, **changed)
        self._publish(self.latest)
        return self.latest


def _counted(counts: Counts, before: Snapshot, now: Snapshot) -> Counts:
    """The counts with one more tick in them."""
    if now.status is Status.RELAXED:
        return replace(counts, relaxed=counts.relaxed + 1)
    if now.status is Status.FALLEN and before.status is not Status.FALLEN:
        return replace(counts, failed=counts.failed + 1)
    return counts
