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
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from walkcore.cache import instance_cache
from walkcore.mpc.capture import StepTiming, strides, viable_vertices
from walkcore.mpc.regions import closest_band, inset_vertices, shrunk
from walkcore.mpc.stance import Footstep, Side, mirrored, on_side
from walkcore.robot import Robot
from walkcore.values import Matrix, Vector, frozen_copy, rotation

TINY = 1e-12
MAX_TURNS = 64  # turns of the next foot whose parts are kept; a straight walk has one


Parts = NDArray[np.float64]
"""Support functions in n directions, for A allowances and D durations of the coming steps, shape (n, A, D)."""


@dataclass(frozen=True, slots=True, eq=False)
class Landings:
    """Times at which the foot in the air may land, K of them, as seen from a tick or a sample [s], shapes (K,)."""

    to_sample: Vector
    """Until the first sample; zero as seen from a sample."""
    to_touchdown: Vector
    in_air: Vector
    """Time that the foot has left in the air, without the rest of a double support."""


@dataclass(frozen=True, slots=True)
class Allowance:
    """How far the coming steps may go to catch the robot."""

    margin: float
    """Distance of the CoP from the edges of the soles [m]."""
    part: float = 1.0
    """Fraction of the foothold region, around its middle, that all footholds after the next one may use."""


