"""Convex polygons as rows  lower <= n . p <= upper  on a point p of the plane.

The support polygon of the CoP (26), the region of a foothold (section 5) and the
reach of the foot in the air (30) are all of this form. Opposite parallel edges share
one row with two bounds, which halves the rows of the QP for a rectangular sole.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from walkcore.errors import EmptyRegionError
from walkcore.values import Matrix, Vector, frozen_copy, rotation

PARALLEL = 1e-10  # between unit normals, up to which edges share a row; the one that gives its own up moves by no more


@dataclass(frozen=True, slots=True, eq=False)
class HalfPlanes:
    """The points p with lower <= normals @ p <= upper."""

    normals: Matrix
    """Unit normals of the edges, shape (E, 2)."""
    lower: Vector
    """[m], shape (E,); minus infinity where an edge has no parallel opposite."""
    upper: Vector
    """[m], shape (E,)."""

    def inset(self, margin: float) -> "HalfPlanes":
        """The part of the polygon that keeps a margin from its edges.

        Args:
            margin: [m].

        Raises:
            EmptyRegionError: if a pair of parallel edges leaves nothing between them.
        """
        lower, upper = self.lower + margin, self.upper - margin
        if np.any(lower > upper):
            width = np.min(self.upper - self.lower)
            raise EmptyRegionError(f"a margin of {margin} m leaves nothing of a polygon {width} m wide")
        return HalfPlanes(self.normals, lower, upper)

    def rotated(self, yaw: float) -> "HalfPlanes":
        """The same polygon turned about the origin.

        Args:
            yaw: counter-clockwise [rad].
        """
        return _rotated(self, yaw)

    def fraction_inside(self, start: Vector, move: Vector) -> float:
        """Fraction of a move from a point inside that stays inside, in [0, 1].

        Args:
            start: the point, in the frame of the polygon [m], shape (2,).
            move: from there [m], shape (2,).
        """
        at, along = self.normals @ start, self.normals @ move
        distance = np.where(along > 0.0, self.upper - at, self.lower - at)
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.clip(np.min(np.where(np.abs(along) > 1e-12, distance / along, np.inf)), 0.0, 1.0))

    def excess(self, point: Vector) -> float:
        """Distance of a point from the polygon [m]; inside, that to the nearest edge as a negative number.

        Args:
            point: in the frame of the polygon [m], shape (2,).
        """
        along = self.normals @ point
        return float(np.maximum(self.lower - along, along - self.upper).max())


@lru_cache(maxsize=256)  # a foot keeps its yaw for a step
def _rotated(planes: HalfPlanes, yaw: float) -> HalfPlanes:
    return HalfPlanes(frozen_copy(planes.normals @ rotation(yaw).T), planes.lower, planes.upper)


def half_planes(vertices: ArrayLike) -> HalfPlanes:
    """The convex hull of points in the plane, shape (V, 2) [m].

    Raises:
        EmptyRegionError: if the points enclose no area.
    """
    try:
        facets = ConvexHull(np.asarray(vertices, dtype=float).reshape(-1, 2)).equations
    except (QhullError, ValueError) as error:
        raise EmptyRegionError(f"the points enclose no area: {vertices}") from error
    normals, bounds = facets[:, :2], -facets[:, 2]
    are_opposite = np.all(np.abs(normals[:, None] + normals) <= PARALLEL, axis=2).tolist()
    rows: list[int] = []
    lower: list[float] = []
    for facet, bound in enumerate(bounds):
        opposite = next((i for i, row in enumerate(rows) if are_opposite[row][facet]), None)
        if opposite is None:
            rows.append(facet)
            lower.append(-np.inf)
        else:
            lower[opposite] = -bound
    return HalfPlanes(frozen_copy(normals[rows]), frozen_copy(lower), frozen_copy(bounds[rows]))


def box(half_widths: ArrayLike) -> HalfPlanes:
    """The rectangle |x| <= half_widths[0], |y| <= half_widths[1] [m]."""
    bounds = frozen_copy(half_widths, shape=(2,))
    return HalfPlanes(np.eye(2), -bounds, bounds)


def inset_vertices(vertices: Matrix, margin: float) -> Matrix:
    """Corners of the part of a convex polygon that keeps a margin from its edges, shape (V', 2) [m].

    Args:
        vertices: of the polygon, shape (V, 2) [m].
        margin: [m].

    Raises:
        EmptyRegionError: if nothing is left.
    """
    hull = ConvexHull(vertices)
    halfspaces = hull.equations + [0.0, 0.0, margin]
    centre = np.mean(vertices[hull.vertices], axis=0)
    try:
        return HalfspaceIntersection(halfspaces, centre).intersections
    except QhullError as error:
        raise EmptyRegionError(f"a margin of {margin} m leaves nothing of the polygon") from error


def closest_band(bands: Sequence[tuple[float, float]], yaw: float) -> int:
    """Index of the first band of yaws that holds a yaw, or of the nearest one.

    Args:
        bands: lowest and highest yaw of each [rad].
        yaw: [rad].
    """
    for i, (low, high) in enumerate(bands):
        if low <= yaw <= high:
            return i
    return min(range(len(bands)), key=lambda i: max(bands[i][0] - yaw, yaw - bands[i][1]))


def cut_vertices(vertices: Matrix, normal: Vector, bound: float) -> Matrix:
    """Corners of the part of a convex polygon with normal . p <= bound, shape (V, 2).

    Args:
        vertices: in their order [m], shape (V, 2).
        normal: shape (2,).
        bound: [m].
    """
    excess = vertices @ normal - bound
    corners: list[Vector] = []
    for p, q, a, b in zip(vertices, np.roll(vertices, -1, axis=0), excess, np.roll(excess, -1), strict=True):
        if a <= 0.0:
            corners.append(p)
        if a * b < 0.0:
            corners.append(p + a / (a - b) * (q - p))
    return np.array(corners).reshape(-1, 2)


def shrunk(vertices: Matrix, part: float) -> Matrix:
    """A polygon around the same middle with a part of its width [m], shape (V, 2).

    Args:
        vertices: of the polygon [m], shape (V, 2).
        part: of its width that is left.
    """
    middle = np.mean(vertices, axis=0)
    return middle + part * (vertices - middle)


def depths(corners: Matrix, point: Vector) -> Vector:
    """Distances of a point from the edges of a convex polygon, positive inside [m], shape (V,).

    Args:
        corners: of the polygon, counter-clockwise [m], shape (V, 2).
        point: [m], shape (2,).
    """
    along, to_point = np.roll(corners, -1, axis=0) - corners, point - corners
    return (along[:, 0] * to_point[:, 1] - along[:, 1] * to_point[:, 0]) / np.hypot(*along.T)


def nearest_within(polygon: Matrix, point: Vector) -> Vector:
    """The point itself, or the nearest one of a convex polygon's border if it is outside.

    Args:
        polygon: counter-clockwise [m], shape (V, 2).
        point: [m], shape (2,).
    """
    edges = np.concatenate((polygon[1:], polygon[:1])) - polygon
    to_point = point - polygon
    if np.all(edges[:, 0] * to_point[:, 1] - edges[:, 1] * to_point[:, 0] >= 0.0):
        return point
    along = np.clip(np.sum(edges * to_point, axis=1) / np.sum(edges * edges, axis=1), 0.0, 1.0)
    nearest: Matrix = polygon + along[:, None] * edges
    return nearest[np.argmin(np.hypot(*(point - nearest).T))]
