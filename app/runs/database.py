"""Rows of runs in SQLite, one each; a database that is broken is set aside, and what can be read of it is kept."""

import json
import logging
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, get_args

from app.runs.run import Run, RunProgress
from app.work import WorkStatus

logger = logging.getLogger(__name__)

SCHEMA = """
CREATE TABLE IF NOT EXISTS runs (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE,
    scenario TEXT NOT NULL,
    robot TEXT NOT NULL,
    duration REAL NOT NULL,
    status TEXT NOT NULL,
    reason TEXT NOT NULL DEFAULT '',
    created REAL NOT NULL,
    started REAL,
    ended REAL,
    real_time_factor REAL,
    size INTEGER NOT NULL DEFAULT 0,
    metrics TEXT
);
"""
BROKEN = {sqlite3.SQLITE_ERROR, sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_FORMAT}
"""Codes of errors that a database has in itself, and not from the disk that it is on."""
ROW_BROKEN = "its record was broken, and its files are gone"


class RunDatabase:
    """Rows of runs in a file. Belongs to one thread at a time."""

    def __init__(self, file: Path) -> None:
        """Open nothing yet.

        Args:
            file: of the database, made if need be.
        """
        self._file = file
        self._db: sqlite3.Connection | None = None
        self._inode = -1

    def open(self) -> tuple[list[Run], str]:
        """Open the database for writing.

        Returns:
            The runs of the rows, the oldest first, and the name under which a broken database was set aside, or "".

        Raises:
            sqlite3.Error: if the disk does not take it.
            OSError: if a broken one cannot be set aside.
        """
        runs: list[Run] = []
        try:
            self._db = self._connect()
            for run in _runs(self._db):
                runs.append(run)
            if self._db.execute("PRAGMA quick_check").fetchone()[0] != "ok":
                raise sqlite3.DatabaseError("quick_check failed")
        except sqlite3.Error as error:
            self.close()
            if not is_broken(error):
                raise
            name = self.set_aside(error)
            self._db = self._connect()
            for run in runs:
                self.write(run.id, run)
            return runs, name
        return runs, ""

    def read_only(self) -> list[Run]:
        """The runs of the rows, where the folder cannot be written to; none where they cannot be read."""
        try:
            with closing(sqlite3.connect(f"{self._file.resolve().as_uri()}?immutable=1", uri=True)) as db:
                db.row_factory = sqlite3.Row
                return list(_runs(db))
        except sqlite3.Error:
            return []

    def write(self, run_id: str, run: Run | None) -> None:
        """Store a run, or remove it.

        Args:
            run_id: of the run.
            run: to be stored; None removes its row.

        Raises:
            sqlite3.Error: if the row cannot be written.
        """
        assert self._db is not None
        if not self._is_in_place():
            raise sqlite3.DatabaseError(f"{self._file.name} was taken away")
        if run is None:
            self._db.execute("DELETE FROM runs WHERE id = ?", (run_id,))
            return
        row = _row(run)
        values = ", ".join(f":{name}" for name in row)
        self._db.execute(f"INSERT OR REPLACE INTO runs ({', '.join(row)}) VALUES ({values})", row)

    def set_aside(self, error: sqlite3.Error) -> str:
        """Rename the files of the database, which are broken, and return the new name.

        Raises:
            OSError: if they cannot be renamed.
        """
        self.close()
        name = f"{self._file.stem}.broken-{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}{self._file.suffix}"
        for end in ("-wal", "-shm", ""):
            file = self._file.with_name(self._file.name + end)
            if file.exists():
                file.rename(self._file.with_name(name + end))
        logger.warning("the database of the runs is broken (%s) and was set aside as %s", error, name)
        return name

    def close(self) -> None:
        """Close the file."""
        if self._db is not None:
            self._db.close()
            self._db = None

    def _is_in_place(self) -> bool:
        """Whether the open file is still the one of that name: SQLite would go on writing to one that is gone."""
        return self._file.exists() and self._file.stat().st_ino == self._inode

    def _connect(self) -> sqlite3.Connection:
        db = sqlite3.connect(self._file, check_same_thread=False, isolation_level=None)
        try:
            db.row_factory = sqlite3.Row
            db.execute("PRAGMA journal_mode = WAL")
            db.execute("PRAGMA synchronous = FULL")
            db.executescript(SCHEMA)
            self._inode = self._file.stat().st_ino
        except sqlite3.Error:
            db.close()
            raise
        return db


def is_broken(error: Exception) -> bool:
    """Whether an error is in the database itself, or its file was taken away: it will never work again."""
    if not isinstance(error, sqlite3.Error):
        return False
    code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT)  # one that SQLite did not raise has no code
    return code & 0xFF in BROKEN


def _runs(db: sqlite3.Connection) -> Iterator[Run]:
    """The runs of all rows; of a row that cannot be read what its id says."""
    for row in db.execute("SELECT * FROM runs ORDER BY number"):
        try:
            yield _run(row)
        except (ValueError, TypeError, LookupError, AttributeError, RecursionError) as error:
            logger.warning("the record of run %s is broken: %s", row["id"], error)
            yield broken_run(str(row["id"]))


def broken_run(run_id: str) -> Run:
    """A run of which nothing is known but that it was there."""
    return Run(id=run_id, source={}, robot="", duration=0.0, status="failed", reason=ROW_BROKEN, created=0.0)


def _run(row: sqlite3.Row) -> Run:
    scenario, metrics = json.loads(row["scenario"]), json.loads(row["metrics"]) if row["metrics"] else None
    if not isinstance(scenario, dict) or not isinstance(scenario.get("name", ""), str):
        raise ValueError("its scenario is none")
    if row["status"] not in get_args(WorkStatus) or not isinstance(metrics, dict | None):
        raise ValueError("its status or its metrics are none")
    size = int(row["size"])
    return Run(
        id=row["id"],
        source=scenario,
        robot=str(row["robot"]),
        duration=float(row["duration"]),
        status=row["status"],
        reason=str(row["reason"]),
        created=float(row["created"]),
        started=_time(row["started"]),
        ended=_time(row["ended"]),
        progress=RunProgress(1.0 if size > 0 else 0.0, _time(row["real_time_factor"])),
        size=size,
        metrics=metrics,
    )


def _time(value: Any) -> float | None:
    return None if value is None else float(value)


def _row(run: Run) -> dict[str, Any]:
    return {
        "id": run.id,
        "scenario": json.dumps(run.source),
        "robot": run.robot,
        "duration": run.duration,
        "status": run.status,
        "reason": run.reason,
        "created": run.created,
        "started": run.started,
        "ended": run.ended,
        "real_time_factor": run.progress.real_time_factor,
        "size": run.size,
        "metrics": None if run.metrics is None else json.dumps(run.metrics),
    }
