"""Small flat shapes as vertices and faces, and outlines as line segments."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float32]
Faces = NDArray[np.uint32]


def raised(points: ArrayLike, height: float) -> Points:
    """Points of the plane, shape (V, 2), at a height [m]."""
    flat = np.asarray(points, dtype=np.float32).reshape(-1, 2)
    return np.column_stack([flat, np.full(len(flat), height, dtype=np.float32)])


def fan(nb_vertices: int, first: int = 0) -> Faces:
    """Triangles of a convex polygon whose vertices follow each other counter-clockwise from `first`."""
    inner = np.arange(1, nb_vertices - 1, dtype=np.uint32)
    return np.column_stack([np.zeros_like(inner), inner, inner + 1]) + np.uint32(first)


def outline(polygon: Points) -> Points:
    """The closed border of a polygon, shape (V, 3), as segments, shape (V, 2, 3)."""
    return np.stack([polygon, np.roll(polygon, -1, axis=0)], axis=1)


def polyline(points: Points) -> Points:
    """A path through points, shape (P, 3), as segments, shape (P - 1, 2, 3)."""
    return np.stack([points[:-1], points[1:]], axis=1)


def counter_clockwise(polygon: ArrayLike) -> NDArray[np.float64]:
    """The vertices, shape (V, 2), in the order in which a face of theirs looks up."""
    vertices = np.asarray(polygon, dtype=float)
    following = np.roll(vertices, -1, axis=0)
    twice_area = np.sum(vertices[:, 0] * following[:, 1] - vertices[:, 1] * following[:, 0])
    return vertices if twice_area > 0.0 else vertices[::-1]


def disc(radius: float, nb_corners: int = 40) -> tuple[Points, Faces]:
    """A disc around the origin of the plane, facing up."""
    angle = np.linspace(0.0, 2.0 * np.pi, nb_corners, endpoint=False)
    return raised(radius * np.column_stack([np.cos(angle), np.sin(angle)]), 0.0), fan(nb_corners)


def plate(polygon: ArrayLike, thickness: float) -> tuple[Points, Faces]:
    """A convex polygon, shape (V, 2), thick upwards from the plane."""
    bottom = counter_clockwise(polygon)
    n = len(bottom)
    vertices = np.vstack([raised(bottom, 0.0), raised(bottom, thickness)])
    i = np.arange(n, dtype=np.uint32)
    j = np.roll(i, -1)
    sides = np.vstack([np.column_stack([i, j, j + n]), np.column_stack([i, j + n, i + n])])
    return vertices, np.vstack([fan(n)[:, ::-1], fan(n, first=n), sides]).astype(np.uint32)
