"""Jobs in processes of their own, which report their progress and can be killed while they run.

A job is a value that can be pickled and called. Its process is spawned, shares nothing but a pipe with
the one that started it, and ends with it, however that ends.

Pools of concurrent.futures, loky and pebble were tried: of none do the workers end when their parent is killed, none
reports progress, and only pebble can kill a single job. A lock or a queue that several workers share, as one would
need for progress, stays locked when one of them is killed while it holds it; so each process has a pipe of its own.
"""

import multiprocessing
import os
import pickle
import signal
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection, wait
from threading import Lock, Thread
from typing import Any, TypeVar

EXIT_TIMEOUT = 10.0  # [s] a killed process may take to be gone

Result = TypeVar("Result")
Report = Callable[[Any], None]
"""Reports the progress of a job, by a value that can be pickled."""
Job = Callable[[Report], Result]
"""A piece of work; the value itself and its result can be pickled."""


class ProcessDiedError(ChildProcessError):
    """The process of a job ended before the job did."""


@dataclass(frozen=True, slots=True, eq=False)
class JobProgress:
    """Message of a process: its job has come so far."""

    value: Any


@dataclass(frozen=True, slots=True, eq=False)
class JobOutcome:
    """Message of a process: its job has returned a result, or raised an error."""

    result: Any = None
    error: Exception | None = None

    def future(self) -> Future[Any]:
        """The outcome as a future that is done."""
        future: Future[Any] = Future()
        if self.error is not None:
            future.set_exception(self.error)
        else:
            future.set_result(self.result)
        return future


class JobProcess:
    """A process that does one job after the other. Belongs to one thread, but any may kill it."""

    def __init__(self, niceness: int = 0) -> None:
        """Start the process.

        Args:
            niceness: added to that of this process, up to 19; what goes before other processes counts as 0.
        """
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        """Becomes readable when `receive` has something to return."""
        absolute = max(0, os.getpriority(os.PRIO_PROCESS, 0)) + niceness
        self._process = context.Process(target=_work, args=(theirs, absolute), name="walk job", daemon=True)
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # Ctrl-C is for this process, which kills that
        try:
            self._process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        theirs.close()  # so that the end of the process is the end of the pipe

    @property
    def is_alive(self) -> bool:
        """Whether the process can take another job."""
        return self._process.is_alive()

    def run(self, job: Job[Result], on_progress: Report = lambda _: None) -> Future[Result]:
        """Do a job and wait for its end.

        Args:
            job: to do in the process.
            on_progress: called with the progress that the job reports.

        Returns:
            Its future, which is done; failed with what the job raised, or with `ProcessDiedError`.
        """
        self.start(job)
        while isinstance(message := self.receive(), JobProgress):
            on_progress(message.value)
        return message.future()

    def start(self, job: Job[Any]) -> None:
        """Begin a job; `receive` returns its progress and its outcome."""
        with suppress(OSError):  # the process is gone: `receive` finds out
            self.connection.send(job)

    def receive(self) -> JobProgress | JobOutcome:
        """The next message about the job, waited for."""
        try:
            return self.connection.recv()
        except (EOFError, OSError):
            return JobOutcome(error=ProcessDiedError(f"its process ended with exit code {self._wait_for_exit()}"))

    def kill(self) -> None:
        """End the process at once, and whatever it was doing."""
        self._process.kill()
        self._wait_for_exit()

    def _wait_for_exit(self) -> int | None:
        """The exit code, waited for; None if the process does not end.

        Of two threads that wait for a process at the same time, the operating system tells one how it ended and the
        other that there is no such process. The other asks again, until the first has noted the exit code.
        """
        deadline = time.monotonic() + EXIT_TIMEOUT
        while (exit_code := self._process.exitcode) is None and (left := deadline - time.monotonic()) > 0:
            self._process.join(left)
        return exit_code


