"""How long it takes to assemble and solve a QP: measured alone, since other work on the machine would count too."""

import time
from dataclasses import dataclass

import numpy as np

from app.figures.walks import PAPER_PERIOD, sample_motion, using
from walkcore import Scenario, Simulation
from walkcore.gait import Footstep, Gait
from walkcore.pattern_generator import PatternGenerator
from walkcore.values import Vector


@dataclass(frozen=True, slots=True, eq=False)
class SolveTimes:
    """Durations of assembling and solving, one for each QP of the sample motion at the paper's period."""

    full: Vector
    """Of (19), which previews two steps [s]."""
    mean_speed: Vector
    """Of (31), which previews four [s]."""


def solve_times(robot: str) -> SolveTimes:
    """Measure by walking the sample motion once with each scheme."""
    motion = sample_motion(robot, PAPER_PERIOD)
    return SolveTimes(plan_durations(motion), plan_durations(using(motion, "mean_speed")))


def plan_durations(scenario: Scenario) -> Vector:
    """What the pattern generator takes at each tick of a scenario that walks from its beginning on [s]."""
    robot, p = scenario.robot, scenario.parameters
    simulation, generator = Simulation(robot, p), PatternGenerator(robot, p)
    durations: list[float] = []
    gait: Gait | None = None
    for command in scenario.commands():
        s = simulation.step(command)
        if s.plan is None:
            break
        gait = gait or Gait(p, s.support.side, p.samples_before_first_step)
        side = s.support.side.other
        swing = Footstep(side, s.feet[side].position, s.feet[side].yaw)
        horizon = gait.horizon(s.tick)
        start = time.perf_counter()
        plan = generator.plan(s.com, s.support, swing, horizon, s.reference, s.heading)
        durations.append(time.perf_counter() - start)
        assert np.array_equal(plan.jerks[0], s.jerk), "timed another QP than the one that the robot walked by"
    return np.array(durations)
