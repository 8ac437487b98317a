"""Robots that a server lets walk, by name: the one it was started with, those that ship, and the files of a folder.

Clients name robots and never paths, which would be paths on the server's disk.
"""

import logging
from pathlib import Path
from typing import Any

from walkcore import Robot, load_robot, robot_names
from walkcore.errors import InvalidValueError, WalkError
from walkcore.values import check_choice

logger = logging.getLogger(__name__)


class RobotChoices:
    """Names of robots, and the files behind them; the folder is read at every call, so that files may come and go."""

    def __init__(self, start: Robot | None = None, folder: Path | None = None) -> None:
        """Take the choices.

        Args:
            start: with which the server starts, whatever else has its name; None for no other than the following.
            folder: of further robot files, each named as its robot with `.yaml` behind it; None for no more.
        """
        self._start, self._folder = start, folder

    def sources(self) -> dict[str, str]:
        """Name or path that `load_robot` takes, by the name of each robot."""
        files = [] if self._folder is None else sorted(self._folder.expanduser().glob("*.yaml"))
        sources = {file.stem: str(file.resolve()) for file in files} | {name: name for name in robot_names()}
        return sources if self._start is None else sources | {self._start.name: self._start.source}

    def load(self, name: Any) -> Robot:
        """The robot of a name that a client gives; the same object as before unless it is read from a file.

        Raises:
            InvalidValueError: if there is none, naming the choices, or its file does not describe one of this name.
        """
        sources = dict(sorted(self.sources().items()))
        robot = load_robot(sources[check_choice("robot", name, sources)])
        if robot.name != name:
            raise InvalidValueError("robot.name", robot.name, f"must be {name}, as its file is named")
        return robot

    def all(self) -> list[Robot]:
        """All robots in the order of their names, without those whose files cannot be read."""
        robots: list[Robot] = []
        for name in sorted(self.sources()):
            try:
                robots.append(self.load(name))
            except (WalkError, OSError) as error:
                logger.warning("%s is no robot to choose: %s", name, error)
        return robots
