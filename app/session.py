"""The last minute of the live walk, always kept, so that what was just driven can be saved as a run.

Kept in short segments: the state before each, and pickled tick by tick what was asked and what came of
it. That is all it takes to walk the same way again, and to write the recording without walking again.
"""

import math
import pickle
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from walkcore import Command, Parameters, Robot, Simulation, Snapshot
from walkcore.pattern_generator import Plan
from walkcore.recording import Recording, collect
from walkcore.scenario import scenario_from_mapping
from walkcore.session import session_scenario
from walkcore.state import SimulationState
from walkcore.values import read_only
from walkcore.whole_body import WholeBody

KEPT = 60.0  # [s] at least, of simulated time
TICKS_PER_SEGMENT = 40  # so few that a segment goes by one message
NOTHING = read_only(np.zeros((0, 2)))


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """What happened from a state on."""

    parameters: Parameters
    state: SimulationState
    ticks: list[bytes] = field(default_factory=list)
    """A pickled `Command` and the `Snapshot` that it led to, each."""
    changes: dict[int, Parameters] = field(default_factory=dict)
    """Parameters that came into force before a tick, by its index in this segment."""


class SessionLog:
    """Keeps what happens to a simulation."""

    def __init__(self, simulation: Simulation) -> None:
        """Of a simulation at its start."""
        self._simulation = simulation
        # One segment is not full yet.
        nb_segments = math.ceil(KEPT / simulation.parameters.control_period / TICKS_PER_SEGMENT) + 1
        self._segments: deque[Segment] = deque(maxlen=nb_segments)
        self._before_reset: list[Segment] = []

    def reset(self) -> None:
        """The simulation begins anew: what came before is set aside until the next reset."""
        self._before_reset = list(self._segments)
        self._segments.clear()

    def begin(self) -> None:
        """A tick is coming: a segment is needed for it."""
        if not self._segments or len(self._segments[-1].ticks) == TICKS_PER_SEGMENT:
            self._segments.append(Segment(self._simulation.parameters, self._simulation.state))

    def end(self, command: Command, snapshot: Snapshot) -> None:
        """The tick is over."""
        self._segments[-1].ticks.append(pickle.dumps((command, _light(snapshot)), pickle.HIGHEST_PROTOCOL))

    def change(self, parameters: Parameters) -> None:
        """Other parameters are in force from the next tick on."""
        last = self._segments[-1]
        if len(last.ticks) < TICKS_PER_SEGMENT:  # else the next segment begins with them
            last.changes[len(last.ticks)] = parameters

    def segments(self, is_before_reset: bool) -> list[Segment]:
        """What is kept, since the last reset or of the walk before it; they do not grow any more."""
        kept = self._before_reset if is_before_reset else self._segments
        return [replace(segment, ticks=list(segment.ticks), changes=dict(segment.changes)) for segment in kept]


def _light(snapshot: Snapshot) -> Snapshot:
    """Without the trajectories of its plan, which no recording has."""
    plan = snapshot.plan
    return replace(snapshot, plan=None if plan is None else _light_plan(plan))


def _light_plan(plan: Plan) -> Plan:
    return replace(plan, times=NOTHING, jerks=NOTHING, com=NOTHING, cop=NOTHING)


@dataclass(frozen=True, slots=True, eq=False)
class Session:
    """A walk that was driven live, from a state on."""

    segments: list[Segment]

    def recording(self, name: str, robot: Robot) -> Recording:
        """The recording, of what happened: nothing is simulated again.

        Args:
            name: of its scenario, which replayed leads to the same rows.
            robot: that walked.
        """
        ticks = [pickle.loads(tick) for segment in self.segments for tick in segment.ticks]
        first = self.segments[0]
        commands = [command for command, _ in ticks]
        mapping = session_scenario(name, robot.name, first.parameters, first.state, commands, dict(self._changes()))
        body = None if robot.body is None else WholeBody(robot.body)
        return collect(scenario_from_mapping(mapping), (snapshot for _, snapshot in ticks), body)

    def _changes(self) -> Iterator[tuple[int, Parameters]]:
        """What changed the parameters, by the index of the tick before which it did."""
        in_force, start = self.segments[0].parameters, 0
        for segment in self.segments:
            for index, parameters in {0: segment.parameters, **segment.changes}.items():
                if parameters != in_force:
                    yield start + index, parameters
                    in_force = parameters
            start += len(segment.ticks)
