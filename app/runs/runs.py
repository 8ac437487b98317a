"""All runs of a server, for the routes: taken in, listed, handed out, cancelled."""

import logging
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any
from uuid import uuid4

from app.formats import FORMATS
from app.jobs import Job, ProcessDiedError
from app.live.session_log import PackedSegment, write_segments
from app.robot_choices import RobotChoices
from app.runs.admission import RunLimits, admitted_scenario
from app.runs.run import Run
from app.runs.run_jobs import WriteSession, WrittenRun, convert
from app.runs.store import DataInUseError, RunStore
from app.runs.upload import PROCESSOR_TIME, TakeUpload, UploadLimits
from app.work import NoFileError, WorkQueue, WorkUnavailableError
from app.work.awaited_jobs import AwaitedJobs
from app.work.queue import NICENESS, failure
from walkcore import Robot
from walkcore.errors import InvalidValueError

logger = logging.getLogger(__name__)

MAX_SAVES = 4  # sessions that may be under way: each has its file
MAX_UPLOADS = 2  # files that may be under way
MAX_CONVERSIONS = 8  # threads of the server's that may wait for one
SEGMENTS = "segments"  # file of a session that is being written


class Runs(WorkQueue[Run]):
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
        self._temporary: tempfile.TemporaryDirectory[str] | None = None
        self.store = self._open(folder)
        """The runs on the disk."""
        super().__init__(self.store, nb_workers, nb_queued, nb_kept, bytes_kept)
        self._conversions = AwaitedJobs(MAX_CONVERSIONS, f"{MAX_CONVERSIONS} files are being made already", NICENESS)
        self.sessions = AwaitedJobs(MAX_SAVES, f"{MAX_SAVES} walks are being saved already")
        """Jobs that keep walks which were driven live; see `add_session`."""
        self.uploads = AwaitedJobs(MAX_UPLOADS, f"{MAX_UPLOADS} files are being uploaded already")
        """Jobs that keep recordings from elsewhere; see `add_upload`."""
        self.restoring = AwaitedJobs(1, "another tick of a run is being restored")
        """Jobs that restore ticks of runs, for the live robot to go on from; see `app.runs.restore`."""

    @property
    def folder(self) -> Path:
        """Folder where the runs are kept, which no other server has."""
        return self.store.folder

    def stop(self) -> None:
        """End all processes. The next server reports runs under way as failed, and takes up queued ones."""
        for jobs in (self._conversions, self.sessions, self.uploads, self.restoring):
            jobs.stop()
        super().stop()
        self.store.close()
        if self._temporary is not None:
            self._temporary.cleanup()

    @property
    def problem(self) -> str:
        """The trouble that keeps runs from being kept or started; empty if there is none."""
        return self.store.problem

    @property
    def notice(self) -> str:
        """The repairs that were made when the data folder was opened; empty if none were needed."""
        return self.store.notice

    def submit(self, scenario: Mapping[str, Any]) -> Run:
        """Take in a scenario, to be simulated when a process is free.

        Raises:
            InvalidValueError: if it is no scenario, or beyond a limit.
            WorkUnavailableError: if too many wait already, or the disk takes no more.
        """
        admitted = admitted_scenario(scenario, self.limits, self._choices)
        return self._take_in(lambda: self.store.add(admitted.source, admitted.robot.name, admitted.duration))

    @contextmanager
    def draft(self) -> Iterator[Path]:
        """An empty folder for a run's files, which is thrown away at the end unless the run was kept.

        Raises:
            WorkUnavailableError: if the disk does not take what is written into it.
        """
        draft_id = uuid4().hex
        try:
            yield self.store.unfinished(draft_id)
        except OSError as error:
            raise WorkUnavailableError(f"the walk cannot be kept: {error}") from error
        finally:
            self.store.discard(draft_id)

    def add_session(self, segments: Iterable[PackedSegment], name: str, robot: Robot) -> Run:
        """Keep a walk that was driven live as a run that is done.

        Args:
            segments: one after the other; they may still come.
            name: of the run.
            robot: that walked.

        Raises:
            WorkUnavailableError: if the server stops, or the disk does not take the files.
        """
        with self.draft() as draft:  # the server never holds what has tens of megabytes: the process reads it there
            write_segments(segments, draft / SEGMENTS)
            return self._keep(draft, self.sessions, WriteSession(draft / SEGMENTS, name, robot, draft))

    def add_upload(self, file: Path, name: str, robot: str) -> Run:
        """Keep a recording from elsewhere as a run that is done.

        Args:
            file: as it was uploaded, in a `draft`.
            name: of the run; empty for that of its scenario.
            robot: that walked, where the file has no run.json.

        Raises:
            InvalidValueError: if it is no recording, or beyond a limit.
            WorkUnavailableError: if the server stops, or the disk does not take the files.
        """
        job = TakeUpload(file, name, robot, self._choices or RobotChoices(), self.upload_limits)
        try:
            return self._keep(file.parent, self.uploads, job)
        except ProcessDiedError as error:
            limit = f"must be read within {PROCESSOR_TIME} s of processor time ({error})"
            raise InvalidValueError("file", "too much", limit) from error

    def _keep(self, draft: Path, jobs: AwaitedJobs, job: Job[WrittenRun]) -> Run:
        """Do the job that writes a run into its draft, and take it in as a run that is done.

        Args:
            draft: whatever else lies in it has to be removed by the job.
            jobs: do it in turn.
            job: writes run.json and a recording there.
        """
        written = jobs.run(job)
        run = self.store.add(written.scenario, written.robot, written.duration, status="running")
        try:
            draft.replace(self.store.unfinished(run.id))  # which is empty
            kept = self.store.finish(run.id, None) or self.store.get(run.id)
        except Exception as error:  # it is in the list already
            self.store.fail(run.id, f"could not be kept: {error}")
            raise
        self._trim()
        return kept

    def file(self, run_id: str, name: str) -> Path:
        """A file of a run that was simulated to its end: run.json, or a recording, made now if need be.

        Raises:
            UnknownWorkError: if there is no such run.
            NoFileError: if the run has no files, or none of that name.
            WorkUnavailableError: if too many are being made.
        """
        run = self.store.get(run_id)
        path = self.store.files(run.id) / name
        ending = next((form.ending for form in FORMATS.values() if form.file == name), None)
        if run.size and ending is not None and not path.is_file():
            with self._conversions.place(), self._conversions.turn:
                if not path.is_file():  # else it was made meanwhile
                    self._convert(path, ending)
                    self.store.measure(run.id)
        if not path.is_file():
            raise NoFileError(f"run {run_id} is {run.status}: it has no {name}")
        return path

    def _convert(self, path: Path, ending: str) -> None:
        """Convert in a process: drawing and packing take memory, and are seldom requested."""
        try:
            self._conversions.run(partial(convert, path.parent, ending))
        except WorkUnavailableError:
            raise
        except Exception as error:
            raise NoFileError(f"the recording cannot be written as {ending}: {failure(error)}") from error

    def _open(self, folder: Path) -> RunStore:
        try:
            return RunStore(folder.expanduser())
        except DataInUseError as error:
            self._temporary = tempfile.TemporaryDirectory(prefix="walk-runs-")
            logger.warning("%s; runs of this one are lost when it ends (give it its own WALK_DATA)", error)
            return RunStore(Path(self._temporary.name))
