"""Sweeps as JSON: the schema of what is sent, as documentation, since only the core judges sweeps; and the answers."""

from collections.abc import Mapping
from typing import Any

from pydantic import AliasPath, Field, computed_field

from app.http.json_schema import Json, list_of, mapping, number, text, whole
from app.http.run_schemas import WorkSummary
from app.http.scenario_schema import PARAMETERS, REFERENCE, WORLD
from walkcore import robot_names
from walkcore.analysis.survival import OBSERVED
from walkcore.analysis.sweep import MAX_DIRECTIONS, MAX_PHASES, MAX_SEEDS, MAX_WALKS

PUSHES = mapping(
    "Pushes on each walk.",
    ("directions", "phases", "max_impulse"),
    directions=whole("Directions, evenly spaced from straight ahead, in the heading frame.", 1, MAX_DIRECTIONS),
    phases=whole("Phases of the step, evenly spaced from the touchdown of the left foot on.", 1, MAX_PHASES),
    duration=number("Duration of a push [s]; zero gives it all in one tick.", 0.0, OBSERVED / 2, default=0.0),
    max_impulse=number("Hardest push [N s]; the robot limits it.", 1e-3, 1e4),
    coarse=number("Distance between the impulses that are tried first; by default an eighth of the hardest [N s]."),
    tolerance=number("Width down to which the limit of survival is bisected [N s].", default=1.0),
)
SWEEP = {"title": "Sweep"} | mapping(
    "Pushes on every combination of robots, parameters and references, from all directions, in all phases of the step.",
    ("pushes",),
    name=text("Name of the sweep.", default="unnamed"),
    description=text("What the sweep is for.", default=""),
    robots=list_of(
        {"enum": robot_names()}, "Names of robots that ship; a file may also name robot files.", 1, MAX_WALKS
    ),
    parameters=list_of(PARAMETERS, "Parameters of the walks.", 1, MAX_WALKS),
    references=list_of(REFERENCE, "References of the walks.", 1, MAX_WALKS),
    pushes=PUSHES,
    seeds=whole("Seeds of the noise for each impulse; more than one needs noisy sensors.", 1, MAX_SEEDS, default=1),
    world=WORLD,
    body={"type": "boolean", "default": False, "description": "Whether whole bodies walk with the ideal plant, too."},
)


def sweep_schema() -> Json:
    """The JSON schema of a sweep file."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | SWEEP


FILES = {"page": "sweep.html", "parquet": "cells.parquet", "json": "sweep.json"}


class SweepSummary(WorkSummary):
    """A sweep that was posted, without what was sent."""

    nb_cells: int = Field(validation_alias=AliasPath("progress", "nb_cells"))
    nb_done: int = Field(validation_alias=AliasPath("progress", "nb_done"), description="Cells that are finished.")
    time_left: float | None = Field(
        validation_alias=AliasPath("progress", "time_left"),
        description="Estimated time that is left [s]; null before it is known.",
    )

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
