"""Runs on the disk: a row each in SQLite, and a folder of files for each that is done.

    runs.sqlite      a row for each run
    done/ID/         files of a run, there in full or without run.json: moved here in one piece
    unfinished/      files being written; thrown away when a server starts
    lock             held by the server whose folder this is

What is in memory is the truth. A change that the disk does not take, as it is full or read-only, is told by `problem`
and written when it can be. Whatever moment the server dies at, the next one sets each run right by its row and its
folder: a folder with run.json is complete, and one without it is being removed.
"""

import fcntl
import logging
import os
import shutil
import sqlite3
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from uuid import uuid4

from app.runs.database import RunDatabase, is_broken
from app.runs.recovery import corrected, folder_size, outcome
from app.runs.run import Run, RunProgress
from app.runs.run_jobs import Simulate, SimulationResult
from app.work import WorkStatus, WorkStore, WorkUnavailableError

logger = logging.getLogger(__name__)

RESERVE = 1_000_000  # bytes that stay free for rows, beside the files of a run


class DataInUseError(OSError):
    """Another server keeps its runs in this folder."""


class RunStore(WorkStore[Run]):
    """Keeps runs under a folder. All methods may be called from any thread."""

    def __init__(self, folder: Path) -> None:
        """Open the folder, which is made if need be; one that cannot be written to is tried again with each change.

        Raises:
            DataInUseError: if another server has it.
        """
        super().__init__()
        self.folder = folder
        self.notice = ""
        """The repairs that were made when the folder was opened; empty if none were needed."""
        self._done, self._unfinished = folder / "done", folder / "unfinished"
        self._lock_file: Any = None
        self._database = RunDatabase(folder / "runs.sqlite")
        self._unwritten: dict[str, None] = {}  # ids of runs whose rows are not up to date, the oldest change first
        self._error = ""
        self._lacks_space = False
        try:
            self._open()
            self._write()
        except DataInUseError:
            raise
        except (OSError, sqlite3.Error) as error:
            self._trouble(error)
            self._works = {run.id: run for run in self._database.read_only()}
            self._correct()

    def close(self) -> None:
        """Release the folder."""
        with self._lock:
            self._write()
            self._release()

    @property
    def problem(self) -> str:
        """The trouble that keeps runs from being written or started; empty if there is none."""
        if self._error:
            return f"runs cannot be written to {self.folder}: {self._error}"
        free = self._free()
        if self._lacks_space or free < RESERVE:
            return f"runs wait for space on the disk of {self.folder}: {free / 1e6:.1f} MB are free"
        return ""

    def add(self, scenario: Mapping[str, Any], robot: str, duration: float, status: WorkStatus = "queued") -> Run:
        """Take in a run, under a new id.

        Args:
            scenario: as it was sent.
            robot: name of its robot.
            duration: simulated time [s].
            status: to begin with.

        Raises:
            WorkUnavailableError: if it cannot be written.
        """
        run = Run(id=uuid4().hex, source=scenario, robot=robot, duration=duration, status=status, created=time.time())
        with self._lock:
            self._put(run)
            if run.id in self._unwritten:
                del self._unwritten[run.id], self._works[run.id]
                raise WorkUnavailableError(f"the run cannot be kept: {self._error}")
            return run

    def has_work(self) -> bool:
        """Whether something waits to be started or written, now or as soon as the disk takes it."""
        with self._lock:
            return bool(self._error or self._unwritten) or super().has_work()

    def start_next(self) -> Run | None:
        """The run that has waited longest of those that the disk has space for, from now on running; None without."""
        with self._lock:
            self._write()
            run = None if self._error else super().start_next()
            self._lacks_space = not self._error and run is None and self.nb_queued() > 0
            return run

    def _has_room(self, work: Run) -> bool:
        return work.expected_size <= self._free() - RESERVE

    def job(self, work_id: str) -> Simulate:
        """The job that simulates a run.

        Raises:
            OSError: if there can be no folder for its files.
        """
        return Simulate(self.get(work_id).source, self.unfinished(work_id))

    def keep(self, work_id: str, result: SimulationResult) -> Run | None:
        """Keep the files of a run that was simulated; see `finish`."""
        return self.finish(work_id, result.real_time_factor)

    def unfinished(self, run_id: str) -> Path:
        """A new empty folder for the files of a run that is under way.

        Raises:
            OSError: if it cannot be made.
        """
        folder = self._unfinished / run_id
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        return folder

    def finish(self, run_id: str, real_time_factor: float | None) -> Run | None:
        """Keep the files of a run that was under way: done, or failed where it breaks what its scenario expects.

        Returns:
            The run as it is kept; None, and nothing is kept, where it was cancelled meanwhile.

        Raises:
            OSError: if the files are not there in full.
        """
        folder = self._unfinished / run_id
        verdict = outcome(folder)
        size = sum(_sync(file) for file in folder.iterdir())
        with self._lock:
            run = self._running(run_id)
            if run is None:
                self.discard(run_id)
                return None
            folder.rename(self._done / run_id)
            progress = RunProgress(1.0, real_time_factor)
            return self._put(replace(run, ended=time.time(), progress=progress, size=size, **verdict))

    def remove(self, work_id: str) -> None:
        """Forget a run that has ended, files and all; the files go first, which frees the space that the rest takes.

        Raises:
            WorkUnavailableError: if its files cannot be removed.
        """
        with self._lock:
            try:
                (self._done / work_id / "run.json").unlink(missing_ok=True)
            except OSError as error:
                raise WorkUnavailableError(f"the files of the run cannot be removed: {error}") from error
            shutil.rmtree(self._done / work_id, ignore_errors=True)
            self._works.pop(work_id, None)
            self._unwritten[work_id] = None
            self._write()

    def discard(self, work_id: str) -> None:
        """Throw away the files of a run that has not been finished."""
        shutil.rmtree(self._unfinished / work_id, ignore_errors=True)

    def measure(self, run_id: str) -> None:
        """Update the size of a run, whose files have changed."""
        with self._lock:
            if (run := self._works.get(run_id)) is not None:
                self._put(replace(run, size=folder_size(self.files(run_id))))

    def files(self, run_id: str) -> Path:
        """The folder of a run that was simulated to its end."""
        return self._done / run_id

    def _free(self) -> int:
        """Free space on the disk [bytes]; none where there is no folder."""
        try:
            return shutil.disk_usage(self.folder).free
        except OSError:
            return 0

    def _put(self, work: Run) -> Run:
        """Take over the new state of a run, in memory and if possible on the disk."""
        self._works[work.id] = work
        self._unwritten[work.id] = None
        self._write()
        return work

    def _write(self) -> None:
        """Bring the rows up to date, as far as the disk takes them; in place of a broken database comes a new one."""
        for _ in range(2):
            try:
                self._open()
                for run_id in list(self._unwritten):
                    self._database.write(run_id, self._works.get(run_id))
                    del self._unwritten[run_id]
                self._error = ""
                return
            except (OSError, sqlite3.Error) as error:
                self._trouble(error)
                if not is_broken(error) or self._lock_file is None:
                    return
                self._unwritten = dict.fromkeys([*self._works, *self._unwritten])
                self._release()

    def _trouble(self, error: Exception) -> None:
        reason = str(error)
        if reason != self._error:
            logger.warning("runs cannot be written to %s: %s", self.folder, reason)
        self._error = reason

    def _release(self) -> None:
        self._database.close()
        if self._lock_file is not None:
            self._lock_file.close()
            self._lock_file = None

    def _open(self) -> None:
        """Take the folder, read its rows, and set every run right that a server left half done.

        Raises:
            OSError: if the folder cannot be written to, or is another server's.
            sqlite3.Error: if the database cannot be.
        """
        if self._lock_file is not None:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        self._lock_file = _locked(self.folder / "lock")
        try:
            runs, set_aside = self._database.open()
            self._done.mkdir(exist_ok=True)
        except BaseException:
            self._release()
            raise
        before = self._works
        for folder in self._unfinished.iterdir() if self._unfinished.is_dir() else ():
            if folder.name not in before or before[folder.name].has_ended:
                shutil.rmtree(folder, ignore_errors=True)
        self._works = {run.id: run for run in runs if run.id not in self._unwritten}
        self._works |= {run_id: before[run_id] for run_id in self._unwritten if run_id in before}
        nb_found = self._correct()
        self._works = {run.id: run for run in sorted(self._works.values(), key=lambda run: run.created)}
        if set_aside:
            self.notice = f"the database of the runs was broken and is set aside as {set_aside}; "
            self.notice += f"{nb_found} runs were found again in their folders"

    def _correct(self) -> int:
        """Set runs right by their folders; the number of those that only their folders tell of."""
        right, nb_found = corrected(self._works, self._done, self._unwritten)
        self._works |= right
        self._unwritten |= dict.fromkeys(right)
        return nb_found


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
