"""Sweeps that were posted to a server, on its disk: a folder each, with a file for its state beside its results.

    ID/state.json    what was sent, and how far it is; written in one piece
    ID/results/      as `walk sweep` writes them, finished cells as they come

What is in memory is the truth. A sweep that was under way when its server ended is queued again, and goes on with the
cells that are missing.
"""

import json
import logging
import math
import shutil
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from uuid import uuid4

from app.jobs import Report
from app.runs.run import ENDED, RunStatus, RunsUnavailableError, UnknownRunError
from app.sweeps.cells import CellStore, read_json, write_whole
from app.sweeps.engine import run_sweep, sweep_versions
from app.sweeps.results import write_results
from walkcore.analysis.sweep import sweep_from_mapping
from walkcore.errors import WalkError

logger = logging.getLogger(__name__)

STATE, RESULTS = "state.json", "results"
KEPT = ("source", "nb_cells", "status", "reason", "created", "started", "ended", "size")


@dataclass(frozen=True, slots=True, eq=False)
class PostedSweep:
    """A sweep and the state of its walks."""

    id: str
    source: Mapping[str, Any]
    """The sweep as it was sent."""
    nb_cells: int
    status: RunStatus = "queued"
    reason: str = ""
    """Why it failed, or was cancelled."""
    created: float = 0.0
    """Time at which it was taken in [s since 1970], as the following times."""
    started: float | None = None
    ended: float | None = None
    size: int = 0
    """Size of its files [bytes]."""
    nb_done: int = 0
    """Cells that are finished."""
    time_left: float | None = None
    """Estimated time that is left [s]; None before it is known."""

    @property
    def name(self) -> str:
        """Name of the sweep."""
        return self.source.get("name", "unnamed")

    @property
    def has_ended(self) -> bool:
        """Whether nothing more will change."""
        return self.status in ENDED


@dataclass(frozen=True, slots=True, eq=False)
class WalkSweep:
    """Job that walks a sweep in its own process, and writes what is told of it."""

    source: Mapping[str, Any]
    folder: Path
    """Folder for the results, which may hold finished cells of the same sweep."""

    def __call__(self, report: Report) -> None:
        """Walk the cells that are missing, reporting `SweepProgress`."""
        sweep = sweep_from_mapping(self.source)
        try:
            store = CellStore(self.folder, sweep, sweep_versions(sweep))
        except WalkError:  # cells of another version of this program: they cannot be mixed
            shutil.rmtree(self.folder)
            store = CellStore(self.folder, sweep, sweep_versions(sweep))
        run_sweep(sweep, store, nb_workers=1, on_progress=report)
        store.write_table()
        write_results(self.folder)


