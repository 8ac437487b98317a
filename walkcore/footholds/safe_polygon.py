"""A large convex polygon with few corners among points, some of which must stay outside.

Start from the hull of the points that may lie inside. While one that may not does,
cut it off along the line through it that leaves the most area. Then drop the corners
that cost the least, one by one: what a corner less leaves is a part of what was there,
so nothing gets in again.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, KDTree, QhullError

from walkcore.errors import EmptyRegionError
from walkcore.values import Matrix, Vector, frozen_copy

CLEARANCE = 5e-4  # [m] from the polygon to what must stay outside: more than rounding its corners moves an edge
NB_DIRECTIONS = 180  # of the lines tried for one cut
DECIMALS = 4  # of the corners [m]
ROUNDING = 1e-9  # [m] by which a corner of a hull may lie outside of it


def safe_polygon(allowed: Matrix, forbidden: Matrix, kept: Matrix, max_vertices: int) -> Matrix:
    """Corners of a convex polygon without any forbidden point, counter-clockwise, shape (V, 2) [m].

    Args:
        allowed: points whose hull is not left, shape (A, 2) [m].
        forbidden: points that stay outside, shape (F, 2) [m].
        kept: points that stay inside, shape (K, 2) [m].
        max_vertices: largest V, at least 3 + K.

    Raises:
        EmptyRegionError: if the allowed points enclose no area around those kept, or no line cuts off a forbidden one.
    """
    try:
        corners = allowed[ConvexHull(allowed).vertices]
    except (QhullError, ValueError) as error:
        raise EmptyRegionError(f"{len(allowed)} points enclose no area") from error
    if not np.all(inside(corners, kept, ROUNDING)):
        raise EmptyRegionError("a point to keep lies outside of what is allowed")
    left = forbidden[inside(corners, forbidden, CLEARANCE / 2)]
    while len(left):
        nearest = left[np.argmin(np.linalg.norm(left - np.mean(kept, axis=0), axis=1))]
        corners = _cut(corners, nearest, kept)
        left = left[inside(corners, left, CLEARANCE / 2)]
    while len(corners) > max_vertices:
        corners = _without_cheapest_corner(corners, kept)
    return frozen_copy(np.round(corners, DECIMALS))


def deepest(allowed: Matrix, forbidden: Matrix) -> Vector:
    """The allowed point that is the furthest from all forbidden ones, shape (2,) [m].

    Args:
        allowed: points, shape (P, 2) [m].
        forbidden: points, shape (F, 2) [m].

    Raises:
        EmptyRegionError: if none is allowed.
    """
    if not len(allowed):
        raise EmptyRegionError("no point is allowed")
    if not len(forbidden):
        return np.mean(allowed, axis=0)
    return allowed[np.argmax(KDTree(forbidden).query(allowed)[0])]


def inside(corners: Matrix, points: Matrix, margin: float = 0.0) -> NDArray[np.bool_]:
    """Whether each point lies in a polygon, on its edge, or up to a margin beyond; shape (P,).

    Args:
        corners: of the polygon, counter-clockwise, shape (V, 2) [m].
        points: shape (P, 2) [m].
        margin: [m].
    """
    along = np.roll(corners, -1, axis=0) - corners
    to_point = points[:, None, :] - corners[None]
    depth = (along[:, 0] * to_point[..., 1] - along[:, 1] * to_point[..., 0]) / np.linalg.norm(along, axis=1)
    return np.all(depth >= -margin, axis=1)


def area(corners: Matrix) -> float:
    """Area of a polygon [m^2].

    Args:
        corners: counter-clockwise, shape (V, 2) [m].
    """
    x, y = corners.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2


def intersection(polygons: Sequence[Matrix]) -> Matrix:
    """Corners of the intersection of convex polygons, counter-clockwise, shape (V, 2) [m].

    Args:
        polygons: the corners of each, counter-clockwise, shape (V, 2) [m].

    Raises:
        EmptyRegionError: if they have nothing in common.
    """
    corners = polygons[0]
    for other in polygons[1:]:
        for p, q in zip(other, np.roll(other, -1, axis=0), strict=True):
            outwards = np.array([q[1] - p[1], p[0] - q[0]]) / np.linalg.norm(q - p)
            corners = _clipped(corners, outwards, float(outwards @ p))
    if not len(corners):
        raise EmptyRegionError("the polygons have nothing in common")
    return frozen_copy(np.round(corners, DECIMALS))


def _clipped(corners: Matrix, normal: Vector, bound: float) -> Matrix:
    """The part of a convex polygon with normal @ p <= bound, shape (V', 2)."""
    excess = corners @ normal - bound
    kept: list[Vector] = []
    for p, q, over_p, over_q in zip(corners, np.roll(corners, -1, axis=0), excess, np.roll(excess, -1), strict=True):
        if over_p <= 0.0:
            kept.append(p)
        if over_p * over_q < 0.0:
            kept.append(p + (q - p) * over_p / (over_p - over_q))
    return np.array(kept).reshape(-1, 2)


def _cut(corners: Matrix, point: Vector, kept: Matrix) -> Matrix:
    """The largest part that a line beside `point` leaves around `kept`.

    Raises:
        EmptyRegionError: if they are too close for a line to pass between them.
    """
    parts: list[Matrix] = []
    for angle in np.arange(NB_DIRECTIONS) * 2 * math.pi / NB_DIRECTIONS:
        normal = np.array([math.cos(angle), math.sin(angle)])
        bound = float(normal @ point) - CLEARANCE
        if np.all(kept @ normal <= bound - CLEARANCE):
            parts.append(_clipped(corners, normal, bound))
    if not parts:
        raise EmptyRegionError(
            f"({point[0]:.3f}, {point[1]:.3f}) m to leave out cannot be cut off from the points to keep"
        )
    return max(parts, key=area)


def _without_cheapest_corner(corners: Matrix, kept: Matrix) -> Matrix:
    """The polygon without one corner, the one that costs least among those whose loss spares the points kept."""
    remaining = [np.delete(corners, k, axis=0) for k in range(len(corners))]
    return max((part for part in remaining if np.all(inside(part, kept, ROUNDING))), key=area)
