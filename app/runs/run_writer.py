"""Walks that become runs without being simulated, each written by a process of its own, one at a time.

What such a run is made of has tens of megabytes. It goes to a file as it comes, and the process reads it from there:
the server never holds it, neither for its own memory's sake nor for the time of its other threads.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

from app.jobs import Job, JobRunner, ProcessDiedError
from app.runs.run import Run, RunsUnavailableError
from app.runs.run_jobs import WrittenRun
from app.runs.store import RunStore

NICENESS = 5  # of 19: a person waits for it, but the live walk goes before


class RunWriter:
    """Takes in runs that jobs write. May be called from any thread, which waits."""

    def __init__(self, store: RunStore, nb_places: int, what: str) -> None:
        """Start no process yet.

        Args:
            store: keeps the runs.
            nb_places: runs that may be under way: each has its files.
            what: is under way, for refusals.
        """
        self._store, self._nb_places, self._what = store, nb_places, what
        self._places = threading.Semaphore(nb_places)
        self._turn = threading.Lock()
        self._runner = JobRunner(NICENESS)

    @contextmanager
    def place(self) -> Iterator[None]:
        """Take one of the few places, before anything is begun.

        Raises:
            RunsUnavailableError: if there is none.
        """
        if not self._places.acquire(blocking=False):
            raise RunsUnavailableError(f"{self._nb_places} {self._what} already")
        try:
            yield
        finally:
            self._places.release()

    @contextmanager
    def draft(self) -> Iterator[Path]:
        """An empty folder for a run's files, which is thrown away at the end unless the run was kept.

        Raises:
            RunsUnavailableError: if the disk does not take what is written into it.
        """
        draft_id = uuid4().hex
        try:
            yield self._store.unfinished(draft_id)
        except OSError as error:
            raise RunsUnavailableError(f"the walk cannot be kept: {error}") from error
        finally:
            self._store.discard(draft_id)

    def keep(self, draft: Path, job: Job[WrittenRun]) -> Run:
        """Do the job that writes a run into its draft, and take it in as a run that is done.

        Args:
            draft: folder of `draft`; whatever else lies in it has to be removed by the job.
            job: writes run.json and a recording there.

        Raises:
            RunsUnavailableError: if the server stops, or the disk does not take the files.
            ProcessDiedError: if the job ended its process.
        """
        run = None
        try:
            with self._turn:
                written = self._runner.run(job).result()
            run = self._store.add(written.scenario, written.robot, written.duration, status="running")
            draft.replace(self._store.unfinished(run.id))  # which is empty
            self._store.finish(run.id, None)
            return self._store.get(run.id)
        except ProcessDiedError:
            if self._runner.is_stopping:
                raise RunsUnavailableError("the server stops") from None
            raise
        except OSError as error:
            if run is not None:  # in the list already
                self._store.fail(run.id, f"could not be kept: {error}")
            raise RunsUnavailableError(f"the walk cannot be kept: {error}") from error

    def stop(self) -> None:
        """End the process, if there is one."""
        self._runner.stop()
