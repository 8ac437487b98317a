"""Runs as JSON."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from pydantic import BaseModel, Field

from app.formats import FORMATS
from app.runs.run import Run, RunStatus


class RunSummary(BaseModel):
    """A scripted run, without its scenario and metrics."""

    id: str
    name: str = Field(description="Name of the scenario.")
    robot: str
    duration: float = Field(description="Duration of the scenario [s].")
    status: RunStatus
    reason: str = Field(description="Why the run failed, or was cancelled.")
    progress: float = Field(ge=0.0, le=1.0, description="Fraction of the ticks that are simulated.")
    real_time_factor: float | None = Field(description="Simulated over real time; null before it is known.")
    created: datetime
    started: datetime | None
    ended: datetime | None
    size: int = Field(description="Size of its files [bytes].")
    files: dict[str, str] = Field(description="Address of each file of a run that was simulated to its end.")


class RunBody(RunSummary):
    """A scripted run."""

    scenario: Mapping[str, Any] = Field(description="The scenario as it was sent.")
    metrics: Mapping[str, Any] | None = Field(description="Metrics in run.json, of a run that is done.")


def run_summary(run: Run) -> RunSummary:
    """The run for a list."""
    return RunSummary(**_summary(run))


def run_body(run: Run) -> RunBody:
    """The run with its scenario and metrics."""
    return RunBody(**_summary(run), scenario=run.scenario, metrics=run.metrics)


def _summary(run: Run) -> dict[str, Any]:
    return {
        "id": run.id,
        "name": run.name,
        "robot": run.robot,
        "duration": run.duration,
        "status": run.status,
        "reason": run.reason,
        "progress": run.progress.fraction,
        "real_time_factor": run.progress.real_time_factor,
        "created": _time(run.created),
        "started": _time(run.started),
        "ended": _time(run.ended),
        "size": run.size,
        "files": _files(run) if run.size else {},
    }


def _files(run: Run) -> dict[str, str]:
    names = {"json": "run.json"} | {form.ending: form.file for form in FORMATS.values()}
    return {ending: f"{address(run.id)}/{name}" for ending, name in names.items()}


def address(run_id: str) -> str:
    """Path of a run in the API."""
    return f"/api/v1/runs/{run_id}"


def _time(seconds: float | None) -> datetime | None:
    return None if seconds is None else datetime.fromtimestamp(seconds, UTC)
