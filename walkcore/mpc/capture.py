"""Capturability: the states of the DCM from which steps of fixed duration can still catch the robot.

    xi = c + dc / omega,    dxi = omega (xi - z),    omega^2 = g / h

The divergent component of motion (DCM) xi runs away from the centre of pressure z, and nothing
but z moves it. Over a double support z goes from the old sole to the new one, then it
stays in the new one until the next touchdown. So the DCMs xi, seen from
the support foot at a touchdown, from which some sequence of footholds keeps the robot
up for ever, are a convex set B that solves

    a B = (a-1)/2 S + (a+1)/2 R + ((a-1)/2 + (b-1)/b) S' + B'/b

with S the sole, R the foothold region, ' for the other side, a and b the growth of xi over
a double and a single support, and + the Minkowski sum. The paper's QP does not know
this set; leaving it means that no further plan could catch the robot.
Koolen et al. 2012, "Capturability-based analysis and control of legged locomotion".
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from walkcore.mpc.regions import HalfPlanes, foothold_vertices, inset_vertices, polygon
from walkcore.mpc.stance import Side, mirrored
from walkcore.values import Matrix

ITERATIONS = 20  # of the fixed point; each shrinks the error by a b, about 15


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
    on_right = right_sole
    for _ in range(ITERATIONS):
        on_right = minkowski_sum(
            (a - 1) / (2 * a) * right_sole,
            (a + 1) / (2 * a) * foothold_vertices(region, Side.LEFT),
            ((a - 1) / 2 + (b - 1) / b) / a * sole,
            mirrored(on_right) / (a * b),
        )
    return {Side.RIGHT: on_right, Side.LEFT: mirrored(on_right)}


def capture_polygons(
    sole: Matrix, margin: float, region: Matrix, timing: StepTiming, sampling_period: float
) -> dict[Side, tuple[HalfPlanes, ...]]:
    """Capturable states of the DCM in the frame of each support foot, by the samples left of its single support.

    Args:
        sole: outline of the left sole [m], shape (V, 2).
        margin: that the CoP keeps from its edges [m].
        region: of the left foot, in the right foot's frame [m], shape (V, 2).
        timing: of the steps.
        sampling_period: [s].
    """
    inner = inset_vertices(sole, margin)
    at_touchdown = capture_vertices(inner, region, timing)
    nb_samples = round(timing.single_support / sampling_period)
    growth = np.exp(timing.omega * sampling_period * np.arange(nb_samples + 1))
    return {
        side: tuple(polygon(minkowski_sum(vertices / e, (1 - 1 / e) * own)) for e in growth)
        for side, vertices, own in (
            (Side.LEFT, at_touchdown[Side.LEFT], inner),
            (Side.RIGHT, at_touchdown[Side.RIGHT], mirrored(inner)),
        )
    }


def minkowski_sum(*sets: Matrix) -> Matrix:
    """Vertices of the sum of convex sets that are given by theirs."""
    total = np.zeros((1, 2))
    for vertices in sets:
        sums = (total[:, None] + vertices[None]).reshape(-1, 2)
        total = sums[ConvexHull(sums).vertices]
    return total
