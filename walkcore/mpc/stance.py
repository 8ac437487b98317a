"""Feet on the ground: where a sole stands, and the stance that carries the robot."""

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np
from scipy.spatial import ConvexHull

from walkcore.values import Matrix, Vector, freeze, frozen_copy, rotation


class Side(IntEnum):
    """Side of a foot; numbered as in a recording."""

    LEFT = 0
    RIGHT = 1

    __hash__ = int.__hash__  # a tick looks up its feet some thirty times, and that of an Enum is slow

    @property
    def other(self) -> "Side":
        """The opposite side."""
        return Side.RIGHT if self is Side.LEFT else Side.LEFT

    @property
    def sign(self) -> int:
        """+1 for left, -1 for right: the direction of y on which that foot lies."""
        return 1 if self is Side.LEFT else -1


@dataclass(frozen=True, slots=True, eq=False)
class Footstep:
    """Place of a sole on the ground, in the world frame."""

    side: Side
    position: Vector
    """Origin of the sole frame [m], shape (2,)."""
    yaw: float
    """[rad]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", frozen_copy(self.position, shape=(2,)))


@dataclass(frozen=True, eq=False)  # no slots: the polygon is computed once, at its first use
class Stance:
    """The foot, or both feet, that carry the robot."""

    feet: tuple[Footstep, ...]
    """One or two."""
    sole: Matrix
    """Outline of the left sole in its own frame [m], shape (V, 2); the right one is its mirror image."""

    @property
    def is_double_support(self) -> bool:
        """Whether both feet carry the robot."""
        return len(self.feet) == 2

    @cached_property
    def centre(self) -> Vector:
        """Origin of the sole frame, or the middle between the two, world frame [m], shape (2,)."""
        return freeze(np.mean([foot.position for foot in self.feet], axis=0))

    @property
    def corners(self) -> Matrix:
        """Outlines of the soles, one below the other, world frame [m], shape (2 V, 2) or (V, 2)."""
        return np.vstack([sole_vertices(self.sole, foot) for foot in self.feet])

    @cached_property
    def polygon(self) -> Matrix:
        """Corners of the support polygon, counter-clockwise, world frame [m], shape (V, 2)."""
        return convex_hull(self.corners)


def sole_vertices(sole: Matrix, foot: Footstep) -> Matrix:
    """Outline of a sole on the ground in the world frame, shape (V, 2) [m].

    Args:
        sole: outline of the left sole in its own frame; the right one is its mirror image.
        foot: where it stands.
    """
    return foot.position + on_side(foot.side, sole) @ rotation(foot.yaw).T


def on_side(side: Side, vertices: Matrix) -> Matrix:
    """A sole, or a foothold region, of the foot of a side, shape (V, 2) [m].

    Args:
        side: of that foot; for a foothold region, of the foot which lands.
        vertices: the left foot's, in a foot's frame; the right foot's are their mirror image.
    """
    return vertices if side is Side.LEFT else mirrored(vertices)


def mirrored(vertices: Matrix) -> Matrix:
    """Vertices reflected from the left of the robot to its right, shape (V, 2).

    Args:
        vertices: in a foot's frame [m], shape (V, 2).
    """
    return vertices * [1.0, -1.0]


def convex_hull(points: Matrix) -> Matrix:
    """Corners of the convex hull of points, counter-clockwise, shape (V, 2).

    Args:
        points: shape (P, 2), not all on one line.
    """
    return freeze(points[ConvexHull(points).vertices])
