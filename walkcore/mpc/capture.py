"""Capturability: the states of the DCM from which steps of fixed duration can still catch the robot.

    xi = c + dc / omega,    dxi = omega (xi - z),    omega^2 = g / h

The divergent component of motion (DCM) xi runs away from the centre of pressure z, and nothing but z moves it. Over a
double support z counts as half in the old sole and half in the new one (one that goes from the one to the other at a
constant speed differs by 6 % of these shares), then it stays in the new one until the next touchdown. So the DCMs xi,
seen from the support foot at a touchdown, from which some sequence of footholds keeps the robot up for ever, are a
convex set B that solves

    a B = (a-1)/2 S + (a+1)/2 R + ((a-1)/2 + (b-1)/b) S' + B'/b

with S the sole, R the foothold region, ' for the other side, a and b the growth of xi over a double and a single
support, and + the Minkowski sum. The paper's QP does not know this set; leaving it means that no further plan could
catch the robot. With P what one step adds, B = P + mirrored B / (a b): alternately P and its mirror image, ever
smaller. Parts that are the same but for their size add up to one, so B = (P + mirrored P / (a b)) / (1 - 1/(a b)^2).
Koolen et al. 2012, "Capturability-based analysis and control of legged locomotion".
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial import ConvexHull

from walkcore.mpc.regions import HalfPlanes, cut_vertices, half_planes, inset_vertices
from walkcore.mpc.stance import Side, convex_hull, mirrored, on_side
from walkcore.values import Matrix, Vector


def strides(region: Matrix, max_foot_speed: Vector, timing: "StepTiming") -> Matrix:
    """The part of the foothold region that a walk can use step after step, as fast as its feet are [m], shape (V, 2).

    A foot flies over two strides, so that along x each takes half of the way (30). Across, one stride undoes the other.

    Args:
        region: of the left foot, in the right foot's frame [m], shape (V, 2).
        max_foot_speed: along x and y of the support foot's frame [m/s], shape (2,).
        timing: of the steps.
    """
    farthest, part = max_foot_speed[0] * timing.single_support / 2, convex_hull(region)
    for along in (1.0, -1.0):
        part = cut_vertices(part, np.array([along, 0.0]), farthest)
    return part


@dataclass(frozen=True, slots=True)
class StepTiming:
    """Durations of one step [s], and omega [1/s]."""

    double_support: float
    single_support: float
    omega: float


def capture_vertices(sole: Matrix, region: Matrix, timing: StepTiming) -> dict[Side, Matrix]:
    """The set B at a touchdown, before the next foothold is chosen, in the frame of each support foot.

    Args:
        sole: region of the CoP in the left sole [m], shape (V, 2).
        region: of the left foot, in the right foot's frame [m], shape (V, 2).
        timing: of the steps.

    Returns:
        Vertices by side of the foot that has carried the robot so far [m], shapes (V, 2).
    """
    a = math.exp(timing.omega * timing.double_support)
    b = math.exp(timing.omega * timing.single_support)
    right_sole = mirrored(sole)
    one_step = minkowski_sum(
        (a - 1) / (2 * a) * right_sole,
        (a + 1) / (2 * a) * on_side(Side.LEFT, region),
        ((a - 1) / 2 + (b - 1) / b) / a * sole,
    )
    shrinking = 1 / (a * b)
    on_right = minkowski_sum(one_step, shrinking * mirrored(one_step)) / (1 - shrinking**2)
    return {Side.RIGHT: on_right, Side.LEFT: mirrored(on_right)}


def viable_vertices(sole: Matrix, margin: float, region: Matrix, timing: StepTiming) -> dict[Side, tuple[Matrix, ...]]:
    """Viable states of the DCM in the frame of each support foot, by the samples left of its single support.

    Args:
        sole: outline of the left sole [m], shape (V, 2).
        margin: that the CoP keeps from its edges [m].
        region: of the left foot, in the right foot's frame [m], shape (V, 2).
        timing: of the steps; samples are as far apart as a double support lasts (section 4).

    Returns:
        Vertices of the sets by side of the support foot [m], shapes (V, 2), the last one as the single support begins.
    """
    return _viable_vertices(_plain(sole), margin, _plain(region), timing)


PlainVertices = tuple[tuple[float, ...], ...]
"""Vertices that a cache can compare."""


def _plain(vertices: Matrix) -> PlainVertices:
    return tuple(map(tuple, vertices.tolist()))


@lru_cache(maxsize=64)  # a change of other parameters during a walk asks for the same sets again
def _viable_vertices(
    sole: PlainVertices, margin: float, region: PlainVertices, timing: StepTiming
) -> dict[Side, tuple[Matrix, ...]]:
    inner = inset_vertices(np.array(sole), margin)
    at_touchdown = capture_vertices(inner, np.array(region), timing)[Side.LEFT]
    nb_samples = round(timing.single_support / timing.double_support)
    growth = np.exp(timing.omega * timing.double_support * np.arange(nb_samples + 1))
    on_left = tuple(minkowski_sum(at_touchdown / e, (1 - 1 / e) * inner) for e in growth.tolist())
    return {Side.LEFT: on_left, Side.RIGHT: tuple(map(mirrored, on_left))}


def viable_polygons(vertices: dict[Side, tuple[Matrix, ...]]) -> dict[Side, tuple[HalfPlanes, ...]]:
    """The sets of `viable_vertices` by their edges."""
    return {side: tuple(map(half_planes, sets)) for side, sets in vertices.items()}


def minkowski_sum(*sets: Matrix) -> Matrix:
    """Vertices of the sum of convex sets that are given by theirs."""
    total = np.zeros((1, 2))
    for vertices in sets:
        sums = (total[:, None] + vertices[None]).reshape(-1, 2)
        total = sums[ConvexHull(sums).vertices]
    return total
