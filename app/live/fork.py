"""Time that runs backwards: a walk goes on from an earlier tick, beside the walk that was.

The state before the tick is restored, not approximated: from the segment of the session log that holds it, the ticks up
to it are taken again as they were. Then the same commands lead to the same bytes, and others to another walk, whose
numbers stand beside those of the walk that was.
"""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from app.live.session_log import LoggedTick, PackedSegment, Segment
from walkcore import Command, Parameters, Push, Reference, Robot, Simulation, Snapshot
from walkcore.analysis.push_recovery import PushOutcome, PushRecoveryMonitor, balance_state
from walkcore.errors import EmptyRegionError, InvalidValueError
from walkcore.mpc.plan import Status
from walkcore.mpc.regions import HalfPlanes, half_planes
from walkcore.mpc.stance import Stance
from walkcore.stages import Stages, TimeLeft, time_of_solves
from walkcore.values import rotation

WARM_UP = 3.0  # [s] before a fork from which its recovery is judged: two steps, and a little


@dataclass(frozen=True, slots=True, eq=False)
class Fork:
    """Request to go on from an earlier tick, with what is to be different there."""

    tick: int
    """First tick that is taken again."""
    parameters: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Values of parameters by name, on top of those at that tick, or of the present ones."""
    has_present_parameters: bool = False
    """Whether the present parameters hold, and not those that were in force at that tick."""
    reference: Reference | None = None
    """Reference in place of those that were; None for those."""
    push: Push | None = None
    """Push at that tick; None for the one that was, if there was one."""
    follows: bool = True
    """Whether the commands come again that came then, until somebody drives; otherwise the robot is asked to stop."""

    @property
    def changes_commands(self) -> bool:
        """Whether other commands come than came then."""
        return not self.follows or self.reference is not None or self.push is not None


class EarlierWalk:
    """The ticks of a walk from one of its ticks on, read in their order."""

    def __init__(self, kept: Sequence[PackedSegment], tick: int) -> None:
        """Begin at a tick.

        Args:
            kept: segments, one after the other.
            tick: that one of them holds.
        """
        start = max((i for i, segment in enumerate(kept) if segment.first_tick <= tick), default=0)
        self._coming = deque(kept[start:])
        self._segment: Segment | None = None

    def at(self, tick: int) -> LoggedTick | None:
        """A tick, never an earlier one than before; None once the walk is over."""
        while self._coming and self._coming[0].first_tick <= tick:
            self._segment = self._coming.popleft().unpacked()
        segment = self._segment
        index = -1 if segment is None else tick - segment.first_tick
        return None if segment is None or not 0 <= index < len(segment.ticks) else segment.ticks[index]


def restored(robot: Robot, kept: Sequence[PackedSegment], tick: int, stages: Stages) -> Simulation:
    """A simulation before a tick of a walk, exactly as it was.

    Args:
        robot: that walked.
        kept: segments of the walk.
        tick: to be restored.
        stages: of the simulation.

    Raises:
        InvalidValueError: if the tick is not kept.
    """
    if not kept:
        raise InvalidValueError("tick", tick, "must be kept; nothing is yet")
    last = kept[-1].unpacked()
    end = last.first_tick + len(last.ticks)
    if not kept[0].first_tick <= tick < end:
        raise InvalidValueError("tick", tick, f"must be between {kept[0].first_tick} and {end - 1}")
    segments: deque[Segment] = deque()
    for packed in reversed([segment for segment in kept if segment.first_tick <= tick]):
        segments.appendleft(packed.unpacked())
        if segments[0].can_come_first:
            break
    first = segments[0]
    simulation = Simulation(robot, first.ticks[0].parameters, stages, world=first.world)
    simulation.restore(first.state)
    for segment in segments:
        for was in segment.ticks[: max(tick - segment.first_tick, 0)]:
            simulation.change(was.parameters)
            simulation.step(was.command, time_of_solves(was.solves_in_time))
    simulation.change(segments[-1].ticks[tick - segments[-1].first_tick].parameters)
    return simulation


@dataclass(frozen=True, slots=True)
class WalkNumbers:
    """Figures of a walk since a tick: its fall, recovery, CoP margin and velocity error."""

    fell_at: float | None
    """Time of the fall [s]; None while it is up."""
    recovery: PushOutcome | None
    """Outcome of the latest push since the tick; None where there was none."""
    cop_margin: float | None
    """Least distance of the model's CoP from the edge of the support polygon [m]; negative outside."""
    velocity_error: float
    """Distance of the mean velocity of the CoM from the mean reference, both in the heading's frame [m/s]."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """A forked walk beside the walk that was, from the tick of the fork on, as long as both go on."""

    tick: int
    """The fork's."""
    t: float
    """Its time [s]."""
    is_over: bool
    """Whether the walk that was has ended."""
    now: WalkNumbers
    was: WalkNumbers


