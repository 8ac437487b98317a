"""Recordings that are uploaded become runs: read, checked and written anew by a process with limits of its own."""

import json
import math
import resource
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from app.jobs import Report
from app.robot_choices import RobotChoices
from app.runs.run_jobs import WrittenRun
from walkcore import Robot
from walkcore.errors import InvalidValueError, WalkError
from walkcore.plain_yaml import check_size
from walkcore.scenario.recording import Recording, parameters_in_force
from walkcore.scenario.scenario import Scenario, scenario_from_mapping
from walkcore.values import Vector, check_mapping

MEMORY = 3 << 30  # bytes of addresses, beside those that the process has at the start
PROCESSOR_TIME = 60  # [s]
PACKING = 8  # most bytes of the unpacked content for each that was uploaded may be
MAX_VALUES = 150_000  # of run.json: a minute that was driven by a stick has 70,000
MAX_CHANGES = 1000  # of parameters: a live walk takes five a second
WITHOUT_SCENARIO = "uploaded without run.json: it tells where the robot was, and not what it was commanded"
HAS_SCENARIO = "has_scenario"
"""Key of run.json: false of an uploaded recording whose scenario is not known."""


@dataclass(frozen=True, slots=True)
class UploadLimits:
    """Limits of one uploaded file."""

    bytes: int = 100_000_000
    ticks: int = 120_000


@dataclass(frozen=True, slots=True, eq=False)
class TakeUpload:
    """Job that makes a run of an uploaded file."""

    file: Path
    """The file, in the folder of the run; it is removed."""
    name: str
    """Name of the run; empty for that of its scenario."""
    robot: str
    """Robot that walked, where no run.json tells."""
    choices: RobotChoices
    limits: UploadLimits

    def __call__(self, _: Report) -> WrittenRun:
        """Read, check and write.

        Raises:
            InvalidValueError: naming what is wrong with the file.
        """
        limit_this_process(PROCESSOR_TIME)
        # Imported here: it loads the readers of all formats, which the server does without.
        from app.formats.foreign_file import read_foreign

        try:
            found = read_foreign(self.file, self.limits.ticks, PACKING * self.limits.bytes)
            self.file.unlink()
            recording, run = self._recording(found.columns, found.run_json)
        except MemoryError as error:
            raise InvalidValueError("file", "too large", f"must be read within {MEMORY >> 30} GiB of memory") from error
        recording.write_npz(self.file.parent / "recording.npz")
        text = json.dumps(run, indent=2, default=float, allow_nan=False) + "\n"
        (self.file.parent / "run.json").write_text(text, encoding="utf-8")
        return WrittenRun(run["scenario"], recording.scenario.robot.name, recording.scenario.duration)

    def _recording(self, columns: Mapping[str, Vector], run_json: str | None) -> tuple[Recording, dict[str, Any]]:
        # Imported here, as it loads the kinematics of bodies.
        from app.runs.upload_check import checked_columns, control_period

        if run_json is None:
            robot = self.choices.load(self.robot)
            kept = checked_columns(columns, robot)
            scenario = _unknown_scenario(robot, kept, control_period(kept), self.name)
            recording = _recording_of(scenario, kept, parameters_in_force(robot, scenario.parameters), ())
            return recording, recording.run() | {HAS_SCENARIO: False}
        run = _run(run_json)
        scenario = _scenario(run, self.choices, self.name)
        kept = checked_columns(columns, scenario.robot)
        control_period(kept, scenario.parameters.control_period)
        if len(kept["tick"]) > scenario.nb_ticks:
            raise InvalidValueError(
                "rows", len(kept["tick"]), f"must be at most {scenario.nb_ticks}, as run.json tells"
            )
        changes = tuple(run["parameter_changes"])
        recording = _recording_of(scenario, kept, run["parameters"], changes)
        told = {key: run[key] for key in ("parameters", "parameter_changes", "versions", "metrics")}
        return recording, {"scenario": scenario.source, **told, "expectations": [], HAS_SCENARIO: True}


def limit_this_process(processor_time: int) -> None:
    """Bound the memory and the time that a file can take, whatever is in it.

    Args:
        processor_time: of this process, from now on [s].
    """
    bytes_at_most = psutil.Process().memory_info().vms + MEMORY
    seconds_at_most = math.ceil(time.process_time()) + processor_time
    for kind, limit in ((resource.RLIMIT_AS, bytes_at_most), (resource.RLIMIT_CPU, seconds_at_most)):
        with suppress(ValueError, OSError):  # the system has a lower one, or none of this kind
            resource.setrlimit(kind, (limit, limit))


def _run(text: str) -> dict[str, Any]:
    """The content of run.json, if the parts that are read have the right kinds."""
    try:
        run = check_mapping("run.json", json.loads(text, parse_constant=_refuse_constant))
    except RecursionError as error:
        raise InvalidValueError("run.json", "too deep", "must be JSON that can be read") from error
    except ValueError as error:
        if isinstance(error, WalkError):
            raise
        raise InvalidValueError("run.json", str(error)[:200], "must be JSON") from error
    check_size("run.json", run, MAX_VALUES)
    for key in ("scenario", "parameters", "versions", "metrics"):
        run[key] = check_mapping(f"run.json.{key}", run.get(key))
    changes = run.setdefault("parameter_changes", [])
    if not isinstance(changes, list) or not all(isinstance(change, dict) for change in changes):
        raise InvalidValueError("run.json.parameter_changes", changes, "must be a list of mappings")
    if not isinstance(run["metrics"].setdefault("reason", ""), str):
        raise InvalidValueError("run.json.metrics.reason", run["metrics"]["reason"], "must be text")
    return run


def _refuse_constant(name: str) -> None:
    raise InvalidValueError("run.json", name, "must have finite numbers only")


def _scenario(run: Mapping[str, Any], choices: RobotChoices, name: str) -> Scenario:
    """The scenario of run.json, of a robot that this server knows by its name: a path would be one on our disk."""
    robot = choices.load(run["parameters"].get("robot"))
    named = {"name": name} if name else {}
    scenario = scenario_from_mapping({**run["scenario"], **named, "robot": robot.source})
    if (nb_changes := len(scenario.parameter_changes())) > MAX_CHANGES:
        raise InvalidValueError("changes of parameters", nb_changes, f"must be at most {MAX_CHANGES}")
    in_force = parameters_in_force(robot, scenario.parameters)
    for key in ("control_period", "gravity"):  # by which it is drawn
        if run["parameters"].get(key) != in_force[key]:
            limit = f"must be {in_force[key]:g}, as its scenario has it"
            raise InvalidValueError(f"run.json.parameters.{key}", run["parameters"].get(key), limit)
    return scenario


def _unknown_scenario(robot: Robot, columns: Mapping[str, Vector], period: float, name: str) -> Scenario:
    """A scenario as long as the recording, of which nothing else is known."""
    plant = {"plant": "mujoco"} if "q_commanded_0" in columns else {}
    return scenario_from_mapping(
        {
            "name": name or "uploaded",
            "description": WITHOUT_SCENARIO,
            "robot": robot.source,
            "duration": len(columns["tick"]) * period,
            "parameters": {"control_period": period, **plant},
        }
    )


def _recording_of(
    scenario: Scenario,
    columns: Mapping[str, Vector],
    parameters: Mapping[str, Any],
    changes: tuple[Mapping[str, Any], ...],
) -> Recording:
    return Recording(
        scenario=scenario,
        columns=tuple(columns),
        rows=np.column_stack(list(columns.values())),
        parameters=parameters,
        parameter_changes=changes,
        reason="",
        body_use=None,
    )
