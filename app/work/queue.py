"""The queue of all work of one kind: for the routes, and for the processes behind the live walk that do the work."""

import logging
import math
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Generic

from app.jobs import JobProcess, ProcessDiedError
from app.work.store import AnyWork, WorkStore
from app.work.work import WorkUnavailableError
from walkcore import WalkError

logger = logging.getLogger(__name__)

NICENESS = 15  # of 19: what is left of the processor
IDLE_TIMEOUT = 30.0  # [s] without work after which a process is ended, for its memory
RETRY_PERIOD = 1.0  # [s] after which a disk that took nothing is tried again


class WorkQueue(Generic[AnyWork]):
    """Takes the work of a store that has waited longest whenever one of its processes is free.

    All methods may be called from any thread.
    """

    def __init__(
        self, store: WorkStore[AnyWork], nb_processes: int, nb_queued: int, nb_kept: int, bytes_kept: int | None = None
    ) -> None:
        """Start nothing yet.

        Args:
            store: of the work.
            nb_processes: pieces of work that are done at once.
            nb_queued: pieces of work that may wait.
            nb_kept: ended ones that are kept; the oldest go first.
            bytes_kept: size of all files that are kept; None for any. The oldest go first, the latest never.
        """
        self._store, self._nb_queued, self._nb_kept = store, nb_queued, nb_kept
        self._bytes_kept = math.inf if bytes_kept is None else bytes_kept
        self._admission = threading.Lock()
        self._wake = threading.Condition()
        self._is_stopping = False
        self._progress: dict[str, Any] = {}
        self._processes: dict[str, JobProcess] = {}
        self._threads = [
            threading.Thread(target=self._serve, name=f"{store.kind}s {i}", daemon=True) for i in range(nb_processes)
        ]

    def start(self) -> None:
        """Begin with what is queued."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End the processes; their work stays `running` in the store, and the next server says what becomes of it."""
        with self._wake:
            self._is_stopping = True
            self._wake.notify_all()
            for process in self._processes.values():
                process.kill()
        for thread in self._threads:
            if thread.is_alive():
                thread.join()

    def get(self, work_id: str) -> AnyWork:
        """The present state of some work.

        Raises:
            UnknownWorkError: if there is none of that id.
        """
        return self._with_progress(self._store.get(work_id))

    def list(self) -> list[AnyWork]:
        """All work, the latest first."""
        return [self._with_progress(work) for work in self._store.list()]

    def delete(self, work_id: str) -> AnyWork:
        """Cancel work that has not ended, its process included; remove work that has.

        Returns:
            The work as it was: what had not ended is kept, as cancelled.

        Raises:
            UnknownWorkError: if there is none of that id.
            WorkUnavailableError: if its files cannot be removed.
        """
        work = self._store.get(work_id)
        if self._store.cancel(work_id):
            with self._wake:
                process = self._processes.get(work_id)
                if process is not None:
                    process.kill()
        else:
            self._store.remove(work_id)
            self._wake_one()  # there is space
        return work

    def _take_in(self, add: Callable[[], AnyWork]) -> AnyWork:
        """Add work that was sent, to be done when a process is free.

        Args:
            add: adds it to the store.

        Raises:
            WorkUnavailableError: if too much waits already, or the disk takes no more.
        """
        with self._admission:
            if self._store.nb_queued() >= self._nb_queued:
                raise WorkUnavailableError(f"{self._nb_queued} {self._store.kind}s wait already")
            try:
                return add()
            finally:
                self._wake_one()  # to begin with it, or to try the disk again that did not take it

    def _trim(self) -> None:
        self._store.trim(self._nb_kept, self._bytes_kept)

    def _wake_one(self) -> None:
        """Wake a thread that waits for work."""
        with self._wake:
            self._wake.notify()

    def _with_progress(self, work: AnyWork) -> AnyWork:
        progress = self._progress.get(work.id) if work.status == "running" else None
        return work if progress is None else replace(work, progress=progress)

    def _serve(self) -> None:
        process: JobProcess | None = None
        while (work := self._next(process)) is not None or not self._is_stopping:
            if process is not None and (work is None or not process.is_alive):
                process.kill()
                process = None
            if work is None:  # nothing to do for a while
                continue
            try:
                process = process or JobProcess(NICENESS)
                self._do(work, process)
            except Exception as error:  # no process, a full disk, files that are gone: the next may have more luck
                logger.warning("%s %s could not be kept: %r", self._store.kind, work.id, error)
                self._store.fail(work.id, f"could not be kept: {error}")
            self._trim()
        if process is not None:
            process.kill()

    def _next(self, process: JobProcess | None) -> AnyWork | None:
        """Wait for work; None when the queue stops, or when a process has been idle for long."""
        with self._wake:
            while not self._is_stopping:
                work = self._store.start_next()
                if work is not None:
                    return work
                is_blocked = self._store.has_work()  # by the disk, which may have space in a while
                is_idle = process is not None and not is_blocked
                # It looks without anything to do, too: of work that the disk did not take nobody tells it.
                if not self._wake.wait(IDLE_TIMEOUT if is_idle else RETRY_PERIOD) and is_idle:
                    return None
        return None

    def _do(self, work: AnyWork, process: JobProcess) -> None:
        with self._wake:
            if self._is_stopping:
                return
            if self._store.get(work.id).has_ended:  # cancelled before the process was known
                self._store.discard(work.id)
                return
            self._processes[work.id] = process
        try:
            job = self._store.job(work.id)
            done = process.run(job, lambda progress: self._progress.update({work.id: progress}))
            if self._is_stopping:
                return
            if (error := done.exception()) is not None:
                self._store.fail(work.id, failure(error))
            else:
                self._store.keep(work.id, done.result())
        finally:
            with self._wake:  # a cancellation under way ends the process before it is at other work
                self._processes.pop(work.id)
            self._progress.pop(work.id, None)


def failure(error: BaseException) -> str:
    """Why a job failed, for a person."""
    is_foreseen = isinstance(error, WalkError | ProcessDiedError)
    return str(error) if is_foreseen else f"{type(error).__name__}: {error}"
