"""All runs of a server, for the routes: taken in, listed, handed out, cancelled."""

import logging
import tempfile
import threading
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.formats import FORMATS
from app.jobs import ProcessDiedError
from app.live.session_log import write_segments
from app.robot_choices import RobotChoices
from app.runs.admission import RunLimits, admitted_scenario
from app.runs.queue import Converter, RunQueue
from app.runs.restore import Restorer
from app.runs.run import NoRecordingError, Run, RunsUnavailableError
from app.runs.run_jobs import WriteSession
from app.runs.run_writer import RunWriter
from app.runs.store import DataInUseError, RunStore
from app.runs.upload import PROCESSOR_TIME, TakeUpload, UploadLimits
from walkcore import Robot
from walkcore.errors import InvalidValueError
from walkcore.scenario.recording import Recording

logger = logging.getLogger(__name__)

MAX_SAVES = 4  # sessions that may be under way: each has its file
MAX_UPLOADS = 2  # files that may be under way
SEGMENTS = "segments"  # file of a session that is being written


class Runs:
    """All runs of one server. All methods may be called from any thread."""

    def __init__(
        self,
        folder: Path,
        nb_workers: int,
        nb_queued: int,
        nb_kept: int,
        bytes_kept: int,
        limits: RunLimits,
        choices: RobotChoices | None = None,
        upload_bytes: int = UploadLimits.bytes,
    ) -> None:
        """Open the data folder.

        Args:
            folder: where runs are kept; a temporary one takes its place where another server has it. One that cannot be
                written to is told by `problem`, and tried again.
            nb_workers: runs that are simulated at once.
            nb_queued: runs that may wait.
            nb_kept: ended runs that are kept; the oldest go first.
            bytes_kept: size of all files that are kept; the oldest go first, the latest never.
            limits: of one run.
            choices: robots that a run may name; by default those that ship.
            upload_bytes: size of the largest file that may be uploaded.

        Raises:
            OSError: if another server has the folder, and there can be no temporary one.
        """
        self.limits, self._choices = limits, choices
        self.upload_limits = UploadLimits(upload_bytes, limits.ticks)
        self._nb_queued, self._nb_kept, self._bytes_kept = nb_queued, nb_kept, bytes_kept
        self._temporary: tempfile.TemporaryDirectory[str] | None = None
        self._store = self._open(folder)
        self._queue = RunQueue(self._store, nb_workers, on_end=self._trim)
        self._admission = threading.Lock()
        self._converter = Converter()
        self.sessions = RunWriter(self._store, MAX_SAVES, "walks are being saved")
        """Keeps walks that were driven live; see `add_session`."""
        self.uploads = RunWriter(self._store, MAX_UPLOADS, "files are being uploaded")
        """Keeps recordings from elsewhere; see `add_upload`."""
        self.restorer = Restorer()
        """Restores ticks of runs, for the live robot to go on from."""

    @property
    def folder(self) -> Path:
        """Folder where the runs are kept, which no other server has."""
        return self._store.folder

    def start(self) -> None:
        """Begin with the queued runs."""
        self._queue.start()

    def stop(self) -> None:
        """End all processes. The next server reports runs under way as failed, and takes up queued ones."""
        self._converter.stop()
        self.sessions.stop()
        self.uploads.stop()
        self.restorer.stop()
        self._queue.stop()
        self._store.close()
        if self._temporary is not None:
            self._temporary.cleanup()

    @property
    def problem(self) -> str:
        """The trouble that keeps runs from being kept or started; empty if there is none."""
        return self._store.problem

    @property
    def notice(self) -> str:
        """The repairs that were made when the data folder was opened; empty if none were needed."""
        return self._store.notice

    def submit(self, scenario: Mapping[str, Any]) -> Run:
        """Take in a scenario, to be simulated when a process is free.

        Raises:
            InvalidValueError: if it is no scenario, or beyond a limit.
            RunsUnavailableError: if too many wait already, or the disk takes no more.
        """
        admitted = admitted_scenario(scenario, self.limits, self._choices)
        with self._admission:
            if self._store.nb_queued() >= self._nb_queued:
                raise RunsUnavailableError(f"{self._nb_queued} runs wait already")
            try:
                return self._store.add(admitted.source, admitted.robot.name, admitted.duration)
            finally:
                self._queue.wake()  # to begin with it, or to try the disk again that did not take it

    def add_finished(self, recording: Recording, real_time_factor: float | None = None) -> Run:
        """Keep a walk that was not simulated here, such as one that was just driven live, as a run that is done.

        Args:
            recording: of the walk.
            real_time_factor: simulated over real time, where it is known.

        Raises:
            RunsUnavailableError: if the disk does not take it.
        """
        scenario = recording.scenario
        run = self._store.add(scenario.source, scenario.robot.name, scenario.duration, status="running")
        try:
            recording.write(self._store.unfinished(run.id))
            self._store.finish(run.id, real_time_factor)
        except OSError as error:
            self._store.fail(run.id, f"could not be kept: {error}")
            raise RunsUnavailableError(f"the run cannot be kept: {error}") from error
        except BaseException as error:
            self._store.fail(run.id, f"could not be kept: {error}")
            raise
        self._trim()
        return self._store.get(run.id)

    def add_session(self, segments: Iterable[bytes], name: str, robot: Robot) -> Run:
        """Keep a walk that was driven live as a run that is done.

        Args:
            segments: as `SessionLog.segments` packs them; they may still come.
            name: of the run.
            robot: that walked.

        Raises:
            RunsUnavailableError: if the server stops, or the disk does not take the files.
        """
        with self.sessions.draft() as draft:
            write_segments(segments, draft / SEGMENTS)
            run = self.sessions.keep(draft, WriteSession(draft / SEGMENTS, name, robot, draft))
        self._trim()
        return run

    def add_upload(self, file: Path, name: str, robot: str) -> Run:
        """Keep a recording from elsewhere as a run that is done.

        Args:
            file: as it was uploaded, in a draft of `uploads`.
            name: of the run; empty for that of its scenario.
            robot: that walked, where the file has no run.json.

        Raises:
            InvalidValueError: if it is no recording, or beyond a limit.
            RunsUnavailableError: if the server stops, or the disk does not take the files.
        """
        job = TakeUpload(file, name, robot, self._choices or RobotChoices(), self.upload_limits)
        try:
            run = self.uploads.keep(file.parent, job)
        except ProcessDiedError as error:
            limit = f"must be read within {PROCESSOR_TIME} s of processor time ({error})"
            raise InvalidValueError("file", "too much", limit) from error
        self._trim()
        return run

    def get(self, run_id: str) -> Run:
        """The present state of a run.

        Raises:
            UnknownRunError: if there is none of that id.
        """
        return self._with_progress(self._store.get(run_id))

    def list(self) -> list[Run]:
        """All runs, the latest first."""
        return [self._with_progress(run) for run in self._store.list()]

    def delete(self, run_id: str) -> Run:
        """Cancel a run that has not ended, its process included; remove one that has.

        Returns:
            The run as it was: one that had not ended is kept, as cancelled.

        Raises:
            UnknownRunError: if there is none of that id.
            RunsUnavailableError: if its files cannot be removed.
        """
        run = self._store.get(run_id)
        if self._store.cancel(run_id):
            self._queue.cancel(run_id)
        else:
            self._store.remove(run_id)
            self._queue.wake()  # there is space
        return run

    def file(self, run_id: str, name: str) -> Path:
        """A file of a run that was simulated to its end: run.json, or a recording, made now if need be.

        Raises:
            UnknownRunError: if there is no such run.
            NoRecordingError: if the run has no files, or none of that name.
            RunsUnavailableError: if too many are being made.
        """
        run = self._store.get(run_id)
        path = self._store.files(run.id) / name
        ending = next((form.ending for form in FORMATS.values() if form.file == name), None)
        if run.size and ending is not None and not path.is_file():
            self._converter.make(path.parent, ending, name)
            self._store.measure(run.id)
        if not path.is_file():
            raise NoRecordingError(f"run {run_id} is {run.status}: it has no {name}")
        return path

    def _with_progress(self, run: Run) -> Run:
        progress = self._queue.progress(run.id) if run.status == "running" else None
        return run if progress is None else replace(run, progress=progress)

    def _trim(self) -> None:
        try:
            self._store.trim(self._nb_kept, self._bytes_kept)
        except RunsUnavailableError as error:
            logger.warning("old runs are kept: %s", error)

    def _open(self, folder: Path) -> RunStore:
        try:
            return RunStore(folder.expanduser())
        except DataInUseError as error:
            self._temporary = tempfile.TemporaryDirectory(prefix="walk-runs-")
            logger.warning("%s; runs of this one are lost when it ends (give it its own WALK_DATA)", error)
            return RunStore(Path(self._temporary.name))
