"""The last two minutes of the live walk, always kept: to look at them, to go on from any of their ticks, to save them.

They are kept in short segments: the state before each, and for each tick the command and the snapshot.
From these the same walk can be replayed, and its recording written without walking again. Full segments are packed
between two ticks. Of what is saved as a run, the last minute counts.
"""

import math
import pickle
import zlib
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from walkcore import Command, Parameters, Robot, Simulation, Snapshot
from walkcore.errors import InvalidValueError
from walkcore.motion.whole_body import WholeBody
from walkcore.mpc.plan import NO_BOUNDS, Plan
from walkcore.plant.world import World
from walkcore.scenario.recording import Recording, collect
from walkcore.scenario.scenario import scenario_from_mapping
from walkcore.scenario.session import session_scenario
from walkcore.state import SimulationState
from walkcore.values import frozen_copy

KEPT = 120.0  # [s] at least, of simulated time: 47 MB with the default robot in physics
SAVED = 60.0  # [s] of them, at least, that become a run
TICKS_PER_SEGMENT = 10  # so few that packing them takes 2 ms at most, and that they go by one message
COMPRESSION = 1  # the fastest of zlib, which halves a segment
NOTHING = frozen_copy(np.zeros((0, 2)))


@dataclass(frozen=True, slots=True, eq=False)
class LoggedTick:
    """One tick of a walk: what led to it, and what came of it."""

    command: Command
    snapshot: Snapshot
    """Without the trajectories of its plan."""
    parameters: Parameters
    """Parameters in force."""
    solves_in_time: int | None = None
    """Solves that it had time for; None if it had it for all of them."""


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """A short part of a walk: the state that it began with, and its ticks."""

    state: SimulationState
    world: World
    """World that the plant stands in."""
    ticks: list[LoggedTick] = field(default_factory=list)

    @property
    def first_tick(self) -> int:
        """Number of its first tick."""
        return self.state.model.tick

    @property
    def can_come_first(self) -> bool:
        """Whether its state leads to its ticks: it does not hold the last plan, with which one without time goes on."""
        return self.ticks[0].solves_in_time is None


@dataclass(frozen=True, slots=True, eq=False)
class PackedSegment:
    """A segment, pickled and compressed."""

    first_tick: int
    data: bytes

    @classmethod
    def of(cls, segment: Segment) -> "PackedSegment":
        """Pack a segment."""
        return cls(segment.first_tick, _compressed(_pickled(segment)))

    def unpacked(self) -> Segment:
        """The segment."""
        return pickle.loads(zlib.decompress(self.data))


def _pickled(segment: Segment) -> bytes:
    return pickle.dumps(segment, pickle.HIGHEST_PROTOCOL)


def _compressed(pickled: bytes) -> bytes:
    return zlib.compress(pickled, COMPRESSION)


