"""Walks behind figures and report: the sample motion of section 6 by each scheme, varied, and timed."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from types import MappingProxyType

import numpy as np

from app.bench.bench import laps, planning_time
from app.jobs import JobPool
from app.settings import usable_cores
from walkcore import Parameters, Push, Recording, Robot, Scenario, load_robot, load_scenario, record, scenario_names
from walkcore.errors import UnknownNameError
from walkcore.mpc import schemes
from walkcore.robot import FootholdRegion
from walkcore.values import Vector, frozen_copy

SECTION_6 = "herdt-2010-section-6"
"""Beginning of the names of the scenarios with the sample motion, one for each robot that walks it."""
SCHEMES = ("speed_only", "speed_and_jerk", "full", "mean_velocity")
PAPER_PERIOD = Parameters().sampling_period  # [s]
HARD_PUSH = 0.22  # [m/s] that it adds to the velocity of the CoM: too much for the sole to take without a step
SPARE = 1.1  # of what a widened foothold region allows, over the reference speed
HEAVY = 100.0  # times the paper's weight of the speed, where little else is to count

AS_SHIPPED = "as it ships"
SPREAD = "feet may spread further"
TOUCH = "feet may touch"
SPREAD_HEAVY = "feet may spread further, and the speed weighs 100 times as much"


@dataclass(frozen=True, slots=True, eq=False)
class Variation:
    """The sample motion without the push, with the robot or the weights varied."""

    full: Recording
    """Walk by (19)."""
    mean_velocity: Recording
    """Walk by (31)."""


@dataclass(frozen=True, slots=True, eq=False)
class Walks:
    """All walks of one robot."""

    robot: Robot
    by_scheme: Mapping[str, Recording]
    """The sample motion; `full` with the body, where there is one: the other figures do not show it."""
    filtered: Recording | None
    """The sample motion by `full`, with the dynamic filter; None for a robot without a body."""
    analytic: Recording
    """The sample motion without its push, by the method of [11]."""
    without_push: Recording
    """The sample motion by `full`, without its push."""
    hard_push: Recording
    """The sample motion by `full`, with a push that calls for a step."""
    variations: Mapping[str, Variation]
    """Variations that might decide how fast the robot walks sideways, at the paper's period."""


def simulate(robot: str, control_period: float) -> Walks:
    """Simulate all walks of one robot, on all cores.

    Args:
        robot: name of a robot whose sample motion ships.
        control_period: of the sample motions [s].
    """
    motion = sample_motion(robot, control_period)
    motions = {scheme: using(motion, scheme) for scheme in SCHEMES}
    embodied = motions["full"] = replace(motion, robot=load_robot(robot))
    varied = {name: (scenario, using(scenario, "mean_velocity")) for name, scenario in _variations(robot).items()}
    filtered = replace(embodied, parameters=embodied.parameters.changed({"dynamic_filter": True}))
    filters = [filtered] if embodied.robot.body is not None else []
    analytic = using(pushed(motion, 0.0), "morisawa")
    scenarios = [*motions.values(), *filters, analytic, pushed(motion, 0.0), pushed(motion, HARD_PUSH)]
    scenarios += [scenario for pair in varied.values() for scenario in pair]
    with JobPool(usable_cores()) as pool:
        done = dict(pool.run([partial(record, scenario) for scenario in scenarios]))
        walked = iter([done[index].result() for index in range(len(scenarios))])
    return Walks(
        robot=embodied.robot,
        by_scheme={scheme: next(walked) for scheme in motions},
        filtered=next(walked) if filters else None,
        analytic=next(walked),
        without_push=next(walked),
        hard_push=next(walked),
        variations={name: Variation(next(walked), next(walked)) for name in varied},
    )


@cache
def sample_motions() -> Mapping[str, Scenario]:
    """The sample motions that ship, by the name of their robot, in its order."""
    shipped = [load_scenario(name) for name in scenario_names() if name.startswith(SECTION_6)]
    return MappingProxyType({motion.robot.name: motion for motion in sorted(shipped, key=lambda m: m.robot.name)})


