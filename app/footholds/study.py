"""Safe footholds of a robot, on all cores.

The polygons depend on the samples and on the seed alone, not on the number of processes:
each trial starts from the same rest, and results come back in the order of the placements.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context

import numpy as np
from tqdm import tqdm

from walkcore import Robot, load_robot
from walkcore.errors import InvalidValueError
from walkcore.footholds.step_feasibility import Feasibility, StepFeasibility, placement_before
from walkcore.footholds.study import (
    edge_placements,
    safe_regions,
    sampled_placements,
    sampled_steps,
)
from walkcore.robot import FootholdRegion
from walkcore.values import Matrix, Vector

FEWEST_SAMPLES = 200  # below, a band of yaw has too few to enclose an area
SHARE_OF_STEPS = 0.25  # steps between different placements that are tried afterwards, for each placement
EDGE_SPACING = 0.03  # [m] between placements along the edges of the polygons
NB_REFINEMENTS = 2  # of the polygons, by what is found along their edges
CHUNK = 16  # trials that a process takes at a time

_trial: StepFeasibility  # of a worker process, set when it starts


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """What was tried, what came of it, and the regions that sum it up."""

    robot: str
    com_height: float
    """[m]."""
    nb_samples: int
    seed: int
    placements: Matrix
    """x, y [m], yaw [rad] of the left foot in the right foot's frame, shape (P, 3)."""
    outcomes: Sequence[Feasibility]
    """Of the placements, P of them."""
    regions: Sequence[FootholdRegion]
    """One for each band of yaw."""
    steps: Sequence[Feasibility]
    """Of steps between different placements of the regions."""

    @property
    def command(self) -> str:
        """That makes it again."""
        return (
            f"walk footholds {self.robot} --samples {self.nb_samples} --seed {self.seed}"
            f" --com-height {self.com_height:g}"
        )


def study(
    robot: Robot,
    com_height: float | None,
    nb_samples: int,
    seed: int,
    nb_workers: int,
    edge_spacing: float = EDGE_SPACING,
) -> Study:
    """Try placements, find the regions, and try steps between placements of the regions.

    Args:
        robot: with a body.
        com_height: [m]; None takes the robot's own.
        nb_samples: placements to try.
        seed: of the samples.
        nb_workers: processes.
        edge_spacing: between placements along the edges of the polygons [m].

    Raises:
        InvalidValueError: for a robot without a body, or too few samples.
        EmptyRegionError: if too few placements are safe.
    """
    if nb_samples < FEWEST_SAMPLES:
        raise InvalidValueError("samples", nb_samples, f"must be at least {FEWEST_SAMPLES}")
    height = StepFeasibility(robot, com_height).com_height  # what cannot be tried at all is told by this process
    placements = sampled_placements(nb_samples, seed)
    with _workers(robot.name, height, nb_workers) as pool:
        outcomes = _tried(pool, placements, "placements")
        regions = safe_regions(placements, outcomes, robot.stance_width)
        for _ in range(NB_REFINEMENTS):
            edges = edge_placements(regions, edge_spacing)
            outcomes += _tried(pool, edges, "edges")
            placements = np.vstack([placements, edges])
            regions = safe_regions(placements, outcomes, robot.stance_width)
        pairs = sampled_steps(regions, round(nb_samples * SHARE_OF_STEPS), seed)
        steps = list(tqdm(pool.map(_try_step, pairs, chunksize=CHUNK), "steps", len(pairs), disable=None))
    return Study(robot.name, height, nb_samples, seed, placements, outcomes, regions, steps)


def _tried(pool: ProcessPoolExecutor, placements: Matrix, label: str) -> list[Feasibility]:
    """What came of the placements, in their order."""
    outcomes = pool.map(_try_placement, placements, chunksize=CHUNK)
    return list(tqdm(outcomes, label, len(placements), disable=None))


@contextmanager
def _workers(robot: str, com_height: float, number: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that hold one `StepFeasibility` each; what has not begun is dropped when the block is left early."""
    pool = ProcessPoolExecutor(number, get_context("spawn"), partial(_start_worker, robot, com_height))
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def _start_worker(robot: str, com_height: float) -> None:
    global _trial
    _trial = StepFeasibility(load_robot(robot), com_height)


def _try_placement(placement: Vector) -> Feasibility:
    return _trial.placement(placement)


def _try_step(pair: Matrix) -> Feasibility:
    return _trial.step(placement_before(pair[0]), pair[1])
