"""Several scenarios at once, each in a process of its own, on all cores."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from multiprocessing.queues import Queue
from pathlib import Path
from queue import Empty
from threading import Event, Thread
from typing import Any

from tqdm import tqdm

from app.formats import write_run
from walkcore import WalkError, load_scenario, record
from walkcore.scenario.expectations import Verdict

_done: "Queue[float]"  # of a worker process, set when it starts


@dataclass(frozen=True, slots=True)
class Job:
    """One scenario to be simulated."""

    source: str
    """Name of a scenario that ships, or a file."""
    folder: Path
    """Where its run is written."""
    formats: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a job."""

    job: Job
    name: str
    """Of the scenario."""
    robot: str
    nb_ticks: int
    simulated: float
    """[s]."""
    elapsed: float
    """Of simulation, without the files [s]."""
    reason: str
    """Why the robot fell, if it did."""
    verdicts: tuple[Verdict, ...]
    error: str = ""
    """Why there is no run, where there is none."""

    @property
    def is_as_expected(self) -> bool:
        """Whether every expectation holds."""
        return not self.error and all(verdict.holds for verdict in self.verdicts)


def simulate(jobs: Sequence[Job], nb_workers: int, shows_progress: bool) -> Iterator[Outcome]:
    """Simulate jobs and write their runs, with a progress bar on stderr; outcomes come as they are ready.

    Args:
        jobs: whose scenarios can be read.
        nb_workers: processes; with one job or one worker all happens in this process.
        shows_progress: whether there is a bar.

    Raises:
        OSError: if a process is killed, or a file cannot be written.
    """
    total = sum(load_scenario(job.source).duration for job in jobs)
    with tqdm(total=total, unit="s", desc="simulated", disable=not shows_progress, bar_format=BAR) as bar:
        if min(nb_workers, len(jobs)) == 1:
            yield from (run(job, bar.update) for job in jobs)
        else:
            yield from _in_processes(jobs, nb_workers, bar)


BAR = "{l_bar}{bar}| {n:.0f}/{total:.0f} s [{elapsed}<{remaining}]"


def _in_processes(jobs: Sequence[Job], nb_workers: int, bar: "tqdm[Any]") -> Iterator[Outcome]:
    context = get_context("spawn")
    done: Queue[float] = context.Queue()
    stopping = Event()
    listener = Thread(target=_listen, args=(done, stopping, bar), daemon=True)
    listener.start()
    pool = ProcessPoolExecutor(min(nb_workers, len(jobs)), context, _start_worker, (done,))
    try:
        yield from (future.result() for future in as_completed([pool.submit(_work, job) for job in jobs]))
    except BrokenProcessPool as error:
        raise ChildProcessError("a simulating process was killed; scenarios not told above have no run") from error
    finally:
        pool.shutdown(cancel_futures=True)
        stopping.set()
        listener.join()


def _listen(done: "Queue[float]", stopping: Event, bar: "tqdm[Any]") -> None:
    while not stopping.is_set():
        try:
            bar.update(done.get(timeout=0.1))
        except Empty:
            continue


def _start_worker(done: "Queue[float]") -> None:
    global _done
    _done = done
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Leave no process behind when the one that wants the result is gone."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _work(job: Job) -> Outcome:
    return run(job, _done.put)


def run(job: Job, tell: Callable[[float], object]) -> Outcome:
    """Simulate a job and write its run.

    Args:
        job: whose scenario can be read.
        tell: called with the seconds simulated since the last call.
    """
    scenario = load_scenario(job.source)
    told = 0.0

    def progress(fraction: float) -> None:
        nonlocal told
        tell((fraction - told) * scenario.duration)
        told = fraction

    started = time.perf_counter()
    try:
        recording = record(scenario, progress)
    except WalkError as error:
        return Outcome(job, scenario.name, scenario.robot.name, 0, 0.0, 0.0, "", (), str(error))
    elapsed = time.perf_counter() - started
    write_run(recording, job.folder, job.formats)
    return Outcome(
        job=job,
        name=scenario.name,
        robot=scenario.robot.name,
        nb_ticks=scenario.nb_ticks,
        simulated=scenario.duration,
        elapsed=elapsed,
        reason=recording.reason,
        verdicts=tuple(recording.verdicts()),
    )
