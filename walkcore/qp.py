"""Quadratic programs, and the only file that knows a solver.

    minimise  1/2 u^T P u + q^T u    subject to    lower <= G u <= upper

The cost of the walking QP is almost flat along the foot positions: with metres as
their unit a solver stops centimetres away while its residuals look fine. So they come
in units of 10 km (`preview.py`); with these tolerances the footholds are within 0.2 mm of
an exact solver's on the recorded walks (tests/test_recorded_walks.py).
"""

from dataclasses import dataclass

import numpy as np
import piqp

from walkcore.errors import NoSolutionFoundError
from walkcore.values import Matrix, Vector

TOLERANCE = 1e-9  # of the residuals of the scaled problem, absolute and relative
GAP_TOLERANCE = 1e-11  # of the duality gap: what moves the footholds last
MAX_ITERATIONS = 100
UNBOUNDED = 1e30  # PIQP's infinity


@dataclass(frozen=True, slots=True, eq=False)
class QP:
    """minimise 1/2 u^T P u + q^T u subject to lower <= G u <= upper."""

    P: Matrix
    """Symmetric, positive semidefinite, shape (n, n)."""
    q: Vector
    """Shape (n,)."""
    G: Matrix
    """Shape (r, n)."""
    lower: Vector
    """Shape (r,), minus infinity where a row has no lower bound."""
    upper: Vector
    """Shape (r,)."""

    @property
    def summary(self) -> str:
        """For messages."""
        return f"a QP of {len(self.q)} variables and {len(self.lower)} rows"


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """A minimiser and its multipliers: P u + q + G^T multipliers = 0."""

    u: Vector
    """Shape (n,)."""
    multipliers: Vector
    """Positive where the upper bound of a row is active, negative where the lower one is, shape (r,)."""


def solve_qp(problem: QP) -> Solution:
    """The minimiser of a QP.

    Raises:
        NoSolutionFoundError: if PIQP does not reach its tolerance, which an infeasible problem ends in.
    """
    if not len(problem.lower):
        return Solution(np.asarray(np.linalg.solve(problem.P, -problem.q), dtype=np.float64), np.zeros(0))
    solver = piqp.DenseSolver()
    settings = solver.settings
    settings.eps_abs = settings.eps_rel = TOLERANCE
    settings.eps_duality_gap_abs = settings.eps_duality_gap_rel = GAP_TOLERANCE
    settings.max_iter = MAX_ITERATIONS
    settings.preconditioner_iter = 0  # the units are ours; PIQP's scaling makes the footholds 1 cm worse
    solver.setup(
        P=np.asfortranarray(problem.P),
        c=problem.q,
        G=np.asfortranarray(problem.G),
        h_l=np.maximum(problem.lower, -UNBOUNDED),
        h_u=np.minimum(problem.upper, UNBOUNDED),
    )
    status = solver.solve()
    u = solver.result.x
    if status != piqp.PIQP_SOLVED or not np.isfinite(u).all():
        raise NoSolutionFoundError(f"no solution ({status.name}) for {problem.summary}")
    return Solution(u, solver.result.z_u - solver.result.z_l)
