"""The QP that decides footsteps and CoM motion together: (19) with (27)-(30).

    u = (jerks_x, footholds_x, jerks_y, footholds_y)                         (18)
    minimise   1/2 u^T Q u + p^T u                                           (23)-(25)
    so that    every centre of pressure stays in its support polygon         (28)
               every foothold lies in the region beside its predecessor      (section 5)
               the foot in the air can reach the next foothold in time       (30)

Each constraint says that a point of the plane, an affine function of u that is
the same for x and y, lies in a convex polygon; they are stacked as such.
Built here, solved elsewhere.
"""

from dataclasses import dataclass, replace

import numpy as np

from walkcore.lipm import CoMState, PreviewMatrices
from walkcore.qp import QP
from walkcore.regions import HalfPlanes
from walkcore.supports import Supports
from walkcore.values import Matrix, Vector

FOOTHOLD_SCALE = 1e4  # footholds in units of 10 km: the cost is almost flat along them, see qp.py
MARGIN_PENALTY = 1e3  # per metre and sample; above any multiplier of the margin, so that the penalty is exact


@dataclass(frozen=True, slots=True)
class Weights:
    """Of the terms of (19)."""

    alpha: float
    """Jerk."""
    beta: float
    """Velocity error."""
    gamma: float
    """Distance from the CoP to the middle of its support."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where things are in u."""

    nb_samples: int
    nb_footholds: int

    @classmethod
    def of(cls, supports: Supports) -> "Layout":
        """That of the QP with these supports."""
        return cls(*supports.selection.shape)

    @property
    def axis(self) -> int:
        """Variables of one axis."""
        return self.nb_samples + self.nb_footholds

    @property
    def scale(self) -> Vector:
        """Magnitudes of the variables for the solver, shape (2 (N + m),)."""
        return np.tile(np.repeat([1.0, FOOTHOLD_SCALE], [self.nb_samples, self.nb_footholds]), 2)

    def axes(self, u: Vector) -> Matrix:
        """The variables of x and of y side by side, shape (N + m, 2); slacks are left out."""
        return u[: 2 * self.axis].reshape(2, self.axis).T

    def jerks(self, u: Vector) -> Matrix:
        """[m/s^3], shape (N, 2)."""
        return self.axes(u)[: self.nb_samples]

    def footholds(self, u: Vector) -> Matrix:
        """[m], shape (m, 2)."""
        return self.axes(u)[self.nb_samples :]


def build_qp(com: CoMState, supports: Supports, reference: Matrix, preview: PreviewMatrices, weights: Weights) -> QP:
    """The walking QP at one tick.

    Args:
        com: the present.
        supports: of the samples to come.
        reference: CoM velocity to track at each sample, world frame [m/s], shape (N, 2).
        preview: over the same samples.
        weights: of (19).
    """
    Q, p = _objective(com, supports, reference, preview, weights)
    G, lower, upper = _constraints(com, supports, preview)
    return QP(Q, p, G, lower, upper, Layout.of(supports).scale)


def _objective(
    com: CoMState, supports: Supports, reference: Matrix, preview: PreviewMatrices, weights: Weights
) -> tuple[Matrix, Vector]:
    a, b, g = weights.alpha, weights.beta, weights.gamma
    Pvs, Pvu, Pzs, Pzu, U = preview.Pvs, preview.Pvu, preview.Pzs, preview.Pzu, supports.selection
    x = com.matrix  # both axes at once, as columns

    Q_axis = np.block(
        [
            [a * np.eye(len(Pvu)) + b * Pvu.T @ Pvu + g * Pzu.T @ Pzu, -g * Pzu.T @ U],
            [-g * U.T @ Pzu, g * U.T @ U],
        ]
    )
    velocity_error = Pvs @ x - reference
    cop_error = Pzs @ x - supports.known_centre
    p_axes = np.vstack([b * Pvu.T @ velocity_error + g * Pzu.T @ cop_error, -g * U.T @ cop_error])
    zero = np.zeros_like(Q_axis)
    return np.block([[Q_axis, zero], [zero, Q_axis]]), p_axes.T.ravel()


