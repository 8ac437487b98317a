"""A run read back from its folder."""

import json
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from walkcore.analysis.columns import BodyUse
from walkcore.errors import InvalidValueError, WalkError
from walkcore.scenario.recording import Recording
from walkcore.scenario.scenario import scenario_from_mapping
from walkcore.values import Vector

NEEDED = ("scenario", "parameters", "versions", "metrics")
"""Keys of run.json without which nothing can be made of a run; behind each is a mapping."""


@dataclass(frozen=True, slots=True, eq=False)
class StoredRun:
    """Content of run.json and recording.npz; a `Walk` for the analysis."""

    folder: Path
    run_json: str
    """Text of run.json."""
    run: Mapping[str, Any]
    """Content of run.json."""
    columns: Mapping[str, Vector]

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return str(self.run["scenario"].get("name", "unnamed"))

    @property
    def description(self) -> str:
        """Description of the scenario."""
        return str(self.run["scenario"].get("description", ""))

    @property
    def metrics(self) -> Mapping[str, Any]:
        """Metrics, as they were computed when the run was made."""
        return self.run["metrics"]

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Everything that the QP used, at the first tick."""
        return self.run["parameters"]

    @property
    def reason(self) -> str:
        """Why the robot fell, if it did."""
        return str(self.metrics["reason"])

    @property
    def body_use(self) -> BodyUse | None:
        """Always None: the files hold no more of it than `metrics` does."""
        return None

    def __getitem__(self, column: str) -> Vector:
        """One column, shape (ticks,)."""
        return self.columns[column]

    def recording(self) -> Recording:
        """The recording as it was in memory, but for `body_use`.

        Raises:
            WalkError: if the scenario is none by the present rules.
        """
        return Recording(
            scenario=scenario_from_mapping(self.run["scenario"]),
            columns=tuple(self.columns),
            rows=np.column_stack(list(self.columns.values())),
            parameters=self.parameters,
            parameter_changes=tuple(self.run["parameter_changes"]),
            reason=self.reason,
            body_use=None,
        )


def read_run(folder: Path) -> StoredRun:
    """The run in a folder that `walk run` or the server wrote.

    Raises:
        InvalidValueError: if the folder holds no run, or one that cannot be read.
    """
    try:
        run_json = (folder / "run.json").read_text(encoding="utf-8")
        run = json.loads(run_json)
        with np.load(folder / "recording.npz") as file:
            columns = {name: file[name] for name in file.files}
    except FileNotFoundError as error:
        limit = "must be a folder with run.json and recording.npz, as `walk run` writes it"
        raise InvalidValueError("run", str(folder), limit) from error
    except (OSError, ValueError, RecursionError, EOFError, zlib.error, zipfile.BadZipFile) as error:
        raise InvalidValueError("run", str(folder), f"cannot be read: {' '.join(str(error).split())}") from error
    missing = [key for key in NEEDED if not isinstance(run, dict) or not isinstance(run.get(key), dict)]
    if missing:
        raise InvalidValueError("run", str(folder), f"run.json has no {missing[0]}")
    if any(column.dtype.kind not in "fiu" or column.ndim != 1 for column in columns.values()):
        raise InvalidValueError("run", str(folder), "the columns of recording.npz must be lists of numbers")
    if len({len(column) for column in columns.values()}) != 1:
        raise InvalidValueError("run", str(folder), "the columns of recording.npz must have one length")
    return StoredRun(folder, run_json, run, columns)


@contextmanager
def as_written(*folders: Path) -> Iterator[None]:
    """Refuse runs in which something is missing or of another kind, wherever that is found out.

    Args:
        folders: of the runs.

    Raises:
        InvalidValueError: naming what was wrong.
    """
    try:
        yield
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        if isinstance(error, WalkError):
            raise
        why = " ".join(f"{type(error).__name__}: {error}".split())
        where = ", ".join(map(str, folders))
        raise InvalidValueError("run", where, f"is not as `walk run` writes it: {why}") from error
