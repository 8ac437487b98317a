"""Sums over the cells of a sweep: what each walk survives, in tables and as names that tell the walks apart."""

import json
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from app.settings import usable_cores
from app.sweeps.cells import INFO, read_json, write_whole
from walkcore.analysis.cell_outcome import CellOutcome
from walkcore.analysis.sweep import Sweep
from walkcore.scenario.scenario import Scenario
from walkcore.values import Matrix


class Component(NamedTuple):
    """A component of a reference, in words."""

    unit: str
    positive: str
    """Direction of positive values."""
    negative: str


COMPONENTS = {
    "vx": Component("m/s", "ahead", "back"),
    "vy": Component("m/s", "to the left", "to the right"),
    "yaw_rate": Component("rad/s", "to the left", "to the right"),
}


@dataclass(frozen=True, slots=True, eq=False)
class WalkCells:
    """The cells of one walk."""

    number: int
    name: str
    """Name that tells it from the others of the sweep."""
    scenario: Scenario
    largest: Matrix
    """Largest impulse survived by direction and phase; NaN where the robot falls without a push [N s]."""
    nb_islands: int
    """Cells that survive further impulses, beyond the first lethal one."""
    max_impulse: float
    """The hardest push that was tried [N s]."""

    @property
    def nb_capped(self) -> int:
        """Cells in which the hardest push was survived: their limit is not known."""
        return int(np.count_nonzero(self.largest == self.max_impulse))

    def summary(self) -> dict[str, Any]:
        """Worst, median and mean over the cells [N s], and the same as changes of velocity [m/s]."""
        has_fallen = bool(np.isnan(self.largest).any())
        totals = {"worst": np.min, "median": np.median, "mean": np.mean}
        impulse = {name: None if has_fallen else float(total(self.largest)) for name, total in totals.items()}
        mass = self.scenario.robot.mass
        return {
            "walk": self.name,
            "robot": self.scenario.source["robot"],
            "parameters": self.scenario.source["parameters"],
            "reference": self.scenario.source["events"][0]["reference"],
            "largest_impulse": impulse,
            "delta_v": {name: None if value is None else value / mass for name, value in impulse.items()},
            "cells": self.largest.size,
            "cells_capped": self.nb_capped,
            "cells_with_islands": self.nb_islands,
        }


def walks_of(sweep: Sweep, outcomes: Sequence[CellOutcome]) -> list[WalkCells]:
    """The walks of a sweep with their cells."""
    shape = (len(sweep.walks), sweep.pushes.directions, sweep.pushes.phases)
    numbers = [np.nan if o.largest_impulse is None else o.largest_impulse for o in outcomes]
    largest, islands = np.reshape(numbers, shape), np.reshape([bool(o.islands) for o in outcomes], shape)
    names = walk_names(sweep)
    return [
        WalkCells(k, names[k], walk, largest[k], int(islands[k].sum()), sweep.pushes.scan.max_impulse)
        for k, walk in enumerate(sweep.walks)
    ]


def walk_names(sweep: Sweep) -> list[str]:
    """A name of each walk, of what differs between them."""
    sources = [walk.source for walk in sweep.walks]
    differing = {
        key
        for source in sources
        for key in source["parameters"]
        if any(other["parameters"].get(key) != source["parameters"].get(key) for other in sources)
    }
    differing -= {"horizon_samples"} if "scheme" in differing else set()  # a scheme may need a longer one
    names: list[str] = []
    for source in sources:
        chosen = [str(value).replace("_", " ") for key, value in source["parameters"].items() if key in differing]
        names.append(", ".join([source["robot"], _motion(source["events"][0]["reference"]), *chosen]))
    return names


def _motion(reference: dict[str, float]) -> str:
    """A reference in words."""
    parts = [
        f"{abs(value):g} {unit} {positive if value > 0.0 else negative}"
        for key, (unit, positive, negative) in COMPONENTS.items()
        if (value := reference.get(key, 0.0))
    ]
    return " and ".join(parts) or "in place"


def write_info(folder: Path, walks: Sequence[WalkCells]) -> None:
    """Add summaries and the machine to sweep.json."""
    info = read_json(folder / INFO)
    machine = {"system": platform.system(), "architecture": platform.machine(), "cores": usable_cores()}
    whole = info | {"machine": machine, "walks": [walk.summary() for walk in walks]}
    write_whole(folder / INFO, json.dumps(whole, indent=2) + "\n")


def summary_rows(walks: Sequence[WalkCells]) -> list[list[str]]:
    """A table of all walks, its head first."""
    rows = [["walk", "worst", "median", "mean N s", "worst", "median m/s", "capped", "islands"]]
    for walk in walks:
        found = walk.summary()
        impulse, delta_v = found["largest_impulse"], found["delta_v"]
        if impulse["worst"] is None:
            rows.append([walk.name, "falls without a push", *[""] * 6])
            continue
        numbers = [f"{impulse[name]:.1f}" for name in impulse] + [
            f"{delta_v[name]:.2f}" for name in ("worst", "median")
        ]
        rows.append([walk.name, *numbers, f"{walk.nb_capped} of {walk.largest.size}", str(walk.nb_islands)])
    return rows