@dataclass(frozen=True, slots=True, eq=False)
class AffinePoint:
    """Points of the plane that are affine functions of u, the same for x and y."""

    matrix: Matrix
    """Shape (k, N + m)."""
    offset: Matrix
    """Shape (k, 2)."""

    def at(self, axes: Matrix) -> Matrix:
        """The points for the variables of both axes, shape (N + m, 2)."""
        return self.matrix @ axes + self.offset

    def rows(self, polygons: tuple[HalfPlanes, ...]) -> tuple[Matrix, Vector, Vector]:
        """G, lower, upper that keep each point in its polygon."""
        normals = np.vstack([polygon.normals for polygon in polygons])
        point = np.repeat(np.arange(len(polygons)), [len(polygon.normals) for polygon in polygons])
        known = np.sum(normals * self.offset[point], axis=1)
        matrix = self.matrix[point]
        return (
            np.hstack([normals[:, :1] * matrix, normals[:, 1:] * matrix]),
            np.concatenate([polygon.lower for polygon in polygons]) - known,
            np.concatenate([polygon.upper for polygon in polygons]) - known,
        )


def _constraints(com: CoMState, supports: Supports, preview: PreviewMatrices) -> tuple[Matrix, Vector, Vector]:
    """Rows of (28), then of the foothold regions, then of (30)."""
    N, m = supports.selection.shape
    cop = np.hstack([preview.Pzu, -supports.selection])
    cop_offset = preview.Pzs @ com.matrix - supports.known_centre
    foothold: Matrix = np.hstack([np.zeros((m, N)), np.eye(m) - np.eye(m, k=-1)])
    foothold_offset = np.zeros((m, 2))
    foothold_offset[:1] = -supports.support_position
    touchdown = foothold[:1]  # none where the horizon ends before it
    touchdown_offset = np.tile(-supports.swing_position, (len(touchdown), 1))
    points = AffinePoint(
        np.vstack([cop, foothold, touchdown]), np.vstack([cop_offset, foothold_offset, touchdown_offset])
    )
    reach = (supports.swing_reach,) * len(touchdown)
    return points.rows((*supports.cop_polygons, *supports.foothold_regions, *reach))


def dcm(com: CoMState, supports: Supports, preview: PreviewMatrices, omega: float, n: int) -> AffinePoint:
    """The divergent component of motion c + dc/omega at sample n, relative to the centre of its support."""
    matrix = np.concatenate([preview.Ppu[n] + preview.Pvu[n] / omega, -supports.selection[n]])
    offset = (preview.Pps[n] + preview.Pvs[n] / omega) @ com.matrix - supports.known_centre[n]
    return AffinePoint(matrix[None], offset[None])


def keep_inside(problem: QP, point: AffinePoint, polygon: HalfPlanes) -> QP:
    """The same QP with one more point kept in a polygon. Slacks that follow u do not touch it."""
    G, lower, upper = point.rows((polygon,))
    return replace(
        problem,
        G=np.vstack([problem.G, np.pad(G, ((0, 0), (0, problem.G.shape[1] - G.shape[1])))]),
        lower=np.concatenate([problem.lower, lower]),
        upper=np.concatenate([problem.upper, upper]),
    )


def soften_margin(problem: QP, supports: Supports, margin: float) -> QP:
    """The same QP where each sample may give up some of its CoP margin, at a price.

    A slack s of each sample, 0 <= s <= margin, widens its polygon; its linear penalty is
    exact: where the margin can be kept, it is. The slacks follow u.

    Args:
        problem: as `build_qp` gives it.
        supports: those it was built from.
        margin: what there is to give up [m].
    """
    N, n = len(supports.cop_polygons), len(problem.q)
    sample = np.repeat(np.arange(N), [len(polygon.normals) for polygon in supports.cop_polygons])
    r = len(sample)
    slack = (sample[:, None] == np.arange(N)).astype(float)
    cop, others = problem.G[:r], problem.G[r:]
    no_bound = np.full(r, np.inf)
    return QP(
        P=np.block([[problem.P, np.zeros((n, N))], [np.zeros((N, n)), np.zeros((N, N))]]),
        q=np.concatenate([problem.q, np.full(N, MARGIN_PENALTY)]),
        G=np.block([[cop, -slack], [cop, slack], [others, np.zeros((len(others), N))], [np.zeros((N, n)), np.eye(N)]]),
        lower=np.concatenate([-no_bound, problem.lower[:r], problem.lower[r:], np.zeros(N)]),
        upper=np.concatenate([problem.upper[:r], no_bound, problem.upper[r:], np.full(N, margin)]),
        scale=np.concatenate([problem.scale, np.ones(N)]),
    )
