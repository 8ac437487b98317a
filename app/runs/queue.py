"""Threads of the server that have runs simulated, and recordings converted, by processes behind the live walk."""

import logging
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from app.jobs import Job, JobProcess, JobRunner, ProcessDiedError
from app.runs.run import NoRecordingError, RunsUnavailableError
from app.runs.run_jobs import convert
from walkcore import WalkError

logger = logging.getLogger(__name__)

NICENESS = 15  # of 19: what is left of the processor
IDLE_TIMEOUT = 30.0  # [s] without work after which a process is ended, for its memory
MAX_CONVERSIONS = 8  # threads of the server's that may wait for one
RETRY_PERIOD = 1.0  # [s] after which a disk that took nothing is tried again


class QueuedWork(Protocol):
    """A run, or other work of a queue."""

    @property
    def id(self) -> str:
        """Id of the work."""
        ...

    @property
    def has_ended(self) -> bool:
        """Whether nothing more will change."""
        ...


class WorkStore(Protocol):
    """Keeper of the work of a queue: `RunStore`, or one of other work."""

    def get(self, run_id: str, /) -> QueuedWork:
        """The work of an id."""
        ...

    def start_next(self) -> QueuedWork | None:
        """The work that has waited longest, from now on running; None without."""
        ...

    def has_work(self) -> bool:
        """Whether something waits."""
        ...

    def fail(self, run_id: str, reason: str, /) -> None:
        """Mark work that was under way as failed."""
        ...

    def job(self, run_id: str, /) -> Job[Any]:
        """The job that does the work."""
        ...

    def keep(self, run_id: str, result: Any, /) -> object:
        """Keep the result of the job."""
        ...


class RunQueue:
    """Takes the run, or the other work of a store, that has waited longest whenever one of its processes is free."""

    def __init__(self, store: WorkStore, nb_processes: int, on_end: Callable[[], None]) -> None:
        """Start nothing yet.

        Args:
            store: of the runs.
            nb_processes: runs that are simulated at once.
            on_end: called after each run.
        """
        self._store, self._on_end = store, on_end
        self._wake = threading.Condition()
        self._is_stopping = False
        self._progress: dict[str, Any] = {}
        self._processes: dict[str, JobProcess] = {}
        self._threads = [
            threading.Thread(target=self._serve, name=f"runs {i}", daemon=True) for i in range(nb_processes)
        ]

    def start(self) -> None:
        """Begin with the queued runs."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End the processes; their runs stay `running` in the store, and the next server reports them as failed."""
        with self._wake:
            self._is_stopping = True
            self._wake.notify_all()
            for process in self._processes.values():
                process.kill()
        for thread in self._threads:
            if thread.is_alive():
                thread.join()

    def wake(self) -> None:
        """Look for a queued run."""
        with self._wake:
            self._wake.notify()

    def cancel(self, run_id: str) -> None:
        """End the process that simulates a run, if one does."""
        with self._wake:
            process = self._processes.get(run_id)
            if process is not None:
                process.kill()

    def progress(self, run_id: str) -> Any:
        """The progress that the job of a run reported last; None before that, and where it is not under way."""
        return self._progress.get(run_id)

    def _serve(self) -> None:
        process: JobProcess | None = None
        while (run := self._next(process)) is not None or not self._is_stopping:
            if process is not None and (run is None or not process.is_alive):
                process.kill()
                process = None
            if run is None:  # nothing to do for a while
                continue
            try:
                process = process or JobProcess(NICENESS)
                self._simulate(run, process)
            except Exception as error:  # no process, a full disk, files that are gone: the next run may have more luck
                logger.warning("run %s could not be kept: %r", run.id, error)
                self._store.fail(run.id, f"could not be kept: {error}")
            self._on_end()
        if process is not None:
            process.kill()

    def _next(self, process: JobProcess | None) -> QueuedWork | None:
        """Wait for a run; None when the queue stops, or when a process has been idle for long."""
        with self._wake:
            while not self._is_stopping:
                run = self._store.start_next()
                if run is not None:
                    return run
                is_blocked = self._store.has_work()  # by the disk, which may have space in a while
                is_idle = process is not None and not is_blocked
                # It looks without anything to do, too: of a run that the disk did not take nobody tells it.
                if not self._wake.wait(IDLE_TIMEOUT if is_idle else RETRY_PERIOD) and is_idle:
                    return None
        return None

    def _simulate(self, run: QueuedWork, process: JobProcess) -> None:
        with self._wake:
            if self._is_stopping or self._store.get(run.id).has_ended:  # cancelled before the process was known
                return
            self._processes[run.id] = process
        try:
            job = self._store.job(run.id)
            done = process.run(job, lambda progress: self._progress.update({run.id: progress}))
            if self._is_stopping:
                return
            if (error := done.exception()) is not None:
                self._store.fail(run.id, _reason(error))
            else:
                self._store.keep(run.id, done.result())
        finally:
            with self._wake:  # a cancellation under way ends the process before it is at another run
                self._processes.pop(run.id)
            self._progress.pop(run.id, None)


class Converter:
    """Writes recordings in further formats, one at a time. May be called from any thread, which waits."""

    def __init__(self) -> None:
        """Start no process yet."""
        self._turn = threading.Lock()
        self._places = threading.Semaphore(MAX_CONVERSIONS)
        self._runner = JobRunner(NICENESS)

    def make(self, folder: Path, ending: str, file: str) -> None:
        """See that the folder of a run holds its recording in a format.

        Args:
            folder: of the run.
            ending: of the format.
            file: name of the recording in that format.

        Raises:
            NoRecordingError: if it cannot be made.
            RunsUnavailableError: if too many others wait.
        """
        if not self._places.acquire(blocking=False):
            raise RunsUnavailableError(f"{MAX_CONVERSIONS} files are being made already")
        try:
            with self._turn:
                if not (folder / file).is_file() and not self._runner.is_stopping:
                    self._make(folder, ending)
        finally:
            self._places.release()

    def stop(self) -> None:
        """End the process, if there is one."""
        self._runner.stop()

    def _make(self, folder: Path, ending: str) -> None:
        """Convert in a process that ends with it: drawing and packing take memory, and are seldom requested."""
        try:
            error = self._runner.run(partial(convert, folder, ending)).exception()
        except OSError as error:
            raise RunsUnavailableError(f"no process can be started: {error}") from error
        if error is not None:
            raise NoRecordingError(f"the recording cannot be written as {ending}: {_reason(error)}") from error


def _reason(error: BaseException) -> str:
    """Why a job failed, for a person."""
    is_foreseen = isinstance(error, WalkError | ProcessDiedError)
    return str(error) if is_foreseen else f"{type(error).__name__}: {error}"
