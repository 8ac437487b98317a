"""All sweeps that were posted to a server, for its routes: admitted, queued as runs are, handed out, cancelled."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import Any

from app.robot_choices import RobotChoices
from app.runs.queue import RunQueue
from app.runs.run import NoRecordingError, RunsUnavailableError
from app.sweeps.engine import SweepProgress
from app.sweeps.posted_sweep import PostedSweep, PostedSweepStore
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


class PostedSweeps:
    """All sweeps of one server: one at a time, by a process behind the live walk. May be called from any thread."""

    def __init__(self, folder: Path, limits: SweepLimits, choices: RobotChoices | None = None) -> None:
        """Read the folder.

        Args:
            folder: where sweeps are kept, which no other server has.
            limits: of sweeps.
            choices: robots that a sweep may name; by default those that ship.
        """
        self.limits, self._choices = limits, choices or RobotChoices()
        self._store = PostedSweepStore(folder)
        self._queue = RunQueue(self._store, 1, on_end=lambda: self._store.trim(limits.kept))
        self._admission = Lock()

    def start(self) -> None:
        """Begin with the queued sweeps, those among them that were under way when the last server ended."""
        self._queue.start()

    def stop(self) -> None:
        """End the process; the next server goes on with the sweep that was under way."""
        self._queue.stop()

    def submit(self, data: Mapping[str, Any]) -> PostedSweep:
        """Take in a sweep, to be walked when those before it have ended.

        Raises:
            InvalidValueError: if it is no sweep, or beyond a limit.
            RunsUnavailableError: if too many wait already, or the disk takes no more.
        """
        sweep = admitted_sweep(data, self.limits, self._choices)
        with self._admission:
            if self._store.nb_queued() >= self.limits.queued:
                raise RunsUnavailableError(f"{self.limits.queued} sweeps wait already")
            added = self._store.add(sweep.source, sweep.nb_cells)
        self._queue.wake()
        return added

    def get(self, sweep_id: str) -> PostedSweep:
        """The present state of a sweep.

        Raises:
            UnknownRunError: if there is none of that id.
        """
        return self._with_progress(self._store.get(sweep_id))

    def list(self) -> list[PostedSweep]:
        """All sweeps, the latest first."""
        return [self._with_progress(sweep) for sweep in self._store.list()]

    def delete(self, sweep_id: str) -> PostedSweep:
        """Cancel a sweep that has not ended, its process included; remove one that has.

        Returns:
            The sweep as it was: one that had not ended is kept, as cancelled.

        Raises:
            UnknownRunError: if there is none of that id.
            RunsUnavailableError: if its files cannot be removed.
        """
        sweep = self._store.get(sweep_id)
        if self._store.cancel(sweep_id):
            self._queue.cancel(sweep_id)
        else:
            self._store.remove(sweep_id)
        return sweep

    def file(self, sweep: PostedSweep, name: str) -> Path:
        """A file of a sweep that is done.

        Raises:
            NoRecordingError: if it is not, or has no file of that name.
        """
        path = self._store.results(sweep.id) / name
        if sweep.status != "done" or not path.is_file():
            raise NoRecordingError(f"sweep {sweep.id} is {sweep.status}: it has no {name}")
        return path

    def _with_progress(self, sweep: PostedSweep) -> PostedSweep:
        progress = self._queue.progress(sweep.id) if sweep.status == "running" else None
        if not isinstance(progress, SweepProgress):
            return sweep
        return replace(sweep, nb_done=progress.nb_done, time_left=progress.time_left)


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
