"""Formats that are made when they are first asked for, one after the other, away from the server's interpreter."""

import threading
from pathlib import Path

from app.runs.errors import NoRecordingError, RunsUnavailableError
from app.runs.worker import Convert, Worker

MAX_WAITING = 8  # threads of the server's that may wait
RETRY_AFTER = 10  # [s]


class Converter:
    """Makes one file at a time. May be called from any thread, which waits."""

    def __init__(self) -> None:
        """Start no process yet."""
        self._turn = threading.Lock()
        self._places = threading.Semaphore(MAX_WAITING)
        self._worker: Worker | None = None
        self._is_stopping = False

    def make(self, folder: Path, ending: str, file: str) -> None:
        """See that a folder with a recording holds it in that format, too.

        Raises:
            NoRecordingError: if it cannot be made.
            RunsUnavailableError: if too many others wait.
        """
        if not self._places.acquire(blocking=False):
            raise RunsUnavailableError(f"{MAX_WAITING} files are being made already", RETRY_AFTER)
        try:
            with self._turn:
                if not (folder / file).is_file() and not self._is_stopping:
                    self._make(folder, ending)
        finally:
            self._places.release()

    def stop(self) -> None:
        """End the process, if there is one."""
        self._is_stopping = True
        if (worker := self._worker) is not None:
            worker.kill()

    def _make(self, folder: Path, ending: str) -> None:
        """In a process that ends with it: what draws and packs takes memory, and is seldom asked for."""
        self._worker = Worker()
        outcome = self._worker.run(Convert(folder, ending))
        self._worker.kill()
        self._worker = None
        if outcome.failure:
            raise NoRecordingError(f"the recording cannot be written as {ending}: {outcome.failure}")
