"""Runs on the disk: a row each in SQLite, and a folder of files for each that is done.

    runs.sqlite      a row for each run
    done/ID/         files of a run, there in full or not at all: moved here in one piece
    unfinished/      files being written; thrown away when a server starts
    lock             held by the server whose folder this is

A row names files only after their folder has been moved, and is deleted before it: whatever
moment the server dies at, `recover` sets each row right, and no folder is half there.
"""

import fcntl
import json
import math
import os
import shutil
import sqlite3
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from uuid import uuid4

from app.runs.run import Run, RunProgress, UnknownRunError

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
CREATE INDEX IF NOT EXISTS by_status ON runs (status, number);
"""
SERVER_DIED = "the server ended while it ran"


class DataInUseError(OSError):
    """Another server keeps its runs in this folder."""


class RunStore:
    """Keeps runs under a folder. All methods may be called from any thread."""

    def __init__(self, folder: Path) -> None:
        """Open the folder, which is made if need be.

        Raises:
            DataInUseError: if another server has it.
            OSError: if it cannot be written to.
        """
        self.folder = folder
        self._done, self._unfinished = folder / "done", folder / "unfinished"
        folder.mkdir(parents=True, exist_ok=True)
        self._lock_file = _locked(folder / "lock")
        self._lock = threading.RLock()
        self._db = sqlite3.connect(folder / "runs.sqlite", check_same_thread=False, isolation_level=None)
        self._db.row_factory = sqlite3.Row
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = FULL")
        self._db.executescript(SCHEMA)
        self.recover()

    def close(self) -> None:
        """Release the folder."""
        with self._lock:
            self._db.close()
            self._lock_file.close()

    def recover(self) -> None:
        """Mark runs that were under way when a server died as failed, and throw away files that no row names."""
        self._set("status = 'running'", status="failed", reason=SERVER_DIED, ended=time.time())
        shutil.rmtree(self._unfinished, ignore_errors=True)
        self._done.mkdir(exist_ok=True)
        known = {row["id"] for row in self._db.execute("SELECT id FROM runs WHERE size > 0")}
        for stray in set(os.listdir(self._done)) - known:
            shutil.rmtree(self._done / stray, ignore_errors=True)

    def add(self, scenario: Mapping[str, Any], robot: str, duration: float, status: str = "queued") -> Run:
        """Take in a run, under a new id.

        Args:
            scenario: as it was sent.
            robot: name of its robot.
            duration: simulated time [s].
            status: to begin with.
        """
        run_id = uuid4().hex
        row = (run_id, json.dumps(scenario), robot, duration, status, time.time())
        with self._lock:
            columns = "id, scenario, robot, duration, status, created"
            self._db.execute(f"INSERT INTO runs ({columns}) VALUES (?, ?, ?, ?, ?, ?)", row)
            return self.get(run_id)

    def get(self, run_id: str) -> Run:
        """The run of an id.

        Raises:
            UnknownRunError: if there is none of that id.
        """
        with self._lock:
            row = self._db.execute("SELECT * FROM runs WHERE id = ?", (run_id,)).fetchone()
        if row is None:
            raise UnknownRunError(run_id)
        return _run(row)

    def list(self) -> list[Run]:
        """All runs, the latest first."""
        with self._lock:
            return [_run(row) for row in self._db.execute("SELECT * FROM runs ORDER BY number DESC")]

    def nb_queued(self) -> int:
        """Number of runs that wait."""
        with self._lock:
            return self._db.execute("SELECT COUNT(*) FROM runs WHERE status = 'queued'").fetchone()[0]

    def start_next(self) -> Run | None:
        """The run that has waited longest, from now on running; None where none waits."""
        with self._lock:
            row = self._db.execute("SELECT id FROM runs WHERE status = 'queued' ORDER BY number LIMIT 1").fetchone()
            if row is None:
                return None
            self._set("id = :id", id=row["id"], status="running", started=time.time())
            return self.get(row["id"])

    def unfinished(self, run_id: str) -> Path:
        """A new empty folder for the files of a run that is under way."""
        folder = self._unfinished / run_id
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        return folder

    def finish(self, run_id: str, real_time_factor: float | None) -> bool:
        """Keep the files of a run that was under way: done, or failed where it breaks what its scenario expects.

        Returns:
            False, and nothing is kept, where it was cancelled meanwhile.
        """
        folder = self._unfinished / run_id
        run_json = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        broken = [_broken(verdict) for verdict in run_json["expectations"] if not verdict["holds"]]
        size = sum(_sync(file) for file in folder.iterdir())
        with self._lock:
            if not self._is(run_id, "running"):
                self.discard(run_id)
                return False
            folder.rename(self._done / run_id)
            self._set(
                "id = :id",
                id=run_id,
                status="failed" if broken else "done",
                reason="; ".join(broken),
                ended=time.time(),
                real_time_factor=real_time_factor,
                size=size,
                metrics=json.dumps(_finite(run_json["metrics"])),
            )
            return True

    def fail(self, run_id: str, reason: str) -> None:
        """Mark a run that was under way as failed."""
        self._set("id = :id AND status = 'running'", id=run_id, status="failed", reason=reason, ended=time.time())
        self.discard(run_id)

    def cancel(self, run_id: str) -> bool:
        """Cancel a run that has not ended; False if there was none."""
        given = {"id": run_id, "status": "cancelled", "reason": "cancelled on request", "ended": time.time()}
        return self._set("id = :id AND status IN ('queued', 'running')", **given) > 0

    def remove(self, run_id: str) -> None:
        """Forget a run that has ended, files and all."""
        with self._lock:
            self._db.execute("DELETE FROM runs WHERE id = ?", (run_id,))
        shutil.rmtree(self._done / run_id, ignore_errors=True)

    def trim(self, nb_kept: int, bytes_kept: int) -> None:
        """Remove the oldest ended runs, but never the latest.

        Args:
            nb_kept: most runs that are kept.
            bytes_kept: most bytes that all their files may have.
        """
        ended = [run for run in self.list() if run.has_ended]
        size = 0
        for i, run in enumerate(ended):
            size += run.size
            if i > 0 and (i >= nb_kept or size > bytes_kept):
                self.remove(run.id)

    def discard(self, run_id: str) -> None:
        """Throw away the files of a run that has not been finished."""
        shutil.rmtree(self._unfinished / run_id, ignore_errors=True)

    def measure(self, run_id: str) -> None:
        """Update the size of a run, whose files have changed."""
        size = sum(file.stat().st_size for file in self.files(run_id).iterdir())
        self._set("id = :id", id=run_id, size=size)

    def files(self, run_id: str) -> Path:
        """The folder of a run that was simulated to its end."""
        return self._done / run_id

    def _is(self, run_id: str, status: str) -> bool:
        return (
            self._db.execute("SELECT 1 FROM runs WHERE id = ? AND status = ?", (run_id, status)).fetchone() is not None
        )

    def _set(self, where: str, **values: Any) -> int:
        """Change columns of the rows that `where` selects, and return their number."""
        assigned = ", ".join(f"{name} = :{name}" for name in values if name != "id")
        with self._lock:
            return self._db.execute(f"UPDATE runs SET {assigned} WHERE {where}", values).rowcount


def _locked(path: Path) -> Any:
    """An open file that no other process can lock; the system unlocks it when this process ends, however it does."""
    file = path.open("a")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        file.close()
        raise DataInUseError(f"another server keeps its runs in {path.parent}") from error
    return file


def _sync(path: Path) -> int:
    """Flush a file to the disk, and return its size [bytes]."""
    with path.open("rb") as file:
        os.fsync(file.fileno())
        return os.fstat(file.fileno()).st_size


def _run(row: sqlite3.Row) -> Run:
    has_files = row["size"] > 0
    return Run(
        id=row["id"],
        scenario=json.loads(row["scenario"]),
        robot=row["robot"],
        duration=row["duration"],
        status=row["status"],
        reason=row["reason"],
        created=row["created"],
        started=row["started"],
        ended=row["ended"],
        progress=RunProgress(1.0 if has_files else 0.0, row["real_time_factor"]),
        size=row["size"],
        metrics=json.loads(row["metrics"]) if row["metrics"] else None,
    )


def _broken(verdict: Mapping[str, Any]) -> str:
    measured = "not measured in this run" if verdict["measured"] is None else f"measured {verdict['measured']}"
    return f"expected {verdict['name']}: {verdict['bound']}, {measured}"


def _finite(value: Any) -> Any:
    """Plain values with None in place of numbers that JSON cannot carry."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
