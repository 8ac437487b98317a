"""The QP that decides footsteps and CoM motion together: (19) with (27)-(30).

    minimise   1/2 u^T Q u + p^T u                                           (23)-(25)
    so that    every centre of pressure stays in its support polygon         (28)
               every foothold lies in the region beside its predecessor      (section 5)
               the foot in the air can reach the next foothold in time       (30)

The objective is a sum of weight/2 || term ||^2, of which a scheme takes some; each
constraint says that a point of the plane lies in a convex polygon. Terms and points
are affine in u, as `preview.py` gives them. Built here, solved elsewhere.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from walkcore.parameters import Parameters
from walkcore.preview import AffinePoints, Preview
from walkcore.qp import QP
from walkcore.regions import HalfPlanes
from walkcore.values import Matrix, Vector

MARGIN_PENALTY = 1e4  # per metre and second; above any multiplier of the margin, so that the penalty is exact
OVERSHOOT = 5e-3  # [m] of the margin that is never given up: between samples the CoP bulges by up to T^2/8 ddc
GOAL_PENALTY = 1e5  # per metre; worth more than any margin given up for it, which grows tenfold over a step


def build_qp(preview: Preview, reference: Matrix, parameters: Parameters) -> QP:
    """The walking QP at one tick.

    Args:
        preview: the present and the samples to come.
        reference: CoM velocity to track at each sample, world frame [m/s], shape (N, 2).
        parameters: weights, and the scheme that says which of them count.
    """
    Q, p = _objective(preview, reference, parameters)
    no_rows = np.zeros((0, len(p))), np.zeros(0), np.zeros(0)
    G, lower, upper = _constraints(preview) if parameters.terms.is_constrained else no_rows
    return QP(Q, p, G, lower, upper, preview.layout.scale)


def _objective(preview: Preview, reference: Matrix, parameters: Parameters) -> tuple[Matrix, Vector]:
    """Q and p of the sum of weight/2 || matrix u + offset - target ||^2; with the terms of (19) they are (23)-(25)."""
    n = preview.layout.axis
    Q_axis, p_axes = np.zeros((n, n)), np.zeros((n, 2))
    for term, name in parameters.terms.weights.items():
        points, target = _term(term, preview, reference, parameters)
        weight, M = getattr(parameters, name), points.matrix
        Q_axis += weight * M.T @ M
        p_axes += weight * M.T @ (points.offset - target)
    zero = np.zeros_like(Q_axis)
    return np.block([[Q_axis, zero], [zero, Q_axis]]), p_axes.T.ravel()


def _term(
    term: str, preview: Preview, reference: Matrix, parameters: Parameters
) -> tuple[AffinePoints, Matrix | float]:
    """A term of the objective, by its name in `schemes.py`, and what it is drawn to."""
    match term:
        case "jerk":
            return preview.jerks(), 0.0
        case "velocity":
            return preview.velocities(), reference
        case "mean_velocity":
            over = 2 * parameters.samples_per_step
            return preview.mean_velocities(over), reference[over:]
        case "cop":
            return preview.cops(), 0.0
        case "foothold":
            return preview.footholds(), preview.supports.planned_footholds
        case _:
            raise AssertionError(f"no term {term!r}")


def _constraints(preview: Preview) -> tuple[Matrix, Vector, Vector]:
    """Rows of (28), then of the foothold regions, then of (30)."""
    supports, flight = preview.supports, preview.flight()
    points = preview.cops().followed_by(preview.strides(), flight)
    reach = (supports.swing_reach,) * len(flight.offset)
    return points.rows((*supports.cop_polygons, *supports.foothold_regions, *reach))


def rescue_qp(problem: QP, preview: Preview, margin: float, end: AffinePoints, goal: HalfPlanes) -> QP:
    """The same QP, made to stay up: margins may be given up, and the plan ends as near to a goal as it can.

    A slack s of each sample, at most the margin, widens its CoP polygon, and one more widens
    the goal. Their linear penalties are exact: where a margin can be kept, it is.

    Args:
        problem: as `build_qp` gives it.
        preview: that it was built from.
        margin: of the CoP, that there is to give up [m].
        end: divergent component of motion at the last sample.
        goal: where further steps can catch it.
    """
    G, lower, upper = end.rows((goal,))
    with_goal = replace(
        problem,
        G=np.vstack([problem.G, G]),
        lower=np.concatenate([problem.lower, lower]),
        upper=np.concatenate([problem.upper, upper]),
    )
    cop_polygons = preview.supports.cop_polygons
    N = len(cop_polygons)
    sample = np.repeat(np.arange(N), [len(polygon.normals) for polygon in cop_polygons])
    slack_of_row = np.concatenate([sample, np.full(len(problem.lower) - len(sample), -1), np.full(len(lower), N)])
    # Priced by the time that a sample stands for: else a late slack could be cheaper than an early one, and the margin
    # that is planned to be given up would be put off from tick to tick.
    times = np.concatenate([[0.0], preview.lipm.times, preview.lipm.times[-1:]])
    price = np.append(MARGIN_PENALTY * (times[2:] - times[:-2]), GOAL_PENALTY)
    most = np.append(np.full(N, max(margin - OVERSHOOT, 0.0)), np.inf)
    return _softened(with_goal, slack_of_row, price, most)


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
        scale=np.concatenate([problem.scale, np.ones(k)]),
    )