class ViableSets:
    """Viable states of the DCM of one robot, for A allowances and D durations of the coming steps."""

    def __init__(
        self,
        robot: Robot,
        allowances: tuple[Allowance, ...],
        durations: tuple[float, ...],
        double_support: float,
        omega: float,
    ) -> None:
        """Compute the support functions of the parts that do not move.

        Args:
            robot: with its sole, its foothold regions and the speed of its feet.
            allowances: from each of which a set follows.
            durations: of the coming steps, from each of which a set follows [s].
            double_support: its duration T [s].
            omega: of the pendulum [1/s].
        """
        self._omega, self._double_support, self._max_speed = omega, double_support, robot.max_foot_speed
        soles = [inset_vertices(robot.sole, allowance.margin) for allowance in allowances]
        self._soles = {Side.LEFT: soles, Side.RIGHT: [mirrored(sole) for sole in soles]}
        timings = [StepTiming(double_support, duration - double_support, omega) for duration in durations]
        sets = [
            viable_vertices(
                robot.sole,
                allowance.margin,
                strides(shrunk(robot.foothold_region, allowance.part), robot.max_foot_speed, timing),
                timing,
            )
            for allowance in allowances
            for timing in timings
        ]
        self._after_double_support = {side: [by_side[side][-1] for by_side in sets] for side in Side}
        self._bands = [(region.lowest_yaw, region.highest_yaw) for region in robot.foothold_regions]
        self._regions = {
            side: [Outline(on_side(side, region.vertices)) for region in robot.foothold_regions] for side in Side
        }
        self._normals = {side: _normals_of_edges(robot, side.other) for side in Side}
        self._fixed_parts = instance_cache(self._compute_fixed_parts, MAX_TURNS)

    def __getstate__(self) -> dict[str, Any]:
        """State for pickling: all attributes but the cache, which is made anew."""
        return {name: value for name, value in vars(self).items() if name != "_fixed_parts"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._fixed_parts = instance_cache(self._compute_fixed_parts, MAX_TURNS)

    def _compute_fixed_parts(self, support: Side, turn: float) -> tuple[Parts, Parts, Parts]:
        """Support functions of S, S' and V', shapes (n, A, 1), (n, A, 1) and (n, A, D).

        Args:
            support: side of the support foot.
            turn: yaw of the next foot against it [rad].
        """
        normals, landing = self._normals[support], support.other
        turned = normals @ rotation(turn)
        own = np.stack([support_function(sole, normals) for sole in self._soles[support]], axis=1)
        following = np.stack([support_function(sole, turned) for sole in self._soles[landing]], axis=1)
        after = np.stack([support_function(vertices, turned) for vertices in self._after_double_support[landing]], 1)
        return own[..., None], following[..., None], after.reshape(*own.shape, -1)

    def margins(
        self, support: Footstep, swing: Footstep, foothold_yaw: float, dcm: Vector, cop: Vector, landings: Landings
    ) -> NDArray[np.float64]:
        """Distance by which the DCM lies inside of the viable sets; negative outside [m], shape (K, A, D).

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
        F = self._regions[swing.side][band].support_within(foot, reach, n)
        e, a = np.exp(-omega * landings.to_touchdown)[:, None], math.exp(omega * self._double_support)
        kappa = _share_of_present_cop(omega * landings.to_sample)[:, None]
        moving = e * (a + 1) / (2 * a) * F - n @ xi + kappa * (n @ z)
        e, kappa = e[..., None, None], kappa[..., None, None]
        room = (1 - e - kappa) * S + e / a * ((a - 1) / 2 * (S + S_next) + V_next) + moving[..., None, None]
        return room.min(axis=1)


viable_sets = lru_cache(maxsize=16)(ViableSets)
"""`ViableSets` by their arguments, the latest kept: a change of other parameters asks for the same sets again."""


def _share_of_present_cop(x: Vector) -> Vector:
    """Kappa for omega delta, shape (K,)."""
    return np.where(x > 0.0, 1.0 + np.expm1(-x) / np.maximum(x, TINY), 0.0)


@lru_cache(maxsize=16)
def _normals_of_edges(robot: Robot, landing: Side) -> Matrix:
    """Normals of the edges of all parts in the frame of the support foot, shape (n, 2).

    A part that is a sum, inset or cut has no others than its own parts and the cuts along x.

    Args:
        robot: whose soles and foothold regions they are.
        landing: side of the next foothold.
    """
    both = [f(part) for part in (robot.sole, robot.foothold_region) for f in (np.asarray, mirrored)]
    parts = [*both, *(on_side(landing, region.vertices) for region in robot.foothold_regions)]
    normals = np.vstack([np.eye(2), -np.eye(2), *(ConvexHull(part).equations[:, :2] for part in parts)])
    _, first = np.unique(np.round(normals, 6), axis=0, return_index=True)
    return frozen_copy(normals[np.sort(first)])


def support_function(vertices: Matrix, normals: Matrix) -> Vector:
    """The largest n.p of a convex polygon for each normal, shape (n,)."""
    return np.max(normals @ vertices.T, axis=1)


class Outline:
    """A convex polygon with V corners, prepared to be cut by boxes."""

    def __init__(self, corners: Matrix) -> None:
        """Prepare the lines of its edges.

        Args:
            corners: [m], shape (V, 2).
        """
        self._corners, self._least, self._most = corners, corners.min(axis=0), corners.max(axis=0)
        normals, offsets = np.split(ConvexHull(corners).equations, [2], axis=1)
        across = normals[:, ::-1].T  # y on lines x = u, then x on lines y = u; all that follows has shape (2, V)
        is_bound = np.abs(across) > TINY
        divisor = np.where(is_bound, across, 1.0)
        self._slope = np.where(is_bound, -normals.T / divisor, 0.0)
        self._lower = np.where(is_bound & (across < 0.0), -offsets.T / divisor, -np.inf)
        self._upper = np.where(is_bound & (across > 0.0), -offsets.T / divisor, np.inf)

    def support_within(self, foot: Vector, reach: Matrix, normals: Matrix) -> Matrix:
        """Support functions of what boxes around the foot in the air cut out of the polygon.

        The corners of a cut are the corners of the polygon inside of the box, and both ends of what the polygon
        leaves of each side of the box, or of the polygon's own end where that side lies beyond it.

        Args:
            foot: in the air [m], shape (2,).
            reach: half widths of the boxes [m], shape (K, 2).
            normals: shape (n, 2).

        Returns:
            Shape (K, n); minus infinity where nothing can be reached.
        """
        least, most = foot - reach, foot + reach
        u = np.stack([np.maximum(least, self._least), np.minimum(most, self._most)], axis=2)  # (K, 2 axes, 2 sides)
        lines = self._slope[:, None] * u[..., None]
        first = np.maximum((self._lower[:, None] + lines).max(axis=3), least[:, ::-1, None])
        last = np.minimum((self._upper[:, None] + lines).min(axis=3), most[:, ::-1, None])
        is_cut = (first <= last + TINY) & (u[..., :1] <= u[..., 1:] + TINY)

        points = np.empty((len(reach), 8 + len(self._corners), 2))
        ends = points[:, :8].reshape(-1, 2, 2, 2, 2)  # axis, first or last, side, coordinate
        for axis in (0, 1):
            ends[:, axis, :, :, axis] = u[:, axis, None]
            ends[:, axis, 0, :, 1 - axis], ends[:, axis, 1, :, 1 - axis] = first[:, axis], last[:, axis]
        points[:, 8:] = self._corners
        counts = np.empty(points.shape[:2], dtype=bool)
        counts[:, :8].reshape(-1, 2, 2, 2)[:] = is_cut[:, :, None]
        counts[:, 8:] = np.all(
            (self._corners >= least[:, None] - TINY) & (self._corners <= most[:, None] + TINY), axis=2
        )
        return np.where(counts[..., None], points @ normals.T, -np.inf).max(axis=1)
