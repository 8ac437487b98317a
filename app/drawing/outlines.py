"""What a snapshot means on the ground: polygons with their corners in order, world frame, and what carries its plan."""

from itertools import pairwise

import numpy as np
from scipy.spatial import ConvexHull

from walkcore import Parameters, Robot, Snapshot
from walkcore.mpc.gait import Phase
from walkcore.mpc.stance import Footstep, Side, sole_vertices
from walkcore.values import Matrix, rotation


def support_polygon(robot: Robot, snapshot: Snapshot) -> Matrix:
    """What the robot stands on: the support sole, or the hull of both, shape (V, 2) [m]."""
    if snapshot.phase is Phase.SINGLE_SUPPORT:
        return sole_vertices(robot.sole, snapshot.support)
    feet = [Footstep(side, snapshot.feet[side].position, snapshot.feet[side].yaw) for side in Side]
    corners = np.vstack([sole_vertices(robot.sole, foot) for foot in feet])
    return corners[ConvexHull(corners).vertices]


def foothold_regions(robot: Robot, snapshot: Snapshot) -> list[Matrix]:
    """Where each foothold of the plan may lie, given its predecessor; shapes (V, 2) [m]."""
    footholds = snapshot.plan.footholds if snapshot.plan is not None else ()
    return [
        before.position + robot.foothold_region_at(foothold.yaw - before.yaw, foothold.side) @ rotation(before.yaw).T
        for before, foothold in pairwise((snapshot.support, *footholds))
    ]


def carriers(snapshot: Snapshot, parameters: Parameters) -> list[tuple[Footstep, ...]]:
    """What carries each sample of the snapshot's plan: one foot, or two side by side.

    Samples up to the touchdown stand on the support foot, after some on both feet where the robot begins
    to walk; each foothold then carries a step's samples, and the last one of a stop carries with its neighbour.
    """
    plan = snapshot.plan
    assert plan is not None
    other = snapshot.support.side.other
    beside = Footstep(other, snapshot.feet[other].position, snapshot.feet[other].yaw)
    nb_samples = len(plan.times)
    before = nb_samples
    if np.isfinite(snapshot.time_to_touchdown):
        before = int(np.count_nonzero(plan.times < snapshot.time_to_touchdown + 1e-6))
    alone = min(snapshot.samples_on_support, before)
    both = (snapshot.support, beside)
    result: list[tuple[Footstep, ...]] = [both] * (before - alone) + [(snapshot.support,)] * alone
    feet = (snapshot.support, *plan.footholds)
    for k, foot in enumerate(plan.footholds, start=1):
        ends = k == snapshot.steps_to_stand
        # The last one carries all that is left, also where the step under way is longer than those to come.
        count = nb_samples if k == len(plan.footholds) else parameters.timing.samples_per_step
        result += [(foot, feet[k - 1]) if ends else (foot,)] * count
    return result[:nb_samples]


def is_caught(robot: Robot, snapshot: Snapshot, parameters: Parameters) -> bool:
    """Whether a plan leads on: no leg would have to be longer than it is, and further steps can catch its end."""
    plan = snapshot.plan
    if plan is None or not plan.is_capturable:
        return False
    feet = [feet[0].position for feet in carriers(snapshot, parameters)]
    return bool(np.all(np.linalg.norm(plan.com - feet, axis=1) <= robot.max_com_distance))
