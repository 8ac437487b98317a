"""Runs as JSON."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from pydantic import AliasPath, BaseModel, ConfigDict, Field, computed_field

from app.formats import FORMATS
from app.work import WorkStatus


class WorkSummary(BaseModel):
    """A run or a sweep: where its work stands."""

    model_config = ConfigDict(from_attributes=True)

    id: str
    name: str = Field(description="Name of what was sent.")
    status: WorkStatus
    reason: str = Field(description="Why it failed, or was cancelled.")
    created: datetime
    started: datetime | None
    ended: datetime | None
    size: int = Field(description="Size of its files [bytes].")


class RunSummary(WorkSummary):
    """A scripted run, without its scenario and metrics."""

    robot: str
    duration: float = Field(description="Duration of the scenario [s].")
    progress: float = Field(
        ge=0.0,
        le=1.0,
        validation_alias=AliasPath("progress", "fraction"),
        description="Fraction of the ticks that are simulated.",
    )
    real_time_factor: float | None = Field(
        validation_alias=AliasPath("progress", "real_time_factor"),
        description="Simulated over real time; null before it is known.",
    )

    @computed_field(description="Address of each file of a run that was simulated to its end.")
    @property
    def files(self) -> dict[str, str]:
        """Address of each file by its ending."""
        names = {"json": "run.json"} | {form.ending: form.file for form in FORMATS.values()}
        return {ending: f"{address(self.id)}/{name}" for ending, name in names.items()} if self.size else {}


class RunBody(RunSummary):
    """A scripted run."""

    scenario: Mapping[str, Any] = Field(description="The scenario as it was sent.", validation_alias="source")
    metrics: Mapping[str, Any] | None = Field(description="Metrics in run.json, of a run that is done.")


def address(run_id: str) -> str:
    """Path of a run in the API."""
    return f"/api/v1/runs/{run_id}"
