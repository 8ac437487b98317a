"""The QP that decides footsteps and CoM motion together: (19) with (27)-(30).

    minimise   1/2 u^T Q u + p^T u                                           (23)-(25)
    so that    every centre of pressure stays in its support polygon         (28)
               every foothold lies in the region beside its predecessor      (section 5)
               the foot in the air can reach the next foothold in time       (30)

Where it has no solution, or leads to a fall, the relaxed QP takes its place: our addition.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from walkcore.mpc.balance_sets import OVERSHOOT
from walkcore.mpc.constraints import ConstraintRows, Constraints, constrained_points, polygon_of_point
from walkcore.mpc.objective import objective
from walkcore.mpc.preview import FOOTHOLD_SCALE, SUPPORT, Preview, QPInputs
from walkcore.mpc.qp import QP
from walkcore.mpc.regions import HalfPlanes
from walkcore.mpc.supports import Supports
from walkcore.parameters import Parameters
from walkcore.values import Matrix, Vector

MARGIN_PENALTY = 1e4  # per metre and second; above any multiplier of the margin, so that the penalty is exact
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

    def with_more_reach(self, more: Vector) -> "WalkingQP":
        """This QP, where the foot in the air reaches farther (30).

        Args:
            more: distance along x and y of the support foot's frame, negative for less [m], shape (2,).
        """
        qp = self.qp
        lower, upper = qp.lower.copy(), qp.upper.copy()
        _reach_farther(lower, upper, more, self.supports)
        return replace(self, qp=QP(qp.P, qp.q, qp.G, lower, upper))


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
    _reach_farther(rows.lower, rows.upper, reach, supports)
    qp = QP(phase.Q, (phase.J @ k).T.ravel(), rows.G, rows.lower, rows.upper)
    return WalkingQP(qp, phase.preview, supports, k, phase.constraints.point, rows.normals)


def _reach_farther(lower: Vector, upper: Vector, more: Vector, supports: Supports) -> None:
    """Widen the bounds of the flight (30), which are the last two where a foothold is to be chosen, in place."""
    if len(lower) and supports.foothold_regions:
        lower[-2:] -= more
        upper[-2:] += more


def viable_qp(walking: WalkingQP) -> QP | None:
    """The same QP with rows behind its own: at the first sample on the next foothold the DCM is viable.

    By steps that use part of their regions only: at the edge of what is viable the robot would never recover.

    Returns:
        None if no sample stands on the next foothold.
    """
    sample, viable = walking.preview.stances.sample_on_foothold, walking.supports.viable_on_foothold_tight
    if sample is None or viable is None:
        return None
    return _with_rows(walking.qp, _rows_of_dcm(walking, sample, viable), *_rows_of_later_flights(walking))


def _with_rows(qp: QP, *blocks: ConstraintRows) -> QP:
    """The same QP with more rows behind its own."""
    G, lower, upper = (
        np.concatenate([own, *(getattr(block, name) for block in blocks)])
        for own, name in ((qp.G, "G"), (qp.lower, "lower"), (qp.upper, "upper"))
    )
    return QP(qp.P, qp.q, G, lower, upper)


def _rows_of_later_flights(walking: WalkingQP) -> Iterator[ConstraintRows]:
    """Rows that keep each foothold after the next one where the foot that stands two steps before can fly in time."""
    reachable, m = walking.supports.later_flight, walking.preview.layout.nb_free_footholds
    if reachable is None or m < 2:
        return
    N, flights = walking.preview.lipm.nb_samples, walking.preview.zeros(m - 1)
    flights.D[:, N:] = FOOTHOLD_SCALE * (np.eye(m - 1, m, 1) - np.eye(m - 1, m, -1))
    flights.K[0, SUPPORT] = -1.0
    kept_by = np.zeros(m - 1, dtype=np.int64)
    yield Constraints(flights, kept_by, (len(reachable.lower),)).rows(reachable, walking.inputs)


def _rows_of_dcm(walking: WalkingQP, sample: int, polygon: HalfPlanes) -> ConstraintRows:
    """Rows that keep the DCM of a sample, as seen from its stance, in a polygon."""
    return _constraints_of_dcm(walking.preview, sample, len(polygon.lower)).rows(polygon, walking.inputs)


@lru_cache(maxsize=256)  # the ticks between two samples have the same, and so have the steps of a walk
def _constraints_of_dcm(preview: Preview, sample: int, nb_edges: int) -> Constraints:
    lipm = preview.lipm
    dcm = preview.beside_stance(lipm.Pds, lipm.Pdu, slice(sample, sample + 1))
    return Constraints(dcm, np.zeros(1, dtype=np.int64), (nb_edges,))


def _soft_terminal_set(walking: WalkingQP) -> tuple[int, HalfPlanes]:
    """The sample whose DCM the relaxed QP brings as near to a set as it can, and that set.

    It is the last sample, or the first one on the next foothold where steps are short: a horizon of many steps would
    put the recovery off from step to step.
    """
    stances, supports = walking.preview.stances, walking.supports
    sample, tight = stances.sample_on_foothold, supports.viable_on_foothold_tight
    if supports.later_flight is None or sample is None or tight is None:
        return walking.preview.lipm.nb_samples - 1, supports.terminal_set_tight
    return sample, tight


def relaxed_qp(walking: WalkingQP, margin: float) -> RelaxedQP:
    """The same QP, made to stay up: margins may be given up, and the plan ends as near to a terminal set as it can.

    A slack s of each sample, at most the margin, widens its CoP polygon, and one more widens the tight terminal set
    for the DCM at the last sample. Their linear penalties are exact: where a margin can be kept, it is.

    Args:
        walking: the QP that has no solution, or leads to a fall.
        margin: of the CoP, that there is to give up [m].
    """
    problem, lipm = walking.qp, walking.preview.lipm
    terminal = _rows_of_dcm(walking, *_soft_terminal_set(walking))
    flights = tuple(_rows_of_later_flights(walking))
    problem = _with_rows(problem, terminal, *flights)
    N, point = lipm.nb_samples, walking.point_of_row
    nb_hard = sum(len(rows.lower) for rows in flights)
    slack_of_row = np.concatenate(
        [np.where(point < N, point, -1), np.full(len(terminal.lower), N), np.full(nb_hard, -1)]
    )
    # Priced by the time that a sample stands for: else a late slack could be cheaper than an early one, and the
    # margin that is planned to be given up would be put off from tick to tick.
    times = np.concatenate([[0.0], lipm.times, lipm.times[-1:]])
    price = np.append(MARGIN_PENALTY * (times[2:] - times[:-2]), TERMINAL_PENALTY)
    most = np.append(np.full(N, max(margin - OVERSHOOT, 0.0)), np.inf)
    return _softened(problem, slack_of_row, price, most)


def _softened(problem: QP, slack_of_row: NDArray[np.int64], price: Vector, most: Vector) -> RelaxedQP:
    """Rows widened by slacks that follow u; -1 for a row that stays as it is."""
    n, k = len(problem.q), len(price)
    above, below = np.isfinite(problem.upper), np.isfinite(problem.lower)
    nb_above, nb_below = int(above.sum()), int(below.sum())
    P = np.zeros((n + k, n + k), order="F")
    P[:n, :n] = problem.P
    G = np.zeros((nb_above + nb_below + k, n + k), order="F")
    G[:nb_above, :n], G[nb_above : nb_above + nb_below, :n] = problem.G[above], problem.G[below]
    slack = np.concatenate([slack_of_row[above], slack_of_row[below]])
    sign = np.repeat([-1.0, 1.0], [nb_above, nb_below])
    rows = np.flatnonzero(slack >= 0)
    G[rows, n + slack[rows]] = sign[rows]
    G[nb_above + nb_below :, n:] = np.eye(k)
    qp = QP(
        P=P,
        q=np.concatenate([problem.q, price]),
        G=G,
        lower=np.concatenate([np.full(nb_above, -np.inf), problem.lower[below], np.zeros(k)]),
        upper=np.concatenate([problem.upper[above], np.full(nb_below, np.inf), most]),
    )
    return RelaxedQP(qp, above, below)
