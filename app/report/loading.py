"""A run read back from its folder."""

import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from walkcore.analysis.columns import BodyUse
from walkcore.errors import InvalidValueError
from walkcore.values import Vector

NEEDED = ("scenario", "parameters", "versions", "metrics")
"""Keys of run.json without which there is nothing to report."""


@dataclass(frozen=True, slots=True, eq=False)
class LoadedRun:
    """What run.json and recording.npz say."""

    folder: Path
    run: Mapping[str, Any]
    columns: Mapping[str, Vector]

    @property
    def name(self) -> str:
        """Of the scenario."""
        return str(self.run["scenario"].get("name", "unnamed"))

    @property
    def description(self) -> str:
        """Of the scenario."""
        return str(self.run["scenario"].get("description", ""))

    @property
    def metrics(self) -> Mapping[str, Any]:
        """As they were computed when the run was made."""
        return self.run["metrics"]

    @property
    def parameters(self) -> Mapping[str, Any]:
        """All that the QP used, at the first tick."""
        return self.run["parameters"]

    @property
    def reason(self) -> str:
        """Why the robot fell, if it did."""
        return str(self.metrics["reason"])

    @property
    def body_use(self) -> BodyUse | None:
        """Not in the files; `metrics` sums it up."""
        return None

    def __getitem__(self, column: str) -> Vector:
        """One column, shape (ticks,)."""
        return self.columns[column]


def load_run(folder: Path) -> LoadedRun:
    """Read the folder that `walk run` wrote.

    Raises:
        InvalidValueError: if it holds no run, or one that cannot be read.
    """
    try:
        run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        with np.load(folder / "recording.npz") as file:
            columns = {name: file[name] for name in file.files}
    except FileNotFoundError as error:
        limit = "must be a folder with run.json and recording.npz, as `walk run` writes it"
        raise InvalidValueError("run", str(folder), limit) from error
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise InvalidValueError("run", str(folder), f"cannot be read: {error}") from error
    missing = [key for key in NEEDED if not isinstance(run, dict) or key not in run]
    if missing:
        raise InvalidValueError("run", str(folder), f"run.json has no {missing[0]}")
    return LoadedRun(folder, run, columns)