def sample_motion(robot: str, control_period: float) -> Scenario:
    """The sample motion of section 6, by `full`, of a point mass with feet.

    Args:
        robot: name of a robot whose sample motion ships.
        control_period: time from one tick to the next [s].

    Raises:
        UnknownNameError: if no sample motion of that robot ships.
    """
    if robot not in sample_motions():
        raise UnknownNameError("robot with a sample motion", robot, list(sample_motions()))
    shipped = sample_motions()[robot]
    parameters = shipped.parameters.changed({"control_period": control_period})
    return replace(shipped, robot=replace(shipped.robot, body=None), parameters=parameters)


def using(scenario: Scenario, scheme: str) -> Scenario:
    """The same scenario by another scheme, with the horizon that its walk needs, of two steps at least."""
    per_step = scenario.parameters.timing.samples_per_step
    horizon = max(2 * per_step, schemes.SCHEMES[scheme].lasting_horizon(per_step))
    return replace(scenario, parameters=replace(scenario.parameters, scheme=scheme, horizon_samples=horizon))


def pushed(scenario: Scenario, velocity: float) -> Scenario:
    """The same scenario with another push to the left, or with none.

    Args:
        scenario: with a push.
        velocity: change of the CoM's velocity by the push [m/s]; zero removes the push.
    """
    push = Push(np.array([0.0, scenario.robot.mass * velocity])) if velocity > 0.0 else None
    events = tuple(event if event.push is None else replace(event, push=push) for event in scenario.events)
    return replace(scenario, events=events)


def _variations(robot: str) -> dict[str, Scenario]:
    motion = pushed(sample_motion(robot, PAPER_PERIOD), 0.0)
    p, sole, region = motion.parameters, motion.robot.sole, motion.robot.foothold_region
    reference = max(abs(event.reference.vy) for event in motion.events if event.reference is not None)
    near, far = float(region[:, 1].min()), float(region[:, 1].max())
    spread = _with_region(motion, near, max(far, near + SPARE * 2 * p.step_duration * reference))
    return {
        AS_SHIPPED: motion,
        SPREAD: spread,
        TOUCH: _with_region(motion, min(near, float(np.ptp(sole[:, 1]))), far),
        SPREAD_HEAVY: replace(spread, parameters=replace(p, beta=HEAVY * p.beta, delta=HEAVY * p.delta)),
    }


def _with_region(scenario: Scenario, near: float, far: float) -> Scenario:
    """The same scenario with a foothold region from `near` to `far` [m] beside the support foot."""
    region = scenario.robot.foothold_region.copy()
    y = region[:, 1]
    region[:, 1] = near + (y - y.min()) * (far - near) / np.ptp(y)
    anyhow = FootholdRegion(-math.pi, math.pi, frozen_copy(region))
    return replace(scenario, robot=replace(scenario.robot, foothold_regions=(anyhow,)))


@dataclass(frozen=True, slots=True, eq=False)
class SolveTimes:
    """Durations of assembling and solving, one for each QP of the sample motion at the paper's period."""

    full: Vector
    """Durations for (19), which previews two steps [s], shape (ticks,)."""
    mean_velocity: Vector
    """Durations for (31), which previews four [s], shape (ticks,)."""


def solve_times(robot: str) -> SolveTimes:
    """Measure by walking the sample motion once with each scheme, in this process alone: other work would count too."""
    motion = sample_motion(robot, PAPER_PERIOD)
    return SolveTimes(plan_durations(motion), plan_durations(using(motion, "mean_velocity")))


def plan_durations(scenario: Scenario) -> Vector:
    """Durations of assembling and solving at each tick of a scenario [s], shape (ticks,)."""
    return np.array([planning_time(tick) for tick in laps(scenario)])
