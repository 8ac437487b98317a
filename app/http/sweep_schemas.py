"""Sweeps as JSON."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, computed_field

from app.runs.run import RunStatus

FILES = {"page": "sweep.html", "parquet": "cells.parquet", "json": "sweep.json"}


class SweepSummary(BaseModel):
    """A sweep that was posted, without what was sent."""

    model_config = ConfigDict(from_attributes=True)

    id: str
    name: str = Field(description="Name of the sweep.")
    status: RunStatus
    reason: str = Field(description="Why the sweep failed, or was cancelled.")
    nb_cells: int
    nb_done: int = Field(description="Cells that are finished.")
    time_left: float | None = Field(description="Estimated time that is left [s]; null before it is known.")
    created: datetime
    started: datetime | None
    ended: datetime | None
    size: int = Field(description="Size of its files [bytes].")

    @computed_field(description="Address of each file of a sweep that is done.")
    @property
    def files(self) -> dict[str, str]:
        """Address of each file by its kind."""
        is_done = self.status == "done"
        return {kind: f"{sweep_address(self.id)}/{name}" for kind, name in FILES.items()} if is_done else {}


class SweepBody(SweepSummary):
    """A sweep that was posted."""

    sweep: Mapping[str, Any] = Field(description="The sweep as it was sent.", validation_alias="source")


def sweep_address(sweep_id: str) -> str:
    """Path of a sweep in the API."""
    return f"/api/v1/sweeps/{sweep_id}"
