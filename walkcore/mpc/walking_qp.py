"""The QP that decides footsteps and CoM motion together: (19) with (27)-(30).

    minimise   1/2 u^T Q u + p^T u                                           (23)-(25)
    so that    every centre of pressure stays in its support polygon         (28)
               every foothold lies in the region beside its predecessor      (section 5)
               the foot in the air can reach the next foothold in time       (30)

The objective is a sum of weight/2 || term ||^2, of which a scheme takes some; each
constraint says that a point of the plane lies in a convex polygon. Terms and points
are linear in u and in what is known, as `preview.py` gives them. So Q depends on the phase
of the gait alone, p = J k, and a tick has only to turn the polygons' normals and to multiply.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from walkcore.cache import kept
from walkcore.mpc.preview import LinearPoints, Preview
from walkcore.mpc.qp import QP
from walkcore.mpc.regions import HalfPlanes
from walkcore.mpc.supports import Supports
from walkcore.parameters import Parameters
from walkcore.values import Matrix, Vector

MAX_KEPT = 4  # of the polygons of a phase: while the yaws stay, they come back with every second step
MARGIN_PENALTY = 1e4  # per metre and second; above any multiplier of the margin, so that the penalty is exact
OVERSHOOT = 5e-3  # [m] of the margin that is never given up: between samples the CoP bulges by up to T^2/8 ddc
GOAL_PENALTY = 1e5  # per metre; worth more than any margin given up for it, which grows tenfold over a step


class WalkingQP:
    """The walking QP at one phase of the gait: what all ticks of that phase share."""

    def __init__(self, preview: Preview, parameters: Parameters) -> None:
        """Compute it.

        Args:
            preview: of that phase.
            parameters: weights, and the scheme that says which of them count.
        """
        self.preview = preview
        cops = preview.cops()
        self._Q, self._J = _objective(preview, cops, parameters)
        self._points = cops.followed_by(preview.strides(), preview.flight())
        self._polygon_of_point = _polygon_of_point(preview) if parameters.terms.is_constrained else []
        self._edges = kept(self._compute_edges, MAX_KEPT)
        self._rows = kept(self._compute_rows, MAX_KEPT)

    def at(self, known: Matrix, supports: Supports) -> QP:
        """The QP of one tick.

        Args:
            known: k of `preview.py`, shape (6 + m + N, 2).
            supports: the polygons at this tick.
        """
        return QP(self._Q, (self._J @ known).T.ravel(), *self._edges(supports).at(known))

    def rescue_at(self, known: Matrix, supports: Supports, margin: float, end: LinearPoints) -> QP:
        """The same QP, made to stay up: margins may be given up, and the plan ends as near to a goal as it can.

        A slack s of each sample, at most the margin, widens its CoP polygon, and one more widens
        the goal. Their linear penalties are exact: where a margin can be kept, it is.

        Args:
            known: k of `preview.py`.
            supports: the polygons at this tick; its `spare_at_end` is the goal.
            margin: of the CoP, that there is to give up [m].
            end: divergent component of motion at the last sample.
        """
        problem, lipm = self.at(known, supports), self.preview.lipm
        goal = supports.spare_at_end
        at_goal = _Rows(end, [0], [len(goal.lower)]).of([goal]).at(known)
        G, lower, upper = (
            np.concatenate(both) for both in zip((problem.G, problem.lower, problem.upper), at_goal, strict=True)
        )
        N, point = lipm.nb_samples, self._edges(supports).point
        slack_of_row = np.concatenate([np.where(point < N, point, -1), np.full(len(at_goal[1]), N)])
        # Priced by the time that a sample stands for: else a late slack could be cheaper than an early one, and the
        # margin that is planned to be given up would be put off from tick to tick.
        times = np.concatenate([[0.0], lipm.times, lipm.times[-1:]])
        price = np.append(MARGIN_PENALTY * (times[2:] - times[:-2]), GOAL_PENALTY)
        most = np.append(np.full(N, max(margin - OVERSHOOT, 0.0)), np.inf)
        return _softened(QP(problem.P, problem.q, G, lower, upper), slack_of_row, price, most)

    def _compute_edges(self, supports: Supports) -> "_Edges":
        polygons = supports.polygons
        return self._rows(tuple([len(polygon.lower) for polygon in polygons])).of(polygons)

    def _compute_rows(self, nb_edges: tuple[int, ...]) -> "_Rows":
        return _Rows(self._points, self._polygon_of_point, nb_edges)


def _polygon_of_point(preview: Preview) -> list[int]:
    """Of the CoPs, strides and flight, in the order of `Supports.polygons`."""
    m, beyond = preview.layout.nb_footholds, preview.horizon.nb_carriers
    strides = list(range(beyond, beyond + m))
    return [*map(int, preview.horizon.carrier), *strides, *[beyond + m][:m]]


def _objective(preview: Preview, cops: LinearPoints, parameters: Parameters) -> tuple[Matrix, Matrix]:
    """Q, and J of p = J k, of the sum of weight/2 || D u + K k ||^2; with the terms of (19) they are (23)-(25)."""
    n, known = preview.layout.axis, cops.K.shape[1]
    Q_axis, J = np.zeros((n, n)), np.zeros((n, known))
    for name, weight in parameters.terms.weights.items():
        term = cops if name == "cop" else _term(name, preview, parameters)
        weighted = getattr(parameters, weight) * term.D.T
        Q_axis += weighted @ term.D
        J[:] += weighted @ term.K
    Q = np.zeros((2 * n, 2 * n), order="F")
    Q[:n, :n] = Q[n:, n:] = Q_axis
    return Q, J


def _term(term: str, preview: Preview, parameters: Parameters) -> LinearPoints:
    """A term of the objective, by its name in `schemes.py`."""
    match term:
        case "jerk":
            return preview.jerks()
        case "velocity":
            return preview.velocity_errors()
        case "mean_velocity":
            return preview.mean_velocity_errors(over=2 * parameters.samples_per_step)
        case "foothold":
            return preview.foothold_errors()
        case _:
            raise AssertionError(f"no term {term!r}")


@dataclass(frozen=True, slots=True, eq=False)
class _Edges:
    """The rows of constrained points: each keeps a point between an edge and the one opposite to it."""

    point: NDArray[np.int64]
    """Number of the point of each row, shape (r,)."""
    normals: Matrix
    """Of the edges, shape (r, 2)."""
    lower: Vector
    """Of the point along the normal [m], shape (r,)."""
    upper: Vector
    """[m], shape (r,)."""
    K: Matrix
    """Of the points: what is known in them, shape (r, 6 + m + N)."""
    G: Matrix
    """Shape (r, 2 (N + m))."""

    def at(self, known: Matrix) -> tuple[Matrix, Vector, Vector]:
        """G, lower and upper of the QP of one tick."""
        offset = np.vecdot(self.normals, self.K @ known)
        return self.G, self.lower - offset, self.upper - offset


class _Rows:
    """Which point and which edge each row is of: that stays while the edges turn."""

    def __init__(self, points: LinearPoints, polygon_of_point: Sequence[int], nb_edges: Sequence[int]) -> None:
        """Choose the rows.

        Args:
            points: some of them.
            polygon_of_point: number of the polygon of each point; of points beyond, nothing is asked.
            nb_edges: of each polygon.
        """
        polygon_of_edge = np.repeat(np.arange(len(nb_edges)), nb_edges)
        self._point, self._edge = np.nonzero(np.array(polygon_of_point, dtype=np.int64)[:, None] == polygon_of_edge)
        self._D, self._K = np.asfortranarray(points.D[self._point]), points.K[self._point]

    def of(self, polygons: Sequence[HalfPlanes]) -> "_Edges":
        """The rows for polygons with so many edges."""
        normals = np.concatenate([polygon.normals for polygon in polygons])[self._edge]
        lower = np.concatenate([polygon.lower for polygon in polygons])[self._edge]
        upper = np.concatenate([polygon.upper for polygon in polygons])[self._edge]
        rows, axis = self._D.shape
        G = np.empty((rows, 2 * axis), order="F")  # as a solver likes it
        np.multiply(normals[:, :1], self._D, out=G[:, :axis])
        np.multiply(normals[:, 1:], self._D, out=G[:, axis:])
        return _Edges(self._point, normals, lower, upper, self._K, G)


def _softened(problem: QP, slack_of_row: NDArray[np.int64], price: Vector, most: Vector) -> QP:
    """Rows widened by slacks that follow u; -1 for a row that stays as it is."""
    n, k = len(problem.q), len(price)
    S = (slack_of_row[:, None] == np.arange(k)).astype(float)
    above, below = np.isfinite(problem.upper), np.isfinite(problem.lower)
    return QP(
        P=np.block([[problem.P, np.zeros((n, k))], [np.zeros((k, n)), np.zeros((k, k))]]),
        q=np.concatenate([problem.q, price]),
        G=np.block([[problem.G[above], -S[above]], [problem.G[below], S[below]], [np.zeros((k, n)), np.eye(k)]]),
        lower=np.concatenate([np.full(above.sum(), -np.inf), problem.lower[below], np.zeros(k)]),
        upper=np.concatenate([problem.upper[above], np.full(below.sum(), np.inf), most]),
    )
