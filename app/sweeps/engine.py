"""Cells handed to the workers of joblib: all cores of this machine, or a cluster of Dask by the same call.

A task is a range of cells. The first tasks are one cell each; what they took says how many make a task of some tens of
seconds, and towards the end tasks get small again, so that no worker waits long for the last. Outcomes do not depend on
how cells are cut into tasks, nor on the number or the order of the workers.
"""

import json
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import pairwise
from threading import Lock, Thread
from typing import Any, cast

import joblib
import numpy as np

from app.settings import usable_cores
from app.sweeps.cells import CellStore
from walkcore.analysis.cell_outcome import CellOutcome, cell_bound, nominal_walk, outcome
from walkcore.analysis.sweep import Sweep, sweep_from_mapping
from walkcore.command import Push
from walkcore.errors import InvalidValueError
from walkcore.scenario.recording import package_versions
from walkcore.values import Vector

TASK = 20.0
"""Time that a task is to take [s]: long against what it costs to hand it over, short against what a kill loses."""
TASKS_WAITING = 2  # for each worker, so that none waits for the next one
CONNECTION_TIMEOUT = 10.0  # [s] for a scheduler to answer
PARENT_PERIOD = 0.5  # [s] between two looks whether the parent is still there
BOUNDED_PHASES = 4  # phases for which the bound is computed
PROBED_WALKS = 3  # walks whose trials are timed for an estimate