class PostedSweepStore:
    """Keeps posted sweeps under a folder that no other server has. All methods may be called from any thread."""

    def __init__(self, folder: Path) -> None:
        """Read the sweeps of the folder, which is made when there is one to keep.

        Args:
            folder: of all sweeps.
        """
        self._folder = folder
        self._lock = threading.RLock()
        found = filter(None, map(_read, folder.iterdir() if folder.is_dir() else ()))
        self._sweeps = {sweep.id: sweep for sweep in sorted(found, key=lambda sweep: sweep.created)}  # the oldest first

    def add(self, source: Mapping[str, Any], nb_cells: int) -> PostedSweep:
        """Take in a sweep, under a new id.

        Raises:
            RunsUnavailableError: if it cannot be written.
        """
        sweep = PostedSweep(uuid4().hex, source, nb_cells, created=time.time())
        with self._lock:
            try:
                (self._folder / sweep.id).mkdir(parents=True)
                self._write(sweep)
            except OSError as error:
                shutil.rmtree(self._folder / sweep.id, ignore_errors=True)
                raise RunsUnavailableError(f"the sweep cannot be kept: {error}") from error
            self._sweeps[sweep.id] = sweep
        return sweep

    def get(self, run_id: str, /) -> PostedSweep:
        """The sweep of an id.

        Raises:
            UnknownRunError: if there is none of that id.
        """
        with self._lock:
            sweep = self._sweeps.get(run_id)
        if sweep is None:
            raise UnknownRunError(run_id, "sweep")
        return sweep

    def list(self) -> list[PostedSweep]:
        """All sweeps, the latest first."""
        with self._lock:
            return list(reversed(self._sweeps.values()))

    def nb_queued(self) -> int:
        """Number of sweeps that wait."""
        return sum(sweep.status == "queued" for sweep in self.list())

    def has_work(self) -> bool:
        """Whether a sweep waits."""
        return self.nb_queued() > 0

    def start_next(self) -> PostedSweep | None:
        """The sweep that has waited longest, from now on running; None without."""
        with self._lock:
            sweep = next((sweep for sweep in self._sweeps.values() if sweep.status == "queued"), None)
            return None if sweep is None else self._put(replace(sweep, status="running", started=time.time()))

    def job(self, run_id: str, /) -> WalkSweep:
        """The job that walks a sweep."""
        return WalkSweep(self.get(run_id).source, self.results(run_id))

    def keep(self, run_id: str, _: None, /) -> None:
        """Mark a sweep that was under way as done."""
        with self._lock:
            sweep = self._sweeps.get(run_id)
            if sweep is not None and sweep.status == "running":
                size = sum(file.stat().st_size for file in self.results(run_id).rglob("*") if file.is_file())
                self._put(replace(sweep, status="done", ended=time.time(), nb_done=sweep.nb_cells, size=size))
            else:
                self._discard(run_id)

    def fail(self, run_id: str, reason: str, /) -> None:
        """Mark a sweep that was under way as failed; what is there of its results goes."""
        with self._lock:
            sweep = self._sweeps.get(run_id)
            if sweep is not None and sweep.status == "running":
                self._put(replace(sweep, status="failed", reason=reason, ended=time.time()))
            self._discard(run_id)

    def cancel(self, sweep_id: str) -> bool:
        """Cancel a sweep that has not ended; False if there was none."""
        with self._lock:
            sweep = self._sweeps.get(sweep_id)
            if sweep is None or sweep.has_ended:
                return False
            self._put(replace(sweep, status="cancelled", reason="cancelled on request", ended=time.time()))
            if sweep.status == "queued":
                self._discard(sweep_id)
            return True

    def remove(self, sweep_id: str) -> None:
        """Forget a sweep that has ended, files and all.

        Raises:
            RunsUnavailableError: if its files cannot be removed.
        """
        with self._lock:
            try:
                (self._folder / sweep_id / STATE).unlink(missing_ok=True)
            except OSError as error:
                raise RunsUnavailableError(f"the sweep cannot be removed: {error}") from error
            shutil.rmtree(self._folder / sweep_id, ignore_errors=True)
            self._sweeps.pop(sweep_id, None)

    def trim(self, nb_kept: int) -> None:
        """Remove the oldest ended sweeps, beyond so many; those that the disk does not let go are kept."""
        for sweep in [sweep for sweep in self.list() if sweep.has_ended][nb_kept:]:
            try:
                self.remove(sweep.id)
            except RunsUnavailableError as error:
                logger.warning("an old sweep is kept: %s", error)

    def results(self, sweep_id: str) -> Path:
        """Folder of the results of a sweep."""
        return self._folder / sweep_id / RESULTS

    def _discard(self, sweep_id: str) -> None:
        shutil.rmtree(self.results(sweep_id), ignore_errors=True)

    def _put(self, sweep: PostedSweep) -> PostedSweep:
        """Take over a new state, in memory and if possible on the disk."""
        self._sweeps[sweep.id] = sweep
        try:
            self._write(sweep)
        except OSError as error:  # the next change tries again; a server that starts finds an older state, and goes on
            logger.warning("the state of sweep %s cannot be written: %s", sweep.id, error)
        return sweep

    def _write(self, sweep: PostedSweep) -> None:
        state = {name: getattr(sweep, name) for name in KEPT}
        write_whole(self._folder / sweep.id / STATE, json.dumps(state))


def _read(folder: Path) -> PostedSweep | None:
    """The sweep of a folder, to be walked on where it was under way; None without its state.

    A folder whose state is gone or broken is removed, one that cannot be read is left.
    """
    try:
        state = read_json(folder / STATE)
        sweep = PostedSweep(folder.name, **{name: state[name] for name in KEPT})
        if not isinstance(sweep.source, dict) or not math.isfinite(sweep.created):
            raise ValueError("its state is none")
    except (FileNotFoundError, NotADirectoryError, WalkError, LookupError, TypeError, ValueError) as error:
        logger.warning("the files in %s are no sweep, and are removed: %s", folder, error)
        shutil.rmtree(folder, ignore_errors=True)
        return None
    except OSError as error:  # the next server may be able to
        logger.warning("the sweep in %s cannot be read, and is left as it is: %s", folder, error)
        return None
    if sweep.status == "running":
        return replace(sweep, status="queued", started=None)
    return replace(sweep, nb_done=sweep.nb_cells) if sweep.status == "done" else sweep
