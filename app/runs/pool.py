"""Threads that wait: each takes the run that has waited longest, and hands it to a worker process."""

import logging
import threading
from collections.abc import Callable

from app.runs.run import Progress, Run
from app.runs.store import RunStore
from app.runs.worker import Simulate, Worker

logger = logging.getLogger(__name__)

IDLE = 30.0  # [s] without work after which a worker process is let go, with its memory


class Pool:
    """As many runs at once as there are workers."""

    def __init__(self, store: RunStore, nb_workers: int, on_end: Callable[[], None]) -> None:
        """Take runs from a store once started, and call `on_end` after each."""
        self._store, self._on_end = store, on_end
        self._wake = threading.Condition()
        self._is_stopping = False
        self._progress: dict[str, Progress] = {}
        self._workers: dict[str, Worker] = {}
        self._threads = [threading.Thread(target=self._serve, name=f"runs {i}", daemon=True) for i in range(nb_workers)]

    def start(self) -> None:
        """Begin with what is queued."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End the processes; what they were at stays `running` in the store, for the next server to tell as failed."""
        with self._wake:
            self._is_stopping = True
            self._wake.notify_all()
            for worker in self._workers.values():
                worker.kill()
        for thread in self._threads:
            if thread.is_alive():
                thread.join()

    def wake(self) -> None:
        """There is something new to do."""
        with self._wake:
            self._wake.notify()

    def cancel(self, run_id: str) -> None:
        """End the process that is at this run, if one is."""
        with self._wake:
            worker = self._workers.get(run_id)
            if worker is not None:
                worker.kill()

    def progress(self, run_id: str) -> Progress | None:
        """How far a run has come that is under way."""
        return self._progress.get(run_id)

    def _serve(self) -> None:
        worker: Worker | None = None
        while (run := self._next(worker)) is not None or not self._is_stopping:
            if run is None:  # nothing to do for a while
                worker = _let_go(worker)
                continue
            if worker is None or not worker.is_alive:
                worker = Worker()
            try:
                self._simulate(run, worker)
            except Exception as error:  # a full disk, above all: the next run may have more luck
                logger.error("run %s could not be kept", run.id, exc_info=error)
                self._store.fail(run.id, f"could not be kept: {error}")
            self._on_end()
        _let_go(worker)

    def _next(self, worker: Worker | None) -> Run | None:
        """Wait for a run; None when the pool stops, or when a worker has been idle for long."""
        with self._wake:
            while not self._is_stopping:
                run = self._store.start_next()
                if run is not None:
                    return run
                if not self._wake.wait(IDLE if worker is not None else None):
                    return None
        return None

    def _simulate(self, run: Run, worker: Worker) -> None:
        with self._wake:
            if self._is_stopping or self._store.get(run.id).has_ended:  # cancelled before the process was known
                return
            self._workers[run.id] = worker
        self._progress[run.id] = Progress()
        try:
            job = Simulate(run.scenario, self._store.unfinished(run.id))
            outcome = worker.run(job, lambda progress: self._progress.update({run.id: progress}))
            if self._is_stopping:
                return
            if outcome.failure:
                self._store.fail(run.id, outcome.failure)
            else:
                self._store.finish(run.id, outcome.real_time_factor)
        finally:
            with self._wake:  # a cancellation under way ends the process before it is at another run
                self._workers.pop(run.id)
            self._progress.pop(run.id)


def _let_go(worker: Worker | None) -> None:
    if worker is not None:
        worker.kill()