@dataclass(frozen=True, slots=True)
class SweepProgress:
    """The progress of a sweep that is under way."""

    nb_done: int
    """Cells that are finished, those of earlier attempts included."""
    nb_cells: int
    time_left: float | None
    """Estimated time that is left [s]; None before it is known."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """Expected cost of a sweep."""

    nb_cells: int
    nb_trials: int
    """Simulated pushes, islands not counted."""
    seconds: float
    """Processor time [s]."""


def sweep_versions(sweep: Sweep) -> dict[str, str]:
    """Versions of the packages that decide the outcomes of a sweep."""
    plants = {walk.parameters.plant for walk in sweep.walks}
    return package_versions("ideal" if plants == {"ideal"} else "mujoco")


def run_sweep(
    sweep: Sweep,
    store: CellStore,
    nb_workers: int | None = None,
    scheduler: str | None = None,
    on_progress: Callable[[SweepProgress], None] = lambda _: None,
) -> None:
    """Walk all cells that are not finished yet, and keep each outcome as it comes.

    Args:
        sweep: to be walked.
        store: for the outcomes.
        nb_workers: processes on this machine; by default one for each core, or all that the scheduler has.
        scheduler: address of a Dask scheduler, such as tcp://host:8786; None for this machine.
        on_progress: called after each task.

    Raises:
        InvalidValueError: if there is no such scheduler, or a worker has other versions.
    """
    missing, started = store.missing, time.monotonic()
    nb_before = sweep.nb_cells - len(missing)
    on_progress(SweepProgress(nb_before, sweep.nb_cells, None))
    if not missing:
        return
    with _workers(nb_workers, scheduler) as nb_parallel:
        tasks = _Tasks(missing, nb_parallel)
        source, versions = json.dumps(sweep.source), sweep_versions(sweep)
        options: dict[str, Any] = {"pre_dispatch": TASKS_WAITING * nb_parallel, "batch_size": 1}
        parallel = joblib.Parallel(n_jobs=nb_parallel, return_as="generator_unordered", **options)
        calls = (joblib.delayed(walk_cells)(source, versions, first, nb, os.getpid()) for first, nb in tasks)
        for done in cast(Iterator[CellsDone], parallel(calls)):
            store.add(done.first, done.outcomes)
            tasks.learn(len(done.outcomes), done.seconds)
            nb_new = len(store.outcomes) - nb_before
            time_left = (len(missing) - nb_new) * (time.monotonic() - started) / nb_new
            on_progress(SweepProgress(len(store.outcomes), sweep.nb_cells, time_left))


class _Tasks:
    """Ranges of missing cells, each as large as is right when it is asked for. Iterated and taught by two threads."""

    def __init__(self, missing: list[int], nb_workers: int) -> None:
        self._missing, self._nb_workers = missing, nb_workers
        self._nb_measured, self._seconds = 0, 0.0
        self._lock = Lock()

    def learn(self, nb_cells: int, seconds: float) -> None:
        """Take note of what so many cells took [s]."""
        with self._lock:
            self._nb_measured += nb_cells
            self._seconds += seconds

    def __iter__(self) -> Iterator[tuple[int, int]]:
        """First cell and number of cells of each task."""
        at = 0
        while at < len(self._missing):
            nb = _run_length(self._missing, at, self._size(len(self._missing) - at))
            yield self._missing[at], nb
            at += nb

    def _size(self, nb_left: int) -> int:
        with self._lock:
            if not self._nb_measured:
                return 1
            right = TASK * self._nb_measured / max(self._seconds, 1e-9)
        fair = nb_left / (TASKS_WAITING * self._nb_workers)
        return max(1, int(min(right, fair)))


def _run_length(missing: list[int], at: int, most: int) -> int:
    """Number of missing cells that follow each other without a gap, at most so many."""
    run = missing[at : at + most]
    gap = next((k for k, (one, other) in enumerate(pairwise(run), 1) if other != one + 1), len(run))
    return gap


@contextmanager
def _workers(nb_workers: int | None, scheduler: str | None) -> Iterator[int]:
    """The workers that joblib takes inside of this context, and their number."""
    if scheduler is None:
        nb = nb_workers or usable_cores()
        with joblib.parallel_config(backend="loky", n_jobs=nb):
            yield nb
        return
    try:
        from distributed import Client  # the extra `cluster`
    except ImportError as error:
        raise InvalidValueError("scheduler", scheduler, "needs Dask: pip install 'walk[cluster]'") from error
    try:
        client = Client(scheduler, timeout=CONNECTION_TIMEOUT)
    except (OSError, ValueError) as error:
        raise InvalidValueError("scheduler", scheduler, f"no Dask scheduler answers there: {error}") from error
    with client:
        client.wait_for_workers(1)
        nb = sum(cast(dict[str, int], client.nthreads()).values())
        with joblib.parallel_config(backend="dask", n_jobs=nb_workers or nb):
            yield nb_workers or nb


@dataclass(frozen=True, slots=True)
class CellsDone:
    """Outcomes of a task."""

    first: int
    """Number of the first cell."""
    outcomes: tuple[CellOutcome, ...]
    seconds: float
    """Time that they took [s]."""


ONE_AT_A_TIME = Lock()  # a worker of Dask may have several threads, and they share the nominal walks


def walk_cells(source: str, versions: Mapping[str, str], first: int, nb: int, asker: int) -> CellsDone:
    """A task: walk cells that follow each other.

    Args:
        source: of the sweep, as JSON.
        versions: of the packages that whoever asks has.
        first: number of the first cell.
        nb: number of cells.
        asker: id of the process that asks; a process that it has started ends with it.

    Raises:
        InvalidValueError: if this worker has other versions.
    """
    if os.getppid() == asker:
        _end_with(asker)
    sweep = _sweep(source)
    if (here := sweep_versions(sweep)) != versions:
        other = {name: here.get(name) for name in {*here, *versions} if here.get(name) != versions.get(name)}
        raise InvalidValueError("versions of a worker", other, f"must be those of {dict(versions)}")
    started, outcomes = time.monotonic(), list[CellOutcome]()
    with ONE_AT_A_TIME:
        for index in range(first, first + nb):
            outcomes.append(outcome(sweep, sweep.cell(index)))
    return CellsDone(first, tuple(outcomes), time.monotonic() - started)


def lowest_bounds(sweep: Sweep, nb_workers: int | None = None, scheduler: str | None = None) -> list[Vector]:
    """For each walk, by direction, the impulse that no controller of `push_bound` survives in the worst phase [N s].

    Of the phases at most four are looked at, evenly spaced.

    Args:
        sweep: whose walks they are.
        nb_workers: as of `run_sweep`.
        scheduler: as of `run_sweep`.
    """
    nb_phases, nb_directions = sweep.pushes.phases, sweep.pushes.directions
    phases = range(0, nb_phases, max(1, nb_phases // BOUNDED_PHASES))
    source = json.dumps(sweep.source)
    calls = (
        joblib.delayed(_lowest_bound)(source, [first + phase for phase in phases])
        for first in range(0, sweep.nb_cells, nb_phases)
    )
    with _workers(nb_workers, scheduler) as nb_parallel:
        found = cast(list[float], joblib.Parallel(n_jobs=nb_parallel)(calls))
    return list(np.reshape(found, (len(sweep.walks), nb_directions)))


def _lowest_bound(source: str, cells: list[int]) -> float:
    with ONE_AT_A_TIME:
        return min(cell_bound(_sweep(source), _sweep(source).cell(index)) for index in cells)


@cache
def _end_with(parent: int) -> None:
    """End this process when its parent is gone: the workers of joblib would wait for five minutes for more to do."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_PERIOD)
        os._exit(1)

    Thread(target=watch, daemon=True).start()


@lru_cache(maxsize=4)
def _sweep(source: str) -> Sweep:
    return sweep_from_mapping(json.loads(source))


def estimate(sweep: Sweep) -> Estimate:
    """Expected cost of a sweep, from trials of some of its walks, which are timed in this process."""
    walks = np.unique(np.linspace(0, len(sweep.walks) - 1, PROBED_WALKS).astype(int)).tolist()
    seconds = float(np.mean([_seconds_per_trial(sweep, walk) for walk in walks])) * sweep.nb_trials * sweep.nb_cells
    return Estimate(sweep.nb_cells, sweep.nb_trials * sweep.nb_cells, seconds)


def _seconds_per_trial(sweep: Sweep, number: int) -> float:
    """Mean processor time of a hard push and a soft one, straight ahead [s]."""
    walk, scan = nominal_walk(sweep, number), sweep.pushes.scan
    if walk.has_fallen:
        return 0.0
    started = time.process_time()
    for impulse in (scan.max_impulse / 4, scan.max_impulse):
        walk.survives(0.0, Push(np.array([0.0, impulse]), sweep.pushes.duration))
    return (time.process_time() - started) / 2
