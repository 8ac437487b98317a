"""Polygons on the ground as a reader sees them: corners in order, world frame."""

from itertools import pairwise

import numpy as np
from scipy.spatial import ConvexHull

from walkcore import Robot, Snapshot
from walkcore.gait import Footstep, Phase, Side
from walkcore.regions import sole_vertices
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
