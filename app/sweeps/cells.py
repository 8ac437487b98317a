"""Outcomes of cells on the disk: parts as they come, each written in one piece, and the table of all in the end."""

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from walkcore.analysis.cell_outcome import CellOutcome
from walkcore.analysis.sweep import Sweep, sweep_from_mapping
from walkcore.errors import InvalidValueError

TABLE, INFO, PARTS = "cells.parquet", "sweep.json", "parts"
MAX_PARTS = 64  # part files before they are joined to one: a folder of a million is slow to read
OUTCOME = (
    ("largest_impulse", pa.float64()),
    ("delta_v", pa.float64()),
    ("islands", pa.list_(pa.list_(pa.float64()))),
    ("success_low", pa.float64()),
    ("success_high", pa.float64()),
)
PART_SCHEMA = pa.schema([("index", pa.int64()), *OUTCOME])
SCHEMA = pa.schema(
    [
        ("robot", pa.string()),
        ("parameters", pa.string()),
        *((name, pa.float64()) for name in ("vx", "vy", "yaw_rate", "direction", "phase")),
        *OUTCOME,
    ]
)
"""Columns of the table of cells, in the order of the contract."""


class CellStore:
    """Outcomes of the cells of one sweep in a folder. Belongs to one process at a time."""

    def __init__(self, folder: Path, sweep: Sweep, versions: Mapping[str, str]) -> None:
        """Open the folder, and take up what it has of the same sweep.

        Args:
            folder: made if need be.
            sweep: whose cells they are.
            versions: of the packages that decide the outcomes.

        Raises:
            InvalidValueError: if it holds another sweep, or outcomes of other versions.
            OSError: if it cannot be written to.
        """
        self.folder, self._sweep, self._parts = folder, sweep, folder / PARTS
        self.outcomes: dict[int, CellOutcome] = {}
        """Outcome of each cell that is finished, by its number."""
        self._names: list[str] = []
        self._take_up({"sweep": dict(sweep.source), "versions": dict(versions)})

    def _take_up(self, info: Mapping[str, Any]) -> None:
        self._parts.mkdir(parents=True, exist_ok=True)
        if (self.folder / INFO).is_file():
            before = read_json(self.folder / INFO)
            for key, what in (("sweep", "another sweep"), ("versions", "outcomes of other versions")):
                if before.get(key) != json.loads(json.dumps(info[key])):
                    raise InvalidValueError("out", str(self.folder), f"holds {what}: name another folder")
        else:
            write_whole(self.folder / INFO, json.dumps(info, indent=2) + "\n")
        for half in self._parts.glob("*.half"):  # somebody was stopped while writing it
            half.unlink()
        if (self.folder / TABLE).is_file():
            self.outcomes = dict(enumerate(outcomes_of(pq.read_table(self.folder / TABLE))))
            return
        for part in sorted(self._parts.glob("*.parquet")):
            table = pq.read_table(part)
            self.outcomes |= zip(table["index"].to_pylist(), outcomes_of(table), strict=True)
            self._names.append(part.name)

    def add(self, first: int, outcomes: Sequence[CellOutcome]) -> None:
        """Keep the outcomes of cells that follow each other, on the disk before this returns.

        Args:
            first: number of the first one.
            outcomes: of them.
        """
        numbered = dict(enumerate(outcomes, first))
        self.outcomes |= numbered
        self._write_part(f"{first:08d}-{len(outcomes)}.parquet", numbered)
        if len(self._names) > MAX_PARTS:
            self._join()

    def _join(self) -> None:
        old = self._names
        self._names = []
        self._write_part(f"all-{len(self.outcomes):08d}.parquet", self.outcomes)
        for name in set(old) - set(self._names):
            (self._parts / name).unlink()

    def _write_part(self, name: str, outcomes: Mapping[int, CellOutcome]) -> None:
        columns = {"index": list(outcomes), **_columns(list(outcomes.values()))}
        write_table(self._parts / name, pa.table(columns, PART_SCHEMA))
        self._names.append(name)

    @property
    def missing(self) -> list[int]:
        """Numbers of the cells that are not finished."""
        return [index for index in range(self._sweep.nb_cells) if index not in self.outcomes]

    def write_table(self) -> Path:
        """Write the table of all cells, which must be finished, and remove the parts."""
        write_table(self.folder / TABLE, cells_table(self._sweep, self.outcomes))
        for part in self._parts.glob("*"):
            part.unlink()
        self._parts.rmdir()
        return self.folder / TABLE


