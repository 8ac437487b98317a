"""Jobs of the processes: simulate a scenario, write a session, write a recording in another format."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.formats import FORMATS, read_run, write_run
from app.jobs import Report
from app.live.session_log import Session, read_segments
from app.runs.run import RunProgress
from walkcore import Robot
from walkcore.analysis.twin import twin_difference
from walkcore.scenario.expectations import Verdict
from walkcore.scenario.recording import record
from walkcore.scenario.scenario import scenario_from_mapping


@dataclass(frozen=True, slots=True)
class SimulationResult:
    """The outcome of a simulated scenario, whose run is written."""

    robot: str
    nb_ticks: int
    real_time_factor: float
    """Simulated over real time, without the time that writing the files took."""
    reason: str
    """Why the robot fell, if it did."""
    verdicts: tuple[Verdict, ...]
    twin_difference: str = ""
    """The difference between the robot and the ideal one beside it, where there was one."""


@dataclass(frozen=True, slots=True, eq=False)
class Simulate:
    """Job that simulates a scenario and writes its run."""

    scenario: Mapping[str, Any]
    """The scenario's mapping, as `walkcore.scenario_from_mapping` takes it."""
    folder: Path
    """Folder for run.json and the recording."""
    formats: tuple[str, ...] = ("npz", "csv")

    def __call__(self, report: Report) -> SimulationResult:
        """Simulate, reporting `RunProgress`.

        Raises:
            WalkError: if the scenario cannot be walked.
        """
        scenario = scenario_from_mapping(self.scenario)
        started = time.perf_counter()

        def progress(fraction: float) -> RunProgress:
            return RunProgress(fraction, fraction * scenario.duration / (time.perf_counter() - started))

        recording = record(scenario, lambda fraction: report(progress(fraction)))
        factor = scenario.duration / (time.perf_counter() - started)
        write_run(recording, self.folder, self.formats)
        difference = twin_difference(recording) if scenario.parameters.twin else ""
        return SimulationResult(
            scenario.robot.name,
            scenario.nb_ticks,
            factor,
            recording.reason,
            tuple(recording.verdicts()),
            difference,
        )


@dataclass(frozen=True, slots=True, eq=False)
class WrittenRun:
    """Outcome of a job that wrote the files of a run into its folder, without simulating it."""

    scenario: Mapping[str, Any]
    """The mapping of the scenario that leads to the walk."""
    robot: str
    duration: float
    """[s]."""


@dataclass(frozen=True, slots=True, eq=False)
class WriteSession:
    """Job that writes the files of a session's run."""

    segments: Path
    """File of the session as `write_segments` wrote it; it is removed."""
    name: str
    """Name of the scenario that leads to the same walk."""
    robot: Robot
    """Robot that walked."""
    folder: Path
    """Folder for run.json and the recording."""

    def __call__(self, _: Report) -> WrittenRun:
        """Write."""
        session = Session.unpacked(read_segments(self.segments))
        self.segments.unlink()
        recording = session.recording(self.name, self.robot)
        recording.write(self.folder)
        scenario = recording.scenario
        return WrittenRun(dict(scenario.source), self.robot.name, scenario.duration)


def convert(folder: Path, ending: str, _: Report) -> None:
    """Job that writes the recording of a run in one more format, beside the others and in one piece.

    Args:
        folder: of the run.
        ending: of the format.
    """
    form = FORMATS[ending]
    run, half = read_run(folder), folder / f"half.{form.file}"
    try:
        form.write(run.recording(), run.run_json, half)
        half.rename(folder / form.file)
    finally:
        half.unlink(missing_ok=True)  # of no use, and the disk may be full
