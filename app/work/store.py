"""Base of the stores of runs and sweeps: the states of work and its changes; subclasses write it to the disk."""

import logging
import math
import threading
import time
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, Generic, TypeVar

from app.jobs import Job
from app.work.work import UnknownWorkError, Work, WorkUnavailableError

logger = logging.getLogger(__name__)

AnyWork = TypeVar("AnyWork", bound=Work)


class WorkStore(ABC, Generic[AnyWork]):
    """Keeps work, and takes it from one state to the next. All methods may be called from any thread.

    What is in memory is the truth: where the disk does not take a change, it holds nevertheless.
    """

    kind = "run"
    """Word for the work, in messages."""

    def __init__(self) -> None:
        """Begin without any."""
        self._lock = threading.RLock()
        self._works: dict[str, AnyWork] = {}  # the oldest first

    def get(self, work_id: str) -> AnyWork:
        """The work of an id.

        Raises:
            UnknownWorkError: if there is none of that id.
        """
        with self._lock:
            work = self._works.get(work_id)
        if work is None:
            raise UnknownWorkError(work_id, self.kind)
        return work

    def list(self) -> list[AnyWork]:
        """All work, the latest first."""
        with self._lock:
            return list(reversed(self._works.values()))

    def nb_queued(self) -> int:
        """Number of those that wait."""
        with self._lock:
            return sum(work.status == "queued" for work in self._works.values())

    def has_work(self) -> bool:
        """Whether something waits to be started or written, now or as soon as the disk takes it."""
        return self.nb_queued() > 0

    def start_next(self) -> AnyWork | None:
        """The work that has waited longest of what can be started, from now on running; None without."""
        with self._lock:
            work = next(
                (work for work in self._works.values() if work.status == "queued" and self._has_room(work)), None
            )
            return None if work is None else self._put(replace(work, status="running", started=time.time()))

    def fail(self, work_id: str, reason: str) -> None:
        """Mark work that was under way as failed; what is there of its files goes first."""
        self.discard(work_id)
        with self._lock:
            work = self._running(work_id)
            if work is not None:
                self._put(replace(work, status="failed", reason=_unicode(reason), ended=time.time()))

    def cancel(self, work_id: str) -> bool:
        """Cancel work that has not ended; False if there was none."""
        with self._lock:
            work = self._works.get(work_id)
            if work is None or work.has_ended:
                return False
            self._put(replace(work, status="cancelled", reason="cancelled on request", ended=time.time()))
            if work.status == "queued":  # else the files go once its process has
                self.discard(work_id)
            return True

    def trim(self, nb_kept: int, bytes_kept: float = math.inf) -> None:
        """Remove the oldest work that has ended, but never the latest, nor what the disk does not let go.

        Args:
            nb_kept: most that is kept.
            bytes_kept: most bytes that all its files may have.
        """
        size = 0
        for i, work in enumerate(work for work in self.list() if work.has_ended):
            size += work.size
            if i > 0 and (i >= nb_kept or size > bytes_kept):
                try:
                    self.remove(work.id)
                except WorkUnavailableError as error:
                    logger.warning("an old %s is kept: %s", self.kind, error)

    @abstractmethod
    def job(self, work_id: str) -> Job[Any]:
        """The job that does the work.

        Raises:
            OSError: if there can be no folder for its files.
        """

    @abstractmethod
    def keep(self, work_id: str, result: Any) -> object:
        """Keep what the job returned and wrote, unless its work was cancelled meanwhile.

        Raises:
            OSError: if the files are not there in full.
        """

    @abstractmethod
    def discard(self, work_id: str) -> None:
        """Throw away the files of work that has not been kept."""

    @abstractmethod
    def remove(self, work_id: str) -> None:
        """Forget work that has ended, files and all.

        Raises:
            WorkUnavailableError: if its files cannot be removed.
        """

    @abstractmethod
    def _put(self, work: AnyWork) -> AnyWork:
        """Take over a new state, in memory and if possible on the disk."""

    def _has_room(self, work: AnyWork) -> bool:
        """Whether the disk has space for the files of work that waits."""
        return True

    def _running(self, work_id: str) -> AnyWork | None:
        work = self._works.get(work_id)
        return work if work is not None and work.status == "running" else None


def _unicode(text: str) -> str:
    """The text without lone surrogates, which no row takes."""
    return text.encode(errors="replace").decode()