class WalkMeasures:
    """Counts the numbers of a walk tick by tick."""

    def __init__(self, mass: float, monitor: PushRecoveryMonitor, since: float) -> None:
        """Begin.

        Args:
            mass: of the robot [kg].
            monitor: which knows the walk before.
            since: time of the first tick that counts [s].
        """
        self._mass, self._monitor, self._since = mass, monitor, since
        self._fell_at: float | None = None
        self._margin = math.inf
        self._error, self._nb_ticks = np.zeros(2), 0
        self._stance: Stance | None = None
        self._ground: HalfPlanes | None = None

    def update(self, now: Snapshot) -> None:
        """Take in the next tick."""
        self._monitor.update(balance_state(now, self._mass))
        if now.status is Status.FALLEN:
            self._fell_at = now.t if self._fell_at is None else self._fell_at
            return
        reference = np.array([now.reference.vx, now.reference.vy])
        self._error += now.com.velocity @ rotation(now.heading) - reference
        self._nb_ticks += 1
        if self._stance is None or not np.array_equal(self._stance.polygon, now.stance.polygon):
            self._stance, self._ground = now.stance, _ground(now.stance)
        if self._ground is not None:
            self._margin = min(self._margin, -self._ground.excess(now.cop))

    @property
    def numbers(self) -> WalkNumbers:
        """The numbers so far."""
        push = self._monitor.last
        return WalkNumbers(
            fell_at=self._fell_at,
            recovery=None if push is None or push.t < self._since else push,
            cop_margin=self._margin if math.isfinite(self._margin) else None,
            velocity_error=math.hypot(*self._error.tolist()) / max(self._nb_ticks, 1),
        )


def _ground(stance: Stance) -> HalfPlanes | None:
    try:
        return half_planes(stance.polygon)
    except EmptyRegionError:
        return None


class ForkedWalk:
    """Gives a forked walk the commands that came then, and compares it with the walk that was."""

    def __init__(self, fork: Fork, kept: Sequence[PackedSegment], robot: Robot, parameters: Parameters) -> None:
        """Begin before the first tick.

        Args:
            fork: whose tick is kept.
            kept: segments of the walk that was.
            robot: that walks.
            parameters: in force from the fork on.
        """
        self._fork, self._past, self._parameters = fork, EarlierWalk(kept, fork.tick), parameters
        self.follows = fork.follows
        self.was: Snapshot | None = None
        """The walk that was, at the tick of the latest update; None once it is over."""
        period = parameters.control_period
        monitor = _warm_monitor(kept, fork.tick, round(WARM_UP / period), robot.mass)
        since = fork.tick * period
        self.monitor = monitor
        """Judges the pushes of the forked walk, and knows the walk before."""
        self._was = WalkMeasures(robot.mass, deepcopy(monitor), since)
        self._now = WalkMeasures(robot.mass, deepcopy(monitor), since)
        self._since, self._tick = since, fork.tick
        self._next: LoggedTick | None = None

    def begin(self) -> None:
        """Look at the next tick of the walk that was."""
        self._next = self._past.at(self._tick)
        self._tick += 1
        self.follows &= self._next is not None

    def command(self, push: Push | None) -> Command:
        """The command of a tick that follows the walk that was.

        Args:
            push: that comes now; None for the one that came then.
        """
        assert self._next is not None
        was, reference = self._next.command, self._fork.reference
        return Command(was.reference if reference is None else reference, was.push if push is None else push)

    def time_left(self, time_left: TimeLeft) -> TimeLeft:
        """Time for the decision of the tick: what it was, where the tick is to be the same."""
        past = self._next
        if past is None or not self.follows or self._fork.changes_commands or past.parameters != self._parameters:
            return time_left
        return time_of_solves(past.solves_in_time)

    def update(self, snapshot: Snapshot) -> None:
        """Take in the tick that was taken."""
        self.was = None if self._next is None else self._next.snapshot
        if self.was is not None:
            self._was.update(self.was)
            self._now.update(snapshot)

    @property
    def comparison(self) -> Comparison:
        """Both walks since the fork, as long as both went on."""
        return Comparison(self._fork.tick, self._since, self.was is None, self._now.numbers, self._was.numbers)


def _warm_monitor(kept: Sequence[PackedSegment], tick: int, nb_ticks: int, mass: float) -> PushRecoveryMonitor:
    """A monitor that has seen the ticks before a fork."""
    monitor = PushRecoveryMonitor()
    before = [segment for segment in kept if segment.first_tick < tick]
    first = max((i for i, segment in enumerate(before) if segment.first_tick <= tick - nb_ticks), default=0)
    for packed in before[first:]:
        for was in packed.unpacked().ticks:
            if was.snapshot.tick < tick:
                monitor.update(balance_state(was.snapshot, mass))
    return monitor
