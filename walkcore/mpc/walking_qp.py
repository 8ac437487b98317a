"""The QP that decides footsteps and CoM motion together: (19) with (27)-(30).

    minimise   1/2 u^T Q u + p^T u                                           (23)-(25)
    so that    every centre of pressure stays in its support polygon         (28)
               every foothold lies in the region beside its predecessor      (section 5)
               the foot in the air can reach the next foothold in time       (30)

Where it has no solution, or leads to a fall, the relaxed QP takes its place: our addition.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from walkcore.mpc.constraints import Constraints, constrained_points, polygon_of_point
from walkcore.mpc.objective import objective
from walkcore.mpc.preview import Preview, QPInputs
from walkcore.mpc.qp import QP
from walkcore.mpc.supports import Supports
from walkcore.parameters import Parameters
from walkcore.values import Matrix, Vector

MARGIN_PENALTY = 1e4  # per metre and second; above any multiplier of the margin, so that the penalty is exact
OVERSHOOT = 5e-3  # [m] of the margin that is never given up: between samples the CoP bulges by up to T^2/8 ddc
TERMINAL_PENALTY = 1e5  # per metre; worth more than any margin given up for it, which grows tenfold over a step


@dataclass(frozen=True, slots=True, eq=False)
class PhaseMatrices:
    """The parts of the QP that depend on the phase of the gait alone, and come back with every step."""

    preview: Preview
    Q: Matrix
    """(23), shape (2 (N + m), 2 (N + m))."""
    J: Matrix
    """J of p_k = J k (25), shape (N + m, 6 + m + N)."""
    constraints: Constraints


@dataclass(frozen=True, slots=True, eq=False)
class WalkingQP:
    """The QP of one tick, and the quantities that its variables and rows stand for."""

    qp: QP
    preview: Preview
    supports: Supports
    inputs: Matrix
    """k, shape (6 + m + N, 2)."""
    point_of_row: NDArray[np.int64]
    """Number of the point that each row keeps, see `constrained_points`, shape (r,)."""
    normal_of_row: Matrix
    """Normal of the edge that each row keeps it behind, shape (r, 2)."""


@dataclass(frozen=True, slots=True, eq=False)
class RelaxedQP:
    """A walking QP whose rows are widened by slacks: a row with two bounds becomes two rows."""

    qp: QP
    above: NDArray[np.bool_]
    """Whether each row of the walking QP, and of the terminal set behind them, has an upper bound, shape (r + e,)."""
    below: NDArray[np.bool_]
    """Whether it has a lower bound, shape (r + e,)."""

    def row_multipliers(self, multipliers: Vector) -> Vector:
        """Multipliers of the rows of the walking QP and of the terminal set, shape (r + e,), as `Solution` has them.

        Args:
            multipliers: of the rows of the relaxed QP.
        """
        per_row = np.zeros(len(self.above))
        nb_above, nb_below = self.above.sum(), self.below.sum()
        per_row[self.above] += multipliers[:nb_above]
        per_row[self.below] += multipliers[nb_above : nb_above + nb_below]
        return per_row


def phase_matrices(preview: Preview, parameters: Parameters, nb_edges: tuple[int, ...]) -> PhaseMatrices:
    """The matrices of one phase of the gait, by the scheme and the weights of the parameters.

    Args:
        preview: of that phase.
        parameters: with scheme and weights.
        nb_edges: rows of each polygon, as `Supports` has them.
    """
    formulation, n = parameters.formulation, preview.layout.axis
    Q_axis, J = objective(formulation.terms(parameters), preview)
    Q = np.zeros((2 * n, 2 * n), order="F")
    Q[:n, :n] = Q[n:, n:] = Q_axis  # (23)
    constrained = polygon_of_point(preview) if formulation.is_constrained else np.zeros(0, dtype=np.int64)
    return PhaseMatrices(preview, Q, J, Constraints(constrained_points(preview), constrained, nb_edges))


def walking_qp(phase: PhaseMatrices, supports: Supports, reach: Vector, inputs: QPInputs) -> WalkingQP:
    """The paper's QP at one tick.

    Args:
        phase: of the gait at this tick.
        supports: polygons at this tick.
        reach: of the foot in the air: the right-hand side of (30) [m], shape (2,).
        inputs: what the QP does not decide.
    """
    k = inputs.matrix
    rows = phase.constraints.rows(supports.edges, k)
    if len(rows.lower) and supports.foothold_regions:  # the last two rows are those of the flight (30)
        rows.lower[-2:] -= reach
        rows.upper[-2:] += reach
    qp = QP(phase.Q, (phase.J @ k).T.ravel(), rows.G, rows.lower, rows.upper)
    return WalkingQP(qp, phase.preview, supports, k, phase.constraints.point, rows.normals)


def relaxed_qp(walking: WalkingQP, margin: float) -> RelaxedQP:
    """The same QP, made to stay up: margins may be given up, and the plan ends as near to a terminal set as it can.

    A slack s of each sample, at most the margin, widens its CoP polygon, and one more widens the tight terminal set
    for the DCM at the last sample. Their linear penalties are exact: where a margin can be kept, it is.

    Args:
        walking: the QP that has no solution, or leads to a fall.
        margin: of the CoP, that there is to give up [m].
    """
    problem, lipm = walking.qp, walking.preview.lipm
    dcm = walking.preview.beside_stance(lipm.Pds, lipm.Pdu, slice(-1, None))
    end = walking.supports.terminal_set_tight
    terminal = Constraints(dcm, np.zeros(1, dtype=np.int64), (len(end.lower),)).rows(end, walking.inputs)
    G, lower, upper = (
        np.concatenate(both)
        for both in (
            (problem.G, terminal.G),
            (problem.lower, terminal.lower),
            (problem.upper, terminal.upper),
        )
    )
    N, point = lipm.nb_samples, walking.point_of_row
    slack_of_row = np.concatenate([np.where(point < N, point, -1), np.full(len(terminal.lower), N)])
    # Priced by the time that a sample stands for: else a late slack could be cheaper than an early one, and the
    # margin that is planned to be given up would be put off from tick to tick.
    times = np.concatenate([[0.0], lipm.times, lipm.times[-1:]])
    price = np.append(MARGIN_PENALTY * (times[2:] - times[:-2]), TERMINAL_PENALTY)
    most = np.append(np.full(N, max(margin - OVERSHOOT, 0.0)), np.inf)
    return _softened(QP(problem.P, problem.q, G, lower, upper), slack_of_row, price, most)


def _softened(problem: QP, slack_of_row: NDArray[np.int64], price: Vector, most: Vector) -> RelaxedQP:
    """Rows widened by slacks that follow u; -1 for a row that stays as it is."""
    n, k = len(problem.q), len(price)
    S = (slack_of_row[:, None] == np.arange(k)).astype(float)
    above, below = np.isfinite(problem.upper), np.isfinite(problem.lower)
    qp = QP(
        P=np.block([[problem.P, np.zeros((n, k))], [np.zeros((k, n)), np.zeros((k, k))]]),
        q=np.concatenate([problem.q, price]),
        G=np.block([[problem.G[above], -S[above]], [problem.G[below], S[below]], [np.zeros((k, n)), np.eye(k)]]),
        lower=np.concatenate([np.full(above.sum(), -np.inf), problem.lower[below], np.zeros(k)]),
        upper=np.concatenate([problem.upper[above], np.full(below.sum(), np.inf), most]),
    )
    return RelaxedQP(qp, above, below)
