"""The sets of the DCM from which the coming steps catch the robot, for each duration that these may have.

They depend on robot and parameters alone and take most of the time that a change of parameters takes, so a caller may
compute them beforehand, elsewhere, and give them to the pattern generator.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from walkcore.mpc.capture import StepTiming, strides, viable_polygons, viable_vertices
from walkcore.mpc.regions import HalfPlanes, shrunk
from walkcore.mpc.stance import Side
from walkcore.mpc.viability import Allowance, ViableSets, viable_sets
from walkcore.parameters import Parameters
from walkcore.robot import Robot

SHORTER_STEPS = (0.6, 0.5, 0.4)  # [s]
SHORTEST_SWING = 0.3  # [s]
OVERSHOOT = 5e-3  # [m] of the margin that is never given up: between samples the CoP bulges by up to T^2/8 ddc
CAREFUL, USUAL, UTMOST = range(3)
"""Numbers of the allowances by which touchdowns are compared: part of the regions, all that the paper's QP may use, and
the whole soles."""
TIGHTENING = 0.6  # fraction of the foothold region that a plan which had to be corrected may count on after its end


@dataclass(frozen=True, slots=True, eq=False)
class CaptureSets:
    """Capturable states of the DCM, each as `viable_polygons` has them; they take most of the time of a change."""

    viable: Mapping[Side, tuple[HalfPlanes, ...]]
    """By steps that keep all margins."""
    tight: Mapping[Side, tuple[HalfPlanes, ...]]
    """By steps that keep all margins and use part of the foothold region only."""
    on_whole_soles: Mapping[Side, tuple[HalfPlanes, ...]]
    """By steps that use the whole soles."""


def capture_sets(robot: Robot, parameters: Parameters, step_duration: float | None = None) -> CaptureSets:
    """The capturable states of a robot with some parameters; the same object where these decide the same.

    Args:
        robot: whose soles, regions and foot speed count.
        parameters: with margin and timing.
        step_duration: of the coming steps [s]; by default that of the parameters.

    Raises:
        EmptyRegionError: if the margin leaves nothing of the sole.
    """
    p = parameters
    single_support = (p.step_duration if step_duration is None else step_duration) - p.double_support_duration
    timing = StepTiming(p.double_support_duration, single_support, robot.pendulum(p).omega)
    return _capture_sets(robot, p.cop_margin, timing)


@lru_cache(maxsize=32)  # adaptive step timing has four durations of the coming steps
def _capture_sets(robot: Robot, margin: float, timing: StepTiming) -> CaptureSets:
    whole = robot.foothold_region
    region, part = (strides(r, robot.max_foot_speed, timing) for r in (whole, shrunk(whole, TIGHTENING)))
    return CaptureSets(
        *(
            viable_polygons(viable_vertices(robot.sole, margin, vertices, timing))
            for margin, vertices in ((margin, region), (margin, part), (0.0, region))
        )
    )


@dataclass(frozen=True, slots=True, eq=False)
class BalanceSets:
    """The sets for one robot and some parameters."""

    capture: Mapping[float, CaptureSets]
    """By the duration of the coming steps [s]."""
    viable: ViableSets
    """For steps of the usual duration that keep the margin."""
    compared: ViableSets | None
    """For all durations and allowances by which adaptive step timing compares touchdowns; None where it is off."""


def balance_sets(robot: Robot, parameters: Parameters) -> BalanceSets:
    """The sets for a robot with some parameters.

    Args:
        robot: whose soles, regions and foot speed count.
        parameters: with margin and timing.

    Raises:
        EmptyRegionError: if the margin leaves nothing of the sole.
    """
    p, margin = parameters, parameters.cop_margin
    durations = step_durations(p) if has_adaptive_steps(p) else (p.step_duration,)
    omega = robot.pendulum(p).omega
    careful, usual, utmost = Allowance(margin, TIGHTENING), Allowance(margin), Allowance(min(OVERSHOOT, margin))
    T = p.double_support_duration
    return BalanceSets(
        {duration: capture_sets(robot, p, duration) for duration in durations},
        viable_sets(robot, (usual,), (p.step_duration,), T, omega),
        viable_sets(robot, (careful, usual, utmost), durations, T, omega) if has_adaptive_steps(p) else None,
    )


def has_adaptive_steps(parameters: Parameters) -> bool:
    """Whether steps may end sooner; a scheme whose QP does not choose the footholds has no use for it."""
    return parameters.step_timing == "adaptive" and not parameters.formulation.has_planned_footholds


def shortest_step(parameters: Parameters) -> int:
    """Samples of the shortest step whose touchdown lies on the grid of its beginning."""
    return math.ceil(SHORTEST_SWING / parameters.sampling_period - 1e-9) + 1


def samples_to_choose_from(parameters: Parameters) -> tuple[int, ...]:
    """Samples that each of the coming steps may take, the usual number first, then ever fewer."""
    usual, shortest = parameters.timing.samples_per_step, shortest_step(parameters)
    shorter = {round(duration / parameters.sampling_period) for duration in SHORTER_STEPS}
    return (usual, *sorted((n for n in shorter if shortest <= n < usual), reverse=True))


def step_durations(parameters: Parameters) -> tuple[float, ...]:
    """Durations that each of the coming steps may have, the usual one first [s]."""
    return tuple(round(n * parameters.sampling_period, 9) for n in samples_to_choose_from(parameters))
