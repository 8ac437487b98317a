"""Walks that were driven live become runs, one at a time, each worked out and written by a process of its own.

A session has 30 MB. It goes to a file as it comes from the control process, and that process reads it from there: the
server never holds it, neither for its own memory's sake nor for the time of its other threads.
"""

import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

from app.jobs import JobProcess, Report
from app.live.session_log import Session, read_segments, write_segments
from app.runs.run import Run, RunsUnavailableError
from app.runs.store import RunStore
from walkcore import Robot

NICENESS = 5  # of 19: a person waits for it, but the live walk goes before
MAX_SAVES = 4  # sessions that may be under way: each has its file
SEGMENTS = "segments"  # file of a session that is being written


@dataclass(frozen=True, slots=True, eq=False)
class WriteSession:
    """Job that writes the files of a session's run."""

    segments: Path
    """File of the session as `write_segments` wrote it; it is removed."""
    name: str
    """Name of the scenario that leads to the same walk."""
    robot: Robot
    """Robot that walked."""
    folder: Path
    """Folder for run.json and the recording."""

    def __call__(self, _: Report) -> tuple[dict[str, Any], float]:
        """Write, and return the scenario and its duration [s]."""
        segments = list(read_segments(self.segments))
        self.segments.unlink()
        recording = Session.unpacked(segments).recording(self.name, self.robot)
        recording.write(self.folder)
        return dict(recording.scenario.source), recording.scenario.duration


class SessionKeeper:
    """Keeps sessions as runs that are done. May be called from any thread, which waits."""

    def __init__(self, store: RunStore) -> None:
        """Start no process yet."""
        self._store = store
        self._places = threading.Semaphore(MAX_SAVES)
        self._turn = threading.Lock()
        self._process: JobProcess | None = None
        self._is_stopping = False

    @contextmanager
    def place(self) -> Iterator[None]:
        """Take one of the few places, before anything is asked of the robot.

        Raises:
            RunsUnavailableError: if there is none.
        """
        if not self._places.acquire(blocking=False):
            raise RunsUnavailableError(f"{MAX_SAVES} walks are being saved already")
        try:
            yield
        finally:
            self._places.release()

    def keep(self, segments: Iterable[bytes], name: str, robot: Robot) -> Run:
        """Write a session, and take it in as a run that is done.

        Args:
            segments: as `SessionLog.segments` packs them; they may still come.
            name: of the run.
            robot: that walked.

        Raises:
            RunsUnavailableError: if the server stops, or the disk does not take the files.
        """
        draft_id, run = uuid4().hex, None
        try:
            draft = self._store.unfinished(draft_id)
            write_segments(segments, draft / SEGMENTS)
            with self._turn:
                if self._is_stopping:
                    raise RunsUnavailableError("the server stops")
                scenario, duration = self._write(WriteSession(draft / SEGMENTS, name, robot, draft))
            run = self._store.add(scenario, robot.name, duration, status="running")
            draft.replace(self._store.unfinished(run.id))  # which is empty
            self._store.finish(run.id, None)
            return self._store.get(run.id)
        except OSError as error:
            if run is not None:  # in the list already
                self._store.fail(run.id, f"could not be kept: {error}")
            raise RunsUnavailableError(f"the walk cannot be kept: {error}") from error
        finally:
            self._store.discard(draft_id)

    def stop(self) -> None:
        """End the process, if there is one."""
        self._is_stopping = True
        if (process := self._process) is not None:
            process.kill()

    def _write(self, job: WriteSession) -> tuple[dict[str, Any], float]:
        self._process = process = JobProcess(NICENESS)
        try:
            return process.run(job).result()
        finally:
            process.kill()
            self._process = None
