"""Jobs that a request waits for: a few may wait, and one is done at a time, in a process that ends with it."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from app.jobs import Job, JobRunner, ProcessDiedError, Result
from app.work.work import WorkUnavailableError

FOR_A_PERSON = 5  # of 19: the niceness of what a person waits for; the live walk goes before


class AwaitedJobs:
    """Does jobs, each when those before it have ended. May be called from any thread, which waits."""

    def __init__(self, nb_places: int, refusal: str, niceness: int = FOR_A_PERSON) -> None:
        """Start no process yet.

        Args:
            nb_places: jobs that may be under way or wait.
            refusal: why there may be no further one.
            niceness: of the processes, as of `JobProcess`.
        """
        self._refusal = refusal
        self._places = threading.Semaphore(nb_places)
        self.turn = threading.RLock()
        """Held while a job is done; whoever holds it has the next turn."""
        self._runner = JobRunner(niceness)

    @contextmanager
    def place(self) -> Iterator[None]:
        """Take one of the few places, before anything is begun.

        Raises:
            WorkUnavailableError: if there is none.
        """
        if not self._places.acquire(blocking=False):
            raise WorkUnavailableError(self._refusal)
        try:
            yield
        finally:
            self._places.release()

    def run(self, job: Job[Result]) -> Result:
        """Do a job, and return its result.

        Raises:
            WorkUnavailableError: if the server stops, or no process can be started.
            ProcessDiedError: if the job ended its process.
        """
        with self.turn:
            try:
                done = self._runner.run(job)
            except OSError as error:
                raise WorkUnavailableError(f"no process can be started: {error}") from error
        if isinstance(done.exception(), ProcessDiedError) and self._runner.is_stopping:
            raise WorkUnavailableError("the server stops")
        return done.result()

    def stop(self) -> None:
        """End the process, if there is one."""
        self._runner.stop()
