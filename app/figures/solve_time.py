"""How long it takes to assemble and solve a QP: measured alone, since other work on the machine would count too."""

from dataclasses import dataclass

import numpy as np

from app.bench.bench import laps, planning_time
from app.figures.walks import PAPER_PERIOD, sample_motion, using
from walkcore import Scenario
from walkcore.values import Vector


@dataclass(frozen=True, slots=True, eq=False)
class SolveTimes:
    """Durations of assembling and solving, one for each QP of the sample motion at the paper's period."""

    full: Vector
    """Of (19), which previews two steps [s]."""
    mean_velocity: Vector
    """Of (31), which previews four [s]."""


def solve_times(robot: str) -> SolveTimes:
    """Measure by walking the sample motion once with each scheme."""
    motion = sample_motion(robot, PAPER_PERIOD)
    return SolveTimes(plan_durations(motion), plan_durations(using(motion, "mean_velocity")))


def plan_durations(scenario: Scenario) -> Vector:
    """What assembling and solving take at each tick of a scenario [s]."""
    return np.array([planning_time(tick) for tick in laps(scenario)])
