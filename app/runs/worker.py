"""A process of its own that does one job after the other, behind the live walk in precedence.

It is started afresh (spawned), shares nothing with the server but a pipe, and ends when
the server's end of the pipe is gone: at the latest at the next hundredth of the run.
"""

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Protocol

from app.formats import FORMATS
from app.runs.read import read_run
from app.runs.run import Progress
from walkcore import WalkError
from walkcore.scenario.recording import record
from walkcore.scenario.scenario import scenario_from_mapping

NICENESS = 15  # of 19: what is left of the processor
EXIT_TIMEOUT = 5.0  # [s] a killed process may take to be gone


Tell = Callable[[Progress], None]


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a job ended."""

    failure: str = ""
    """Why its files are not there; empty where they are."""
    real_time_factor: float | None = None


class Job(Protocol):
    """Something to do in the other process: a plain value."""

    def do(self, tell: Tell) -> Outcome:
        """Do it there; what it raises is told as its failure."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Simulate:
    """A scenario, and the folder for its recording."""

    scenario: Mapping[str, Any]
    folder: Path

    def do(self, tell: Tell) -> Outcome:
        """As `walk run` does."""
        started = time.perf_counter()
        scenario = scenario_from_mapping(self.scenario)

        def factor(fraction: float) -> float:
            return fraction * scenario.duration / (time.perf_counter() - started)

        recording = record(scenario, lambda fraction: tell(Progress(fraction, factor(fraction))))
        outcome = Outcome(real_time_factor=factor(1.0))
        recording.write(self.folder)
        return outcome


@dataclass(frozen=True, slots=True)
class Convert:
    """A recording that is written already, into one more format."""

    folder: Path
    ending: str

    def do(self, tell: Tell) -> Outcome:
        """Beside the others, in one piece."""
        form = FORMATS[self.ending]
        half = self.folder / f"half.{form.file}"
        recording, run_json = read_run(self.folder)
        form.write(recording, run_json, half)
        half.rename(self.folder / form.file)
        return Outcome()


class Worker:
    """The server's end. `run` belongs to one thread; `kill` may be called from any."""

    def __init__(self) -> None:
        """Start the process."""
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_work, args=(theirs,), name="walk runs", daemon=True)
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # Ctrl-C is for the server, which ends this
        self._process.start()
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        theirs.close()  # so that the end of the process is the end of the pipe

    def run(self, job: Job, on_progress: Tell = lambda _: None) -> Outcome:
        """Have a job done; told as failed where the process ends under it."""
        try:
            self._connection.send(job)
            while isinstance(message := self._connection.recv(), Progress):
                on_progress(message)
            return message
        except (EOFError, OSError):
            self._process.join(EXIT_TIMEOUT)
            return Outcome(failure=f"its worker process ended with exit code {self._process.exitcode}")

    @property
    def is_alive(self) -> bool:
        """Whether the process can take another job."""
        return self._process.is_alive()

    def kill(self) -> None:
        """End the process at once, and whatever it was doing."""
        self._process.kill()
        self._process.join(EXIT_TIMEOUT)


def _work(connection: Connection) -> None:
    """The process: jobs in, progress and outcomes out."""
    os.nice(NICENESS)
    with suppress(EOFError, OSError):  # the server is gone
        while True:
            job = connection.recv()
            connection.send(_outcome(job, connection.send))


def _outcome(job: Job, tell: Tell) -> Outcome:
    try:
        return job.do(tell)
    except WalkError as error:
        return Outcome(failure=str(error))
    except Exception as error:
        return Outcome(failure=f"{type(error).__name__}: {error}")