class JobRunner:
    """Does one job after the other in a process that is there while it is needed. Belongs to one thread at a time."""

    def __init__(self, niceness: int = 0) -> None:
        """Start no process yet.

        Args:
            niceness: as of `JobProcess`.
        """
        self._niceness, self._guard = niceness, Lock()
        self._process: JobProcess | None = None
        self.is_stopping = False
        """Whether no job is done any more."""

    def run(self, job: Job[Result]) -> Future[Result]:
        """Do a job in a process that ends with it; otherwise as `run_and_keep`."""
        try:
            return self.run_and_keep(job)
        finally:
            self.end_process()

    def run_and_keep(self, job: Job[Result]) -> Future[Result]:
        """Do a job in a process that is kept for the next one, and wait for its end.

        Returns:
            Its future, as of `JobProcess.run`; failed with `ProcessDiedError` after `stop`, too.

        Raises:
            OSError: if no process can be started.
        """
        with self._guard:
            if self.is_stopping:
                return JobOutcome(error=ProcessDiedError("no process is started any more")).future()
            if self._process is None or not self._process.is_alive:
                self._process = JobProcess(self._niceness)
            process = self._process
        return process.run(job)

    def end_process(self) -> None:
        """End the process, if there is one, and the job that it does."""
        with self._guard:
            process, self._process = self._process, None
        if process is not None:
            process.kill()

    def stop(self) -> None:
        """End the job under way, if there is one, and do no other. Any thread may call it."""
        with self._guard:
            self.is_stopping = True
        self.end_process()


class JobPool:
    """Several processes that share the jobs of one owner. A context, at whose end all of them are killed."""

    def __init__(self, nb_processes: int) -> None:
        """Start no process yet.

        Args:
            nb_processes: jobs that are done at once; a single one at a time is done in this process.
        """
        self._nb_processes = nb_processes
        self._processes: list[JobProcess] = []
        self._idle: list[JobProcess] = []

    def __enter__(self) -> "JobPool":
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            process.kill()

    def run(
        self, jobs: Sequence[Job[Result]], on_progress: Callable[[int, Any], None] = lambda _, __: None
    ) -> Iterator[tuple[int, Future[Result]]]:
        """Do jobs, beginning with the first.

        Args:
            jobs: to do.
            on_progress: called with the index of a job and the progress that it reports.

        Yields:
            The index of each job that has ended, and its future, which is done, in the order in which they end.
        """
        if min(self._nb_processes, len(jobs)) == 1:
            yield from ((index, _do(job, partial(on_progress, index)).future()) for index, job in enumerate(jobs))
            return
        waiting, under_way = deque(enumerate(jobs)), dict[Any, tuple[int, JobProcess]]()
        while waiting or under_way:
            while waiting and len(under_way) < self._nb_processes:
                (index, job), process = waiting.popleft(), self._idle_process()
                process.start(job)
                under_way[process.connection] = index, process
            for connection in wait(list(under_way)):
                index, process = under_way[connection]
                message = process.receive()
                if isinstance(message, JobProgress):
                    on_progress(index, message.value)
                else:
                    del under_way[connection]
                    self._idle.append(process)
                    yield index, message.future()

    def _idle_process(self) -> JobProcess:
        while self._idle:
            if (process := self._idle.pop()).is_alive:
                return process
        self._processes.append(JobProcess())
        return self._processes[-1]


def _do(job: Job[Any], report: Report) -> JobOutcome:
    try:
        return JobOutcome(job(report))
    except Exception as error:
        error.add_note(traceback.format_exc())  # which does not cross processes by itself
        return JobOutcome(error=error)


def _work(connection: Connection, niceness: int) -> None:
    """The process: jobs in, progress and outcomes out."""
    os.setpriority(os.PRIO_PROCESS, 0, niceness)
    Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, OSError):  # nobody waits for the result any more
        while True:
            outcome = _do(connection.recv(), lambda value: connection.send(JobProgress(value)))
            if not _can_be_pickled(outcome.error):
                outcome = JobOutcome(error=RuntimeError(repr(outcome.error)))
            connection.send(outcome)


def _can_be_pickled(error: Exception | None) -> bool:
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return False
    return True


def _end_with_parent() -> None:
    """End the process when the one that started it is gone."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
