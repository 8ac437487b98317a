"""Safe placements of the left foot, seen from the right one: section 5.

Thousands of placements are simulated, each as a step of a walk whose every step mirrors the
one before, and summed up in one convex polygon for each band of yaw, inside of which each
simulated placement was safe. The right foot is the left one's mirror image, and so is what is found.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from walkcore.errors import EmptyRegionError
from walkcore.footholds.safe_polygon import deepest, inside, intersection, safe_polygon
from walkcore.footholds.step_feasibility import Feasibility
from walkcore.mpc.orientation import MAX_TOE_IN, MAX_TOE_OUT
from walkcore.robot import FootholdRegion, Robot
from walkcore.values import Matrix

LOWEST, HIGHEST = (-0.56, 0.12), (0.56, 0.56)  # [m] placements tried; closer where the soles are narrower
YAW_BANDS = (-MAX_TOE_IN, -0.03, 0.03, 0.15, 0.30, MAX_TOE_OUT)  # [rad] edges; in the second one a robot walks straight
MAX_VERTICES = 7  # of a polygon
SPARE_PLACEMENTS = 8  # sampled for each step that is tried: enough of them lie in the regions


def contains(region: FootholdRegion, placements: Matrix) -> NDArray[np.bool_]:
    """Whether each placement lies in a region; shape (P,).

    Args:
        region: of the left foot.
        placements: x, y [m], yaw [rad] of the left foot in the right foot's frame, shape (P, 3).
    """
    yaw = placements[:, 2]
    is_in_band = (region.lowest_yaw <= yaw) & (yaw <= region.highest_yaw)
    return is_in_band & inside(region.vertices, placements[:, :2])


def closest_placement(robot: Robot) -> float:
    """Least y of a placement that is tried [m]: parallel soles touch there, or further out for wide soles."""
    return min(LOWEST[1], float(np.ptp(robot.sole[:, 1])))


def sampled_placements(nb_samples: int, seed: int, closest: float = LOWEST[1]) -> Matrix:
    """Placements x, y [m], yaw [rad] of the left foot in the right foot's frame, shape (nb_samples, 3).

    Evenly spread over the plane, and over the bands of yaw, each of which has as many.

    Args:
        nb_samples: number of placements.
        seed: the same seed gives the same placements.
        closest: least y [m].
    """
    unit = qmc.Halton(3, rng=np.random.default_rng(seed)).random(nb_samples)
    yaw = np.interp(unit[:, 2], np.linspace(0.0, 1.0, len(YAW_BANDS)), YAW_BANDS)
    return np.column_stack([qmc.scale(unit[:, :2], (LOWEST[0], closest), HIGHEST), yaw])


def safe_regions(placements: Matrix, outcomes: Sequence[Feasibility], stance_width: float) -> list[FootholdRegion]:
    """One polygon for each band of yaw, inside of which each simulated placement was safe.

    Args:
        placements: x, y [m], yaw [rad], shape (P, 3).
        outcomes: feasibility of each; P of them.
        stance_width: [m]; a standing robot lies inside of the band of straight feet.

    Raises:
        EmptyRegionError: if too few placements of a band were safe.
    """
    is_safe = np.array([outcome is Feasibility.SAFE for outcome in outcomes])
    regions: list[FootholdRegion] = []
    for low, high in pairwise(YAW_BANDS):
        is_in_band = (low <= placements[:, 2]) & (placements[:, 2] <= high)
        safe, unsafe = placements[is_in_band & is_safe, :2], placements[is_in_band & ~is_safe, :2]
        try:
            kept = [deepest(safe, unsafe)] + ([np.array([0.0, stance_width])] if low < 0.0 < high else [])
            vertices = safe_polygon(safe, unsafe, np.array(kept), MAX_VERTICES)
        except EmptyRegionError as error:
            where = (
                f"yaws of {low:g} to {high:g} rad, where {len(safe)} of {len(safe) + len(unsafe)} placements were safe"
            )
            raise EmptyRegionError(
                f"no region for {where}: {error}; try more samples, or another com_height"
            ) from error
        regions.append(FootholdRegion(low, high, vertices))
    return regions


def edge_placements(regions: Sequence[FootholdRegion], spacing: float) -> Matrix:
    """Placements along the edges of the regions, with the least and the largest yaw of each band, shape (P, 3).

    Where these are safe, little can be wrong further inside.

    Args:
        regions: V corners each.
        spacing: largest distance between neighbours on an edge [m].
    """
    placements: list[Matrix] = []
    for region in regions:
        corners = region.vertices
        for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            nb_points = math.ceil(float(np.linalg.norm(q - p)) / spacing)
            points = p + np.arange(nb_points)[:, None] / nb_points * (q - p)
            placements += [np.insert(points, 2, yaw, axis=1) for yaw in (region.lowest_yaw, region.highest_yaw)]
    return np.concatenate(placements)


def sampled_steps(regions: Sequence[FootholdRegion], nb_samples: int, seed: int, closest: float = LOWEST[1]) -> Matrix:
    """Pairs of new placements within the regions, as a walk may take them in turn, shape (nb_samples, 2, 3).

    The first of a pair is the right foot's, mirrored.

    Raises:
        EmptyRegionError: if no placement lies in a region.
    """
    placements = sampled_placements(SPARE_PLACEMENTS * nb_samples, seed + 1, closest)
    placements = placements[np.any([contains(region, placements) for region in regions], axis=0)]
    if not len(placements):
        raise EmptyRegionError("no placement lies in a region")
    return np.random.default_rng(seed).choice(placements, size=(nb_samples, 2))


def common_vertices(regions: Sequence[FootholdRegion]) -> Matrix:
    """Corners of the region that is safe whatever the yaw, shape (V, 2) [m].

    Raises:
        EmptyRegionError: if there is nothing.
    """
    return intersection([region.vertices for region in regions])
