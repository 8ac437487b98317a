"""How far inside the viable set the DCM lies, if the foot in the air lands at a given time.

Seen from the support foot, the DCM xi at a sample is viable, if the foot in the air lands tau later, inside

    (1 - e) S + e/a ((a-1)/2 S + (a+1)/2 F + (a-1)/2 S' + V'),      e = exp(-omega tau),  a = exp(omega T)

with S and S' the soles of the support foot and of the next one, F the part of the foothold region that the foot in
the air can reach (30), and V' the viable set of the next foot at the end of its double support, see `capture.py`.
Between samples the CoP is on its way from its present place z to one in S at the first sample, delta from now, and
z has the share

    kappa = 1 - (1 - exp(-omega delta)) / (omega delta)

of the motion: then xi - kappa z has to lie inside the same set, with 1 - e - kappa for 1 - e.

The sum is never built. The support function h(n) = max n.p of a Minkowski sum is the sum of those of its parts, and xi
lies as far inside as the smallest h(n) - n.xi for the normals n of all edges of the parts.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from walkcore.cache import instance_cache
from walkcore.mpc.capture import StepTiming, strides, viable_vertices
from walkcore.mpc.regions import closest_band, foothold_vertices, inset_vertices, polygon
from walkcore.mpc.stance import Footstep, Side, convex_hull, mirrored
from walkcore.robot import Robot
from walkcore.values import Matrix, Vector, frozen_copy, rotation

TINY = 1e-12
SIGNS = frozen_copy([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
MAX_TURNS = 64  # turns of the next foot whose parts are kept; a straight walk has one


@dataclass(frozen=True, slots=True, eq=False)
class Landings:
    """Times at which the foot in the air may land, K of them, as seen from a tick or a sample [s], shapes (K,)."""

    to_sample: Vector
    """Until the first sample; zero as seen from a sample."""
    to_touchdown: Vector
    in_air: Vector
    """Time that the foot has left in the air, without the rest of a double support."""


@lru_cache(maxsize=16)  # a change of other parameters during a walk asks for the same sets again
def viable_sets(
    robot: Robot, margin: float, durations: tuple[float, ...], double_support: float, omega: float, part: float = 1.0
) -> "ViableSets":
    """The `ViableSets` of these arguments, computed once.

    Args:
        robot: with its sole, its foothold regions and the speed of its feet.
        margin: that the CoP keeps from the edges of the soles [m].
        durations: of the coming steps [s].
        double_support: its duration T [s].
        omega: of the pendulum [1/s].
        part: fraction of the foothold region that all footholds after the next one may use, around its middle.
    """
    region, middle = robot.foothold_region, np.mean(robot.foothold_region, axis=0)
    return ViableSets(robot, margin, durations, double_support, omega, middle + part * (region - middle))


class ViableSets:
    """Viable states of the DCM of one robot for a margin of the CoP and some durations of the coming steps."""

    def __init__(
        self,
        robot: Robot,
        margin: float,
        durations: Sequence[float],
        double_support: float,
        omega: float,
        later_region: Matrix | None = None,
    ) -> None:
        """Compute the support functions of the parts that do not move.

        Args:
            robot: with its sole, its foothold regions and the speed of its feet.
            margin: that the CoP keeps from the edges of the soles [m].
            durations: of the coming steps, from each of which a set follows [s].
            double_support: its duration T [s].
            omega: of the pendulum [1/s].
            later_region: of all footholds after the next one, for the left foot in the right foot's frame [m],
                shape (V, 2); by default the robot's own.
        """
        self._omega, self._double_support, self._max_speed = omega, double_support, robot.max_foot_speed
        sole = inset_vertices(robot.sole, margin)
        self._soles = {Side.LEFT: sole, Side.RIGHT: mirrored(sole)}
        timings = [StepTiming(double_support, duration - double_support, omega) for duration in durations]
        later_region = robot.foothold_region if later_region is None else later_region
        sets = [
            viable_vertices(
                robot.sole, margin, strides(later_region, robot.max_foot_speed, timing), timing, double_support
            )
            for timing in timings
        ]
        self._after_double_support = {side: [by_side[side][-1] for by_side in sets] for side in Side}
        self._bands = [(region.lowest_yaw, region.highest_yaw) for region in robot.foothold_regions]
        self._regions = {
            side: [convex_hull(foothold_vertices(region.vertices, side)) for region in robot.foothold_regions]
            for side in Side
        }
        self._normals = {side: self._normals_of_edges(side) for side in Side}
        self._fixed_parts = instance_cache(self._compute_fixed_parts, MAX_TURNS)

    def _normals_of_edges(self, support: Side) -> Matrix:
        """Normals of the edges of all parts in the frame of a support foot, shape (n, 2)."""
        parts = [*self._soles.values(), *self._after_double_support[support.other], *self._regions[support.other]]
        normals = np.vstack([np.eye(2), -np.eye(2), *(_outward_normals(part) for part in parts)])
        _, first = np.unique(np.round(normals, 6), axis=0, return_index=True)
        return frozen_copy(normals[np.sort(first)])

    def _compute_fixed_parts(self, support: Side, turn: float) -> tuple[Vector, Vector, Matrix]:
        """Support functions of S, S' and of the V' of each duration, shapes (n,), (n,) and (n, durations).

        Args:
            support: side of the support foot.
            turn: yaw of the next foot against it [rad].
        """
        normals, landing = self._normals[support], support.other
        turned = normals @ rotation(turn)
        after = [support_function(vertices, turned) for vertices in self._after_double_support[landing]]
        return (
            support_function(self._soles[support], normals),
            support_function(self._soles[landing], turned),
            np.stack(after, axis=1),
        )

    def margins(
        self, support: Footstep, swing: Footstep, foothold_yaw: float, dcm: Vector, cop: Vector, landings: Landings
    ) -> Matrix:
        """Distance by which the DCM lies inside of the viable sets; negative outside [m], shape (K, durations).

        Args:
            support: foot that will carry the first sample.
            swing: the other foot, where it is.
            foothold_yaw: yaw of the next foothold [rad].
            dcm: in the world frame [m], shape (2,).
            cop: in the world frame [m], shape (2,); without influence as seen from a sample.
            landings: to be compared.
        """
        omega, turn = self._omega, round(foothold_yaw - support.yaw, 9)
        xi, z, foot = (np.array([dcm, cop, swing.position]) - support.position) @ rotation(support.yaw)
        n, band = self._normals[support.side], closest_band(self._bands, turn * swing.side.sign)
        S, S_next, V_next = self._fixed_parts(support.side, turn)
        reach = landings.in_air[:, None] * self._max_speed
        F = support_of_reachable(self._regions[swing.side][band], foot, reach, n)
        e, a = np.exp(-omega * landings.to_touchdown)[:, None], math.exp(omega * self._double_support)
        kappa = _share_of_present_cop(omega * landings.to_sample)[:, None]
        room = (1 - e - kappa) * S + e / a * ((a - 1) / 2 * (S + S_next) + (a + 1) / 2 * F) - n @ xi + kappa * (n @ z)
        return (room[:, :, None] + (e / a)[:, :, None] * V_next).min(axis=1)


def _share_of_present_cop(x: Vector) -> Vector:
    """Kappa for omega delta, shape (K,)."""
    return np.where(x > 0.0, 1.0 + np.expm1(-x) / np.maximum(x, TINY), 0.0)


def _outward_normals(vertices: Matrix) -> Matrix:
    """Normals of all edges of a convex polygon, shape (E, 2)."""
    planes = polygon(vertices)
    return np.vstack([planes.normals, -planes.normals[np.isfinite(planes.lower)]])


def support_function(vertices: Matrix, normals: Matrix) -> Vector:
    """The largest n.p of a convex polygon for each normal, shape (n,)."""
    return np.max(normals @ vertices.T, axis=1)


def support_of_reachable(region: Matrix, foot: Vector, reach: Matrix, normals: Matrix) -> Matrix:
    """Support functions of what boxes around the foot in the air cut out of a region, shape (K, n).

    The corners of a cut are corners of the region inside of the box, corners of the box inside of the region, and
    places where an edge of the region crosses a side of the box.

    Args:
        region: corners of a convex polygon, in their order [m], shape (V, 2).
        foot: in the air [m], shape (2,).
        reach: half widths of the boxes [m], shape (K, 2).
        normals: shape (n, 2).

    Returns:
        Minus infinity where nothing can be reached.
    """
    p, d = region - foot, np.roll(region, -1, axis=0) - region
    lines = np.concatenate([reach, -reach], axis=1)  # x, y, -x, -y of the sides of each box
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (lines[:, None] - np.tile(p, 2)) / np.tile(d, 2)  # fraction of each edge, shape (K, V, 4)
        crossings = (p[:, None] + s[..., None] * d[:, None]).reshape(len(reach), -1, 2)
    is_on_edge = ((s >= 0.0) & (s <= 1.0)).reshape(len(reach), -1)  # never for a NaN
    corners = reach[:, None] * SIGNS
    outward = np.stack([d[:, 1], -d[:, 0]], axis=1)
    outward *= np.sign(outward[0] @ (p[0] - p.mean(axis=0)))
    points = np.concatenate([np.broadcast_to(p, (len(reach), *p.shape)), crossings, corners], axis=1)
    counts = np.all(np.abs(points) <= reach[:, None] + TINY, axis=2)
    counts[:, len(p) : -len(SIGNS)] &= is_on_edge
    counts[:, -len(SIGNS) :] = np.all(corners @ outward.T <= np.vecdot(outward, p) + TINY, axis=2)
    support = np.full((len(reach), len(normals)), -np.inf)
    box, _ = np.nonzero(counts)
    boxes, first = np.unique(box, return_index=True)
    if len(boxes):
        support[boxes] = np.maximum.reduceat(points[counts] @ normals.T, first, axis=0)
    return support + normals @ foot