class SessionLog:
    """Keeps the last two minutes of one walk."""

    def __init__(self, simulation: Simulation, kept: Sequence[PackedSegment] = (), tick: int = 0) -> None:
        """Begin to keep a simulation.

        Args:
            simulation: at its start, or before a tick of an earlier walk, maybe with other parameters.
            kept: segments of that walk, of which the ticks before that one are kept on.
            tick: one that they hold.
        """
        self._simulation = simulation
        nb_segments = _nb_segments(KEPT, simulation)
        earlier = [segment for segment in kept if segment.first_tick <= tick]
        self._packed: deque[PackedSegment] = deque(earlier[:-1], maxlen=nb_segments)
        self._half_packed: deque[tuple[Segment, bytes]] = deque()
        """Segments that are pickled only: to compress them, too, takes too long for one pause between two ticks."""
        self._full: deque[Segment] = deque(maxlen=nb_segments)
        self._growing: Segment | None = None
        if earlier and tick > earlier[-1].first_tick:
            last = earlier[-1].unpacked()
            self._growing = replace(last, ticks=last.ticks[: tick - last.first_tick])

    def begin(self) -> None:
        """Note the state before a tick where a segment begins with it."""
        if self._growing is not None and len(self._growing.ticks) < TICKS_PER_SEGMENT:
            return
        if self._growing is not None:
            self._full.append(self._growing)
        self._growing = Segment(self._simulation.state, self._simulation.world)

    def end(self, command: Command, snapshot: Snapshot, solves_in_time: int | None = None) -> None:
        """Add the tick that `begin` announced.

        Args:
            command: of the tick.
            snapshot: that came of it.
            solves_in_time: see `walkcore.stages.CountedTime`.
        """
        assert self._growing is not None
        tick = LoggedTick(command, _light(snapshot), self._simulation.parameters, solves_in_time)
        self._growing.ticks.append(tick)

    def pack(self) -> None:
        """Pack one full segment by a half."""
        if self._half_packed:
            segment, pickled = self._half_packed.popleft()
            self._packed.append(PackedSegment(segment.first_tick, _compressed(pickled)))
        elif self._full:
            segment = self._full.popleft()
            self._half_packed.append((segment, _pickled(segment)))

    @property
    def first_tick(self) -> int:
        """The first tick that is kept."""
        half_packed = (segment for segment, _ in self._half_packed)
        first = next(iter((*self._packed, *half_packed, *self._full)), self._growing)
        return self._simulation.state.model.tick if first is None else first.first_tick

    def kept(self) -> list[PackedSegment]:
        """All segments that are kept."""
        while self._full or self._half_packed:
            self.pack()
        growing = self._growing
        return [*self._packed, *([PackedSegment.of(growing)] if growing is not None and growing.ticks else [])]

    def around(self, tick: int) -> PackedSegment:
        """The segment of a tick, or of the nearest one that is kept.

        Raises:
            InvalidValueError: if none is.
        """
        growing = self._growing
        if growing is not None and growing.ticks and tick >= growing.first_tick:
            return PackedSegment.of(growing)
        if not (kept := self.kept()):
            raise InvalidValueError("tick", tick, "must be kept; nothing is yet")
        return next((segment for segment in reversed(kept) if segment.first_tick <= tick), kept[0])

    def last_minute(self) -> list[PackedSegment]:
        """The segments that become a run where the walk is saved."""
        nb_saved = _nb_segments(SAVED, self._simulation) + (self._growing is not None)
        return self.kept()[-nb_saved:]


def write_segments(segments: Iterable[PackedSegment], path: Path) -> None:
    """Write segments, one after the other as they come, for `read_segments` of another process of ours.

    Raises:
        OSError: if the disk does not take them.
    """
    with path.open("wb") as file:
        for segment in segments:
            pickle.dump(segment, file, pickle.HIGHEST_PROTOCOL)


def read_segments(path: Path) -> Iterator[PackedSegment]:
    """The segments in a file, read one after the other."""
    with path.open("rb") as file, suppress(EOFError):
        while True:
            yield pickle.load(file)


def _nb_segments(duration: float, simulation: Simulation) -> int:
    return math.ceil(duration / simulation.parameters.control_period / TICKS_PER_SEGMENT)


def _light(snapshot: Snapshot) -> Snapshot:
    """The snapshot without the trajectories of its plan and their bounds, which no recording has."""
    plan, twin = snapshot.plan, snapshot.twin
    return replace(
        snapshot,
        plan=None if plan is None else _light_plan(plan),
        twin=None if twin is None else _light(twin),
    )


def _light_plan(plan: Plan) -> Plan:
    return replace(plan, times=NOTHING, jerks=NOTHING, com=NOTHING, dcm=NOTHING, cop=NOTHING, bounds=NO_BOUNDS)


@dataclass(frozen=True, slots=True, eq=False)
class Session:
    """A walk that was driven live, from a state on."""

    segments: list[Segment]

    @classmethod
    def unpacked(cls, segments: Iterable[PackedSegment]) -> "Session":
        """The session of some segments, one after the other."""
        found = [segment.unpacked() for segment in segments]
        start = next((i for i, segment in enumerate(found) if segment.can_come_first), 0)
        return cls(found[start:])

    def recording(self, name: str, robot: Robot) -> Recording:
        """The recording of the walk as it happened: nothing is simulated again.

        Args:
            name: of its scenario, whose replay leads to the same rows.
            robot: that walked.
        """
        first, ticks = self.segments[0], [tick for segment in self.segments for tick in segment.ticks]
        changes = {
            i: now.parameters for i, (was, now) in enumerate(pairwise(ticks), 1) if now.parameters != was.parameters
        }
        solves = {i: tick.solves_in_time for i, tick in enumerate(ticks) if tick.solves_in_time is not None}
        commands = [tick.command for tick in ticks]
        mapping = session_scenario(
            name, robot, ticks[0].parameters, first.state, commands, changes, first.world, solves
        )
        body = None if robot.body is None else WholeBody(robot.body)
        return collect(scenario_from_mapping(mapping), (tick.snapshot for tick in ticks), body)
