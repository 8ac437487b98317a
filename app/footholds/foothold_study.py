"""Safe footholds of a robot, on all cores.

The polygons depend on the samples and on the seed alone, not on the number of processes:
each trial starts from the same rest, and its outcome stands in the order of the placements.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from tqdm import tqdm

from app.jobs import JobPool, Report
from walkcore import Robot, load_robot
from walkcore.errors import InvalidValueError
from walkcore.footholds.step_feasibility import Feasibility, StepFeasibility, placement_before
from walkcore.footholds.study import (
    closest_placement,
    edge_placements,
    safe_regions,
    sampled_placements,
    sampled_steps,
)
from walkcore.mpc.balance_sets import step_durations
from walkcore.robot import FootholdRegion
from walkcore.values import Matrix, Vector

FEWEST_SAMPLES = 200  # below, a band of yaw has too few to enclose an area
SHARE_OF_STEPS = 0.25  # steps between different placements that are tried afterwards, for each placement
EDGE_SPACING = 0.03  # [m] between placements along the edges of the polygons
NB_REFINEMENTS = 2  # of the polygons, by what is found along their edges
CHUNK = 16  # trials that a process takes at a time


@dataclass(frozen=True, slots=True, eq=False)
class FootholdStudy:
    """Placements and steps that were tried, their outcomes, and the regions that sum them up."""

    robot: Robot
    com_height: float
    """Height of the CoM [m]."""
    nb_samples: int
    seed: int
    placements: Matrix
    """x, y [m], yaw [rad] of the left foot in the right foot's frame, shape (P, 3)."""
    outcomes: Sequence[Feasibility]
    """Outcomes of the placements, P of them."""
    regions: Sequence[FootholdRegion]
    """Safe regions, one for each band of yaw."""
    steps: Sequence[Feasibility]
    """Outcomes of steps between different placements of the regions."""
    short_steps: Sequence[Feasibility]
    """Outcomes of the shortest steps that adaptive step timing takes, between those of them that the foot can reach."""
    shortest_step_duration: float
    """[s]."""

    @property
    def command(self) -> str:
        """Command line that reproduces this study."""
        return (
            f"walk footholds {self.robot.source} --samples {self.nb_samples} --seed {self.seed}"
            f" --com-height {self.com_height:g}"
        )


def study(
    robot: Robot,
    com_height: float | None,
    nb_samples: int,
    seed: int,
    nb_workers: int,
    edge_spacing: float = EDGE_SPACING,
) -> FootholdStudy:
    """Try placements, find the regions, and try steps between placements of the regions.

    Args:
        robot: with a body.
        com_height: height of the CoM [m]; None takes the robot's own.
        nb_samples: placements to try.
        seed: of the samples.
        nb_workers: number of processes.
        edge_spacing: between placements along the edges of the polygons [m].

    Raises:
        InvalidValueError: for a robot without a body, or too few samples.
        EmptyRegionError: if too few placements are safe.
    """
    if nb_samples < FEWEST_SAMPLES:
        raise InvalidValueError("samples", nb_samples, f"must be at least {FEWEST_SAMPLES}")
    height = StepFeasibility(robot, com_height).com_height  # fails here for what cannot be tried at all
    try_placement, try_pair = (partial(function, robot.source, height) for function in (_try_placement, _try_pair))
    closest = closest_placement(robot)
    placements = sampled_placements(nb_samples, seed, closest)
    with JobPool(nb_workers) as pool:
        outcomes = _outcomes(pool, try_placement, placements, "placements")
        regions = safe_regions(placements, outcomes, robot.stance_width)
        for _ in range(NB_REFINEMENTS):
            edges = edge_placements(regions, edge_spacing)
            outcomes += _outcomes(pool, try_placement, edges, "edges")
            placements = np.vstack([placements, edges])
            regions = safe_regions(placements, outcomes, robot.stance_width)
        pairs = sampled_steps(regions, round(nb_samples * SHARE_OF_STEPS), seed, closest)
        steps = _outcomes(pool, try_pair, pairs, "steps")
        shortest = step_durations(robot.parameters)[-1]
        short = StepFeasibility(robot, height, shortest)
        reachable = [short.flies_in_time(placement_before(first), second) for first, second in pairs]
        try_short = partial(_try_pair, robot.source, height, step_duration=shortest)
        short_steps = _outcomes(pool, try_short, pairs[reachable], "short steps")
    return FootholdStudy(robot, height, nb_samples, seed, placements, outcomes, regions, steps, short_steps, shortest)


def _outcomes(pool: JobPool, try_step: "partial[Feasibility]", steps: Matrix, label: str) -> list[Feasibility]:
    """Outcomes of some steps, in their order, with a progress bar on a terminal.

    Args:
        pool: of processes.
        try_step: finds the outcome of one step.
        steps: to be tried, one along the first axis.
        label: of the progress bar.
    """
    chunks = [steps[start : start + CHUNK] for start in range(0, len(steps), CHUNK)]
    found: dict[int, list[Feasibility]] = {}
    with tqdm(total=len(steps), desc=label, disable=None) as bar:
        for index, done in pool.run([partial(_try_all, try_step, chunk) for chunk in chunks]):
            found[index] = done.result()
            bar.update(len(chunks[index]))
    return [outcome for index in range(len(chunks)) for outcome in found[index]]


def _try_all(try_step: "partial[Feasibility]", steps: Matrix, _: Report) -> list[Feasibility]:
    return [try_step(step) for step in steps]


@cache
def _feasibility(robot: str, com_height: float, step_duration: float | None = None) -> StepFeasibility:
    """The trials of a robot, made once in each process."""
    return StepFeasibility(load_robot(robot), com_height, step_duration)


def _try_placement(robot: str, com_height: float, placement: Vector) -> Feasibility:
    return _feasibility(robot, com_height).placement(placement)


def _try_pair(robot: str, com_height: float, pair: Matrix, step_duration: float | None = None) -> Feasibility:
    return _feasibility(robot, com_height, step_duration).step(placement_before(pair[0]), pair[1])
