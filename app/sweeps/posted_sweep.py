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
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args
from uuid import uuid4

from app.jobs import Report
from app.sweeps.cells import CellStore, read_json, write_whole
from app.sweeps.engine import SweepProgress, run_sweep, sweep_versions
from app.sweeps.results import write_results
from app.work import Work, WorkStatus, WorkStore, WorkUnavailableError
from walkcore.analysis.sweep import sweep_from_mapping
from walkcore.errors import WalkError

logger = logging.getLogger(__name__)

STATE, RESULTS = "state.json", "results"
KEPT = ("source", "status", "reason", "created", "started", "ended", "size")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PostedSweep(Work):
    """A sweep and the state of its walks."""

    progress: SweepProgress


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


class PostedSweepStore(WorkStore[PostedSweep]):
    """Keeps posted sweeps under a folder that no other server has. All methods may be called from any thread."""

    kind = "sweep"

    def __init__(self, folder: Path) -> None:
        """Read the sweeps of the folder, which is made when there is one to keep.

        Args:
            folder: of all sweeps.
        """
        super().__init__()
        self._folder = folder
        found = filter(None, map(_read, folder.iterdir() if folder.is_dir() else ()))
        self._works = {sweep.id: sweep for sweep in sorted(found, key=lambda sweep: sweep.created)}

    def add(self, source: Mapping[str, Any], nb_cells: int) -> PostedSweep:
        """Take in a sweep, under a new id.

        Raises:
            WorkUnavailableError: if it cannot be written.
        """
        progress = SweepProgress(0, nb_cells, None)
        sweep = PostedSweep(id=uuid4().hex, source=source, created=time.time(), progress=progress)
        with self._lock:
            try:
                (self._folder / sweep.id).mkdir(parents=True)
                self._write(sweep)
            except OSError as error:
                shutil.rmtree(self._folder / sweep.id, ignore_errors=True)
                raise WorkUnavailableError(f"the sweep cannot be kept: {error}") from error
            self._works[sweep.id] = sweep
        return sweep

    def job(self, work_id: str) -> WalkSweep:
        """The job that walks a sweep."""
        return WalkSweep(self.get(work_id).source, self.results(work_id))

    def keep(self, work_id: str, result: None) -> None:
        """Mark a sweep that was under way as done."""
        with self._lock:
            sweep = self._running(work_id)
            if sweep is None:
                self.discard(work_id)
                return
            size = sum(file.stat().st_size for file in self.results(work_id).rglob("*") if file.is_file())
            progress = replace(sweep.progress, nb_done=sweep.progress.nb_cells)
            self._put(replace(sweep, status="done", ended=time.time(), progress=progress, size=size))

    def discard(self, work_id: str) -> None:
        """Throw away the results of a sweep."""
        shutil.rmtree(self.results(work_id), ignore_errors=True)

    def remove(self, work_id: str) -> None:
        """Forget a sweep that has ended, files and all.

        Raises:
            WorkUnavailableError: if its files cannot be removed.
        """
        with self._lock:
            try:
                (self._folder / work_id / STATE).unlink(missing_ok=True)
            except OSError as error:
                raise WorkUnavailableError(f"the sweep cannot be removed: {error}") from error
            shutil.rmtree(self._folder / work_id, ignore_errors=True)
            self._works.pop(work_id, None)

    def results(self, sweep_id: str) -> Path:
        """Folder of the results of a sweep."""
        return self._folder / sweep_id / RESULTS

    def _put(self, work: PostedSweep) -> PostedSweep:
        """Take over a new state, in memory and if possible on the disk."""
        self._works[work.id] = work
        try:
            self._write(work)
        except OSError as error:  # the next change tries again; a server that starts finds an older state, and goes on
            logger.warning("the state of sweep %s cannot be written: %s", work.id, error)
        return work

    def _write(self, sweep: PostedSweep) -> None:
        state = {name: getattr(sweep, name) for name in KEPT} | {"nb_cells": sweep.progress.nb_cells}
        write_whole(self._folder / sweep.id / STATE, json.dumps(state))


def _read(folder: Path) -> PostedSweep | None:
    """The sweep of a folder, to be walked on where it was under way; None without its state.

    A folder whose state is gone or broken is removed, one that cannot be read is left.
    """
    try:
        state = read_json(folder / STATE)
        nb_cells = state["nb_cells"]
        progress = SweepProgress(nb_cells if state["status"] == "done" else 0, nb_cells, None)
        sweep = PostedSweep(id=folder.name, progress=progress, **{name: state[name] for name in KEPT})
        is_one = isinstance(sweep.source, dict) and isinstance(sweep.size, int) and math.isfinite(sweep.created)
        if not is_one or sweep.status not in get_args(WorkStatus):
            raise ValueError("its state is none")
    except (FileNotFoundError, NotADirectoryError, WalkError, LookupError, TypeError, ValueError) as error:
        logger.warning("the files in %s are no sweep, and are removed: %s", folder, error)
        shutil.rmtree(folder, ignore_errors=True)
        return None
    except OSError as error:  # the next server may be able to
        logger.warning("the sweep in %s cannot be read, and is left as it is: %s", folder, error)
        return None
    return replace(sweep, status="queued", started=None) if sweep.status == "running" else sweep
