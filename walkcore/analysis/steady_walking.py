"""Steady walking: mean velocity over whole gait cycles against the reference, which the sway within a cycle hides."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from walkcore.analysis.columns import (
    Walk,
    heading,
    heading_velocity,
    nb_rows_up,
    nb_ticks_of_step,
    push_rows,
    reference_changes,
    timing_changes,
)
from walkcore.mpc.gait import Phase


@dataclass(frozen=True, slots=True)
class SteadyWalk:
    """Whole gait cycles of stepping under one reference, a cycle after the last change or push."""

    start: float
    """[s]."""
    end: float
    """[s]."""
    cycles: int
    reference: tuple[float, float, float]
    """vx, vy [m/s], yaw_rate [rad/s]."""
    mean_velocity: tuple[float, float, float]
    """The same of the CoM in the robot's heading frame, and of the heading."""

    @property
    def velocity_error(self) -> float:
        """Distance of the mean velocity from the reference [m/s]."""
        return float(np.hypot(*np.subtract(self.mean_velocity, self.reference)[:2]))

    @property
    def yaw_rate_error(self) -> float:
        """Distance of the mean yaw rate from the reference [rad/s]."""
        return abs(self.mean_velocity[2] - self.reference[2])


def steady_walks(walk: Walk) -> list[SteadyWalk]:
    """The steady walks of a walk, in the order of time."""
    velocity, yaw, t = heading_velocity(walk), heading(walk), walk["t"]
    vx, vy, yaw_rate = (walk[f"reference_{name}"] for name in ("vx", "vy", "yaw_rate"))
    found: list[SteadyWalk] = []
    for first, end in _stretches(walk):
        cycle = 2 * nb_ticks_of_step(walk, first)
        nb_cycles = (end - first) // cycle - 1
        if nb_cycles < 1:
            continue
        rows = slice(end - nb_cycles * cycle, end)
        turned = (yaw[end] - yaw[rows.start]) / (t[end] - t[rows.start])
        found.append(
            SteadyWalk(
                float(t[rows.start]),
                float(t[end]),
                nb_cycles,
                (float(vx[first]), float(vy[first]), float(yaw_rate[first])),
                (float(velocity[rows, 0].mean()), float(velocity[rows, 1].mean()), float(turned)),
            )
        )
    return found


def _stretches(walk: Walk) -> Iterator[tuple[int, int]]:
    """First and last row of each stretch in which the robot steps and nothing changes."""
    pushes = [row for rows in push_rows(walk) for row in rows]
    is_stepping = walk["phase"] != Phase.STANDING
    turns = np.flatnonzero(np.diff(is_stepping)) + 1
    last = nb_rows_up(walk) - 1
    changes = np.concatenate([reference_changes(walk), timing_changes(walk), turns])
    bounds = sorted({0, last, *changes.tolist(), *(min(row, last) for row in pushes)})
    for first, end in pairwise(bounds):
        if is_stepping[first] and end <= last:
            yield first, end
