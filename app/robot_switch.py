"""The robot that walks here, and its replacement by another one while the server runs.

Nothing of a robot changes in place: another one gets a control process, a scene and a panel of its own, and takes over
once it stands and can be drawn. Until then the one before walks on, and where anything fails it goes on walking. Then
its last minute is kept in a file, so that it can still be saved, and its process and its scene end.
"""

import logging
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.live.control import NothingToSaveError
from app.live.driver_lease import DriverLease
from app.live.messages import NoResponseError
from app.live.plant_choice import PlantChoice
from app.live.runner import Runner
from app.live.session_log import PackedSegment, read_segments, write_segments
from app.robot_choices import RobotChoices
from app.viewer import RenderQuality, Viewer
from walkcore import Robot, WalkError

logger = logging.getLogger(__name__)

# The paper takes 0.8 s to start; a person at a joystick waits for the step.
LIVE = {"initial_double_support_duration": 0.3, "dynamic_filter": True, "step_timing": "adaptive"}
"""Parameters of the live walk that are not the robot's own."""


class RobotNotShownError(WalkError):
    """A robot cannot be drawn, for example for a mesh that cannot be read."""


@dataclass(frozen=True, slots=True, eq=False)
class LiveRobot:
    """A robot that walks, and what shows it."""

    runner: Runner
    viewer: Viewer

    def start(self) -> None:
        """Let time pass, and draw."""
        self.runner.start()
        self.viewer.start()

    def stop(self) -> None:
        """End the scene and the control process."""
        self.viewer.stop()
        self.runner.stop()


@dataclass(frozen=True, slots=True, eq=False)
class LiveSession:
    """The last minute of a robot that walks or walked here."""

    robot: Robot
    segments: Iterator[PackedSegment]
    """One after the other; they may still come."""


class RobotSwitch:
    """Owner of the robot that walks. All methods may be called from any thread."""

    def __init__(
        self, start: Robot, choices: RobotChoices, plant: PlantChoice, quality: RenderQuality, lease: DriverLease
    ) -> None:
        """Put up the first robot; time does not pass yet.

        Args:
            start: robot that walks first.
            choices: robots that can walk here.
            plant: that each begins with.
            quality: amount of detail to render.
            lease: of the controls, which goes on from one robot to the next.

        Raises:
            WalkError: if it cannot stand or be drawn.
        """
        self.first, self.choices = start, choices
        self._plant: PlantChoice = plant
        self._quality, self._lease = quality, lease
        self._turn, self._is_stopped = threading.Lock(), threading.Event()
        self._former: FormerWalk | None = None
        self._present = self._put_up(start)

    @property
    def runner(self) -> Runner:
        """Runner of the robot that walks at the moment."""
        return self._present.runner

    @property
    def viewer(self) -> Viewer:
        """Viewer of the robot that walks at the moment."""
        return self._present.viewer

    def start(self) -> None:
        """Let time pass."""
        self._present.start()

    def stop(self) -> None:
        """End the robot; one that is being put up ends as soon as it stands."""
        self._is_stopped.set()
        self._present.stop()
        if self._former is not None:
            self._former.forget()

    def switch(self, name: Any) -> Robot:
        """Let the robot of a name walk here instead, at rest, with its own parameters and a time that passes.

        It waits for some seconds. The robot that walks already goes on as it is, unless its file was read anew.

        Args:
            name: one of the choices.

        Raises:
            WalkError: if there is none of that name, or it cannot stand or be drawn; nothing has changed then.
            NoResponseError: while the control process does not respond, or another robot is being put up.
        """
        robot = self.choices.load(name)
        if not self._turn.acquire(blocking=False):
            raise NoResponseError("another robot is being put up already; try again")
        try:
            if trouble := self.runner.trouble:
                raise NoResponseError(trouble)
            if robot is not self.runner.robot:
                self._replace_with(self._put_up(robot))
            return self.runner.robot
        finally:
            self._turn.release()

    def save(self, is_before_reset: bool) -> LiveSession:
        """The last minute of the walk, or of the one before its last reset: another robot's, where there was no reset.

        What is wrong with it is raised by its iterator, as by that of `Runner.save`.
        """
        runner, former = self.runner, self._former
        if is_before_reset and former is not None and runner.is_first_walk:
            return LiveSession(former.robot, former.segments())
        return LiveSession(runner.robot, runner.save(is_before_reset))

    def _replace_with(self, following: LiveRobot) -> None:
        former = self._present
        if self._is_stopped.is_set():
            following.stop()
            raise NoResponseError("the server stops")
        following.viewer.take_over(former.viewer).result()  # the layers of those who look
        following.start()
        self._present, before = following, self._former
        self._former = FormerWalk.of(former.runner)
        former.stop()
        if before is not None:
            before.forget()

    def _put_up(self, robot: Robot) -> LiveRobot:
        runner = Runner(robot, robot.parameters.changed(LIVE))  # its process starts while the viewer is built
        viewer: Viewer | None = None
        try:
            viewer = self._viewer(runner)
            runner.wait()
            try:
                runner.choose_plant(self._plant).result()
            except NoResponseError as error:  # the process ended over it; the next one stands in the ideal model
                logger.warning("no plant could be chosen, the robot walks in the ideal model: %s", error)
        except BaseException:
            if viewer is not None:
                viewer.stop()
            runner.stop()
            raise
        return LiveRobot(runner, viewer)

    def _viewer(self, runner: Runner) -> Viewer:
        try:
            return Viewer(runner, self._quality, self._lease)
        except WalkError:
            raise
        except Exception as error:  # of the libraries that read meshes, which are many
            raise RobotNotShownError(f"{runner.robot.name} cannot be drawn: {error}") from error


class FormerWalk:
    """The last minute of a robot that walks here no more, in a file."""

    def __init__(self, robot: Robot) -> None:
        """Begin without a walk.

        Args:
            robot: that walked.
        """
        self.robot = robot
        self._folder = tempfile.TemporaryDirectory(prefix="walk-former-")
        self._path = Path(self._folder.name) / "segments"

    @classmethod
    def of(cls, runner: Runner) -> "FormerWalk | None":
        """The last minute of a runner, which is paused; None where it cannot be had."""
        former: FormerWalk | None = None
        try:
            former = cls(runner.robot)
            runner.pause().result()
            write_segments(runner.save(), former._path)
            return former
        except (NoResponseError, NothingToSaveError, OSError) as error:
            logger.warning("the walk of %s is lost: %s", runner.robot.name, error)
            if former is not None:
                former.forget()
            return None

    def segments(self) -> Iterator[PackedSegment]:
        """The segments of the walk."""
        return read_segments(self._path)

    def forget(self) -> None:
        """Remove the file."""
        self._folder.cleanup()
