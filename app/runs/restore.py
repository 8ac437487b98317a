"""Ticks of a recorded run, restored so that the live robot can go on from them.

A recording has poses, and no states. But its run.json has what led to them: the state in which the walk began, each
command, and the decisions that had no time. Walked again, that leads to the same state before every tick. Whether it
does is compared row by row, bit by bit: what another machine or another version decided otherwise is refused.
"""

import math
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from app.formats import as_written, read_run
from app.jobs import ProcessDiedError, Report
from app.live.session_log import PackedSegment, SessionLog, write_segments
from app.runs.upload import HAS_SCENARIO, WITHOUT_SCENARIO, limit_this_process
from app.work.awaited_jobs import AwaitedJobs
from app.work.work import WorkUnavailableError
from walkcore import Simulation, Snapshot
from walkcore.errors import InvalidValueError
from walkcore.scenario.recording import joint_columns, plant_columns, row
from walkcore.scenario.scenario import Scenario
from walkcore.stages import CountedTime, time_of_solves
from walkcore.values import Matrix

BEFORE, AFTER = 30.0, 20.0  # [s] of the recorded walk around the tick that go to the robot: its past, and the ghost's
PROCESSOR_TIME = 300  # [s]: a minute of Talos takes 12 s, in contact physics a minute


@dataclass(frozen=True, slots=True, eq=False)
class Restore:
    """Job that walks a run again up to a tick, and a little further, and writes its last segments."""

    folder: Path
    """Folder of the run."""
    tick: int
    """Tick that is to be gone on from."""
    segments: Path
    """File for the segments."""

    def __call__(self, _: Report) -> None:
        """Walk, compare and write.

        Raises:
            InvalidValueError: if there is no such tick, or it cannot be restored exactly.
        """
        limit_this_process(PROCESSOR_TIME)
        with as_written(self.folder):
            recording = read_run(self.folder).recording()
        first, last = int(recording["tick"][0]), int(recording["tick"][-1])
        if not first <= self.tick <= last:
            raise InvalidValueError("tick", self.tick, f"must be between {first} and {last}")
        scenario, period = recording.scenario, recording.scenario.parameters.control_period
        simulation = Simulation(scenario.robot, scenario.parameters, world=scenario.world)
        if scenario.initial_state is not None:
            simulation.restore(scenario.initial_state)
        log = SessionLog(simulation)
        nb_ticks = self.tick - first + 1 + math.ceil(AFTER / period)
        for k, snapshot in enumerate(islice(_walked(scenario, simulation, log), nb_ticks)):
            if k <= self.tick - first:
                _compare(snapshot, recording.columns, recording.rows[k])
        earliest = self.tick - math.ceil(BEFORE / period)
        write_segments(_since(log.kept(), earliest), self.segments)


def _walked(scenario: Scenario, simulation: Simulation, log: SessionLog) -> Iterator[Snapshot]:
    """The snapshots of a scenario, which a log takes in."""
    changes, solves = dict(scenario.parameter_changes()), scenario.solves_in_time()
    for k, command in enumerate(scenario.commands()):
        if k in changes:
            simulation.change(changes[k])
        log.begin()
        counted = CountedTime(time_of_solves(solves.get(k)))
        snapshot = simulation.step(command, counted)
        log.end(command, snapshot, counted.solves_in_time)
        yield snapshot


def _compare(snapshot: Snapshot, columns: tuple[str, ...], recorded: Matrix) -> None:
    """Refuse a tick that is not the recorded one, to the last bit."""
    values = row(snapshot) | plant_columns(snapshot) | joint_columns("q", snapshot.q)
    if snapshot.plant is not None:
        values |= joint_columns("q_commanded", snapshot.plant.q_commanded)
    differing = _first_difference(values, columns, recorded)
    if differing is not None:
        name, was = differing
        limit = (
            f"is {values[name]!r} when it is walked again here, at tick {snapshot.tick}: there is no exact state to go "
            "on from (another version or machine, or changed since)"
        )
        raise InvalidValueError(name, was, limit)


def _first_difference(
    values: Mapping[str, float], columns: tuple[str, ...], recorded: Matrix
) -> tuple[str, float] | None:
    names = [name for name in columns if name in values]
    was = recorded[[columns.index(name) for name in names]]
    now = np.array([values[name] for name in names])
    differs = np.flatnonzero(~((was == now) | (np.isnan(was) & np.isnan(now))))
    return None if not len(differs) else (names[differs[0]], float(was[differs[0]]))


def _since(kept: list[PackedSegment], tick: int) -> list[PackedSegment]:
    """The segments from the one that holds a tick on; all of them where that is earlier."""
    start = max((i for i, segment in enumerate(kept) if segment.first_tick <= tick), default=0)
    return kept[start:]


@contextmanager
def restored(jobs: AwaitedJobs, folder: Path, tick: int) -> Iterator[Path]:
    """File of segments, for `app.live.session_log.read_segments`, that hold a tick of a run.

    Args:
        jobs: has a place for one such job.
        folder: of the run.
        tick: of its recording.

    Raises:
        InvalidValueError: if it cannot be restored exactly.
        WorkUnavailableError: if another tick is being restored, the server stops, or there is no room for it.
    """
    with jobs.place(), _segment_folder() as segment_folder:
        segments = Path(segment_folder) / "segments"
        try:
            jobs.run(Restore(folder, tick, segments))
        except ProcessDiedError as error:
            limit = f"must be restored within {PROCESSOR_TIME} s of processor time ({error})"
            raise InvalidValueError("tick", tick, limit) from error
        except OSError as error:
            raise WorkUnavailableError(f"the tick cannot be restored: {error}") from error
        yield segments


def _segment_folder() -> "tempfile.TemporaryDirectory[str]":
    try:
        return tempfile.TemporaryDirectory(prefix="walk-restored-")
    except OSError as error:
        raise WorkUnavailableError(f"the tick cannot be restored: {error}") from error


def why_not(run: Mapping[str, object]) -> str:
    """Why no tick of a run can be gone on from; empty where one may be.

    Args:
        run: content of its run.json.
    """
    return WITHOUT_SCENARIO if run.get(HAS_SCENARIO) is False else ""
