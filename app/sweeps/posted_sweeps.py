"""All sweeps that were posted to a server, for its routes: admitted, queued as runs are, handed out, cancelled."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.robot_choices import RobotChoices
from app.sweeps.posted_sweep import PostedSweep, PostedSweepStore
from app.work import NoFileError, WorkQueue
from walkcore.analysis.survival import OBSERVED, STEADY
from walkcore.analysis.sweep import Sweep, sweep_from_mapping
from walkcore.errors import InvalidValueError
from walkcore.plain_yaml import check_size

MAX_VALUES = 5000  # values and keys of a sweep, of whatever kind
MAX_WALKS = 50  # combinations, each of which is judged before any is walked


@dataclass(frozen=True, slots=True)
class SweepLimits:
    """Limits of posted sweeps."""

    ticks: int = 20_000_000
    """Ticks of all trials of one sweep, if each was walked to its end, and of its nominal walks."""
    queued: int = 8
    """Sweeps that may wait."""
    kept: int = 50
    """Ended sweeps that are kept; the oldest go first."""


class PostedSweeps(WorkQueue[PostedSweep]):
    """All sweeps of one server: one at a time, by a process behind the live walk. May be called from any thread.

    The next server goes on with the sweep that was under way when the last one ended.
    """

    def __init__(self, folder: Path, limits: SweepLimits, choices: RobotChoices | None = None) -> None:
        """Read the folder.

        Args:
            folder: where sweeps are kept, which no other server has.
            limits: of sweeps.
            choices: robots that a sweep may name; by default those that ship.
        """
        self.limits, self._choices = limits, choices or RobotChoices()
        self.store = PostedSweepStore(folder)
        """The sweeps on the disk."""
        super().__init__(self.store, 1, limits.queued, limits.kept)

    def submit(self, data: Mapping[str, Any]) -> PostedSweep:
        """Take in a sweep, to be walked when those before it have ended.

        Raises:
            InvalidValueError: if it is no sweep, or beyond a limit.
            WorkUnavailableError: if too many wait already, or the disk takes no more.
        """
        sweep = admitted_sweep(data, self.limits, self._choices)
        return self._take_in(lambda: self.store.add(sweep.source, sweep.nb_cells))

    def file(self, sweep: PostedSweep, name: str) -> Path:
        """A file of a sweep that is done.

        Raises:
            NoFileError: if it is not, or has no file of that name.
        """
        path = self.store.results(sweep.id) / name
        if sweep.status != "done" or not path.is_file():
            raise NoFileError(f"sweep {sweep.id} is {sweep.status}: it has no {name}")
        return path


def admitted_sweep(data: Mapping[str, Any], limits: SweepLimits, choices: RobotChoices) -> Sweep:
    """The sweep of a mapping, if it is one and within the limits.

    Args:
        data: its mapping, with names of robots.
        limits: of sweeps.
        choices: robots that it may name; in the sweep stands what `load_robot` takes.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
    """
    check_size("sweep", data, MAX_VALUES)
    lists = [data[key] for key in ("robots", "parameters", "references") if isinstance(data.get(key), list)]
    nb_walks = math.prod(map(len, lists))
    if nb_walks > MAX_WALKS:
        raise InvalidValueError(
            "combinations of robots, parameters and references", nb_walks, f"must be at most {MAX_WALKS}"
        )
    robots = data.get("robots")
    if isinstance(robots, list):  # as names: a path would be one on our disk
        data = {**data, "robots": [choices.load(robot).source for robot in robots]}
    sweep = sweep_from_mapping(data)
    per_walk = sweep.nb_trials * sweep.pushes.directions * sweep.pushes.phases
    simulated = per_walk * OBSERVED + 2 * STEADY
    ticks = math.ceil(sum(simulated / walk.parameters.control_period for walk in sweep.walks))
    if ticks > limits.ticks:
        raise InvalidValueError("ticks of all trials", ticks, f"must be at most {limits.ticks}")
    return sweep