def cells_table(sweep: Sweep, outcomes: Mapping[int, CellOutcome]) -> pa.Table:
    """The table of all cells, in the order of the file."""
    cells = [sweep.cell(index) for index in range(sweep.nb_cells)]
    references = [walk.events[0].reference for walk in sweep.walks]
    parameters = [json.dumps(walk.source["parameters"], sort_keys=True) for walk in sweep.walks]
    columns: dict[str, list[Any]] = {
        "robot": [sweep.walks[cell.walk].source["robot"] for cell in cells],
        "parameters": [parameters[cell.walk] for cell in cells],
        **{name: [getattr(references[cell.walk], name) for cell in cells] for name in ("vx", "vy", "yaw_rate")},
        "direction": [cell.direction for cell in cells],
        "phase": [cell.phase for cell in cells],
    }
    return pa.table(columns | _columns([outcomes[cell.index] for cell in cells]), SCHEMA)


def _columns(outcomes: Sequence[CellOutcome]) -> dict[str, list[Any]]:
    return {name: [getattr(outcome, name) for outcome in outcomes] for name, _ in OUTCOME}


def outcomes_of(table: pa.Table) -> Iterator[CellOutcome]:
    """The outcomes in the rows of a table."""
    for row in table.select([name for name, _ in OUTCOME]).to_pylist():
        yield CellOutcome(**row | {"islands": tuple((low, high) for low, high in row["islands"])})


def read_cells(folder: Path) -> tuple[Sweep, list[CellOutcome], dict[str, Any]]:
    """The sweep, the outcomes of its cells and the content of sweep.json, from a folder that `walk sweep` wrote.

    Raises:
        InvalidValueError: if the folder holds no finished sweep.
    """
    try:
        info = read_json(folder / INFO)
        outcomes = list(outcomes_of(pq.read_table(folder / TABLE)))
        sweep = sweep_from_mapping(info["sweep"])
    except (OSError, LookupError, TypeError, ValueError, pa.ArrowException) as error:
        why = " ".join(f"{type(error).__name__}: {error}".split())
        raise InvalidValueError("sweep", str(folder), f"is no finished sweep of `walk sweep`: {why}") from error
    if len(outcomes) != sweep.nb_cells:
        raise InvalidValueError("sweep", str(folder), f"has {len(outcomes)} cells, its sweep has {sweep.nb_cells}")
    return sweep, outcomes, info


def read_json(file: Path) -> dict[str, Any]:
    """The content of a JSON file that is an object.

    Raises:
        InvalidValueError: if it is none.
    """
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InvalidValueError("sweep", str(file), "is not JSON") from error
    if not isinstance(content, dict):
        raise InvalidValueError("sweep", str(file), "is not a JSON object")
    return content


def write_table(file: Path, table: pa.Table) -> None:
    """Write a table in one piece: whatever happens, the file is whole or not there."""
    half = file.with_suffix(".half")
    pq.write_table(table, half, compression="zstd")
    _put_in_place(half, file)


def write_whole(file: Path, text: str) -> None:
    """Write a text file in one piece."""
    half = file.with_suffix(".half")
    half.write_text(text, encoding="utf-8")
    _put_in_place(half, file)


def _put_in_place(half: Path, file: Path) -> None:
    with half.open("rb") as written:
        os.fsync(written.fileno())
    half.replace(file)
