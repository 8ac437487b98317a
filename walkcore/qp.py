"""Quadratic programs, and the only file that knows solvers.

    minimise  1/2 u^T P u + q^T u    subject to    lower <= G u <= upper

The cost of the walking QP is almost flat along the foot positions: with metres as
their unit a solver stops centimetres away while its residuals look fine. So they come
in units of 10 km (`preview.py`); with these tolerances the footholds are within 0.2 mm of
an exact solver's on the recorded walks (tests/test_recorded_walks.py). DAQP, an active-set
method, is exact and more than twice as fast, but at a loss where the cost has flat directions
at all, as in the rescue QP.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import daqp
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


def solve_qp(problem: QP, solver: str = "piqp") -> Solution:
    """The minimiser of a QP.

    Args:
        problem: any.
        solver: one of `SOLVERS`.

    Raises:
        NoSolutionFoundError: if the solver does not reach its tolerance, which an infeasible problem ends in.
    """
    if not len(problem.lower):
        return Solution(np.asarray(np.linalg.solve(problem.P, -problem.q), dtype=np.float64), np.zeros(0))
    solution = SOLVERS[solver](problem)
    if not np.isfinite(solution.u).all():
        raise NoSolutionFoundError(f"{solver} gave a solution that is not finite for {problem.summary}")
    return solution


def interior_point_solver() -> piqp.DenseSolver:
    """PIQP with the settings that this QP needs."""
    solver = piqp.DenseSolver()
    settings = solver.settings
    settings.eps_abs = settings.eps_rel = TOLERANCE
    settings.eps_duality_gap_abs = settings.eps_duality_gap_rel = GAP_TOLERANCE
    settings.max_iter = MAX_ITERATIONS
    settings.preconditioner_iter = 0  # the units are ours; PIQP's scaling makes the footholds 1 cm worse
    return solver


def piqp_form(problem: QP) -> dict[str, Vector]:
    """The arguments of PIQP's `setup`."""
    return {
        "P": np.asfortranarray(problem.P),
        "c": problem.q,
        "G": np.asfortranarray(problem.G),
        "h_l": np.maximum(problem.lower, -UNBOUNDED),
        "h_u": np.minimum(problem.upper, UNBOUNDED),
    }


def _by_interior_points(problem: QP) -> Solution:
    solver = interior_point_solver()
    solver.setup(**piqp_form(problem))
    status = solver.solve()
    if status != piqp.PIQP_SOLVED:
        raise NoSolutionFoundError(f"no solution ({status.name}) for {problem.summary}")
    return Solution(solver.result.x, solver.result.z_u - solver.result.z_l)


def _by_active_sets(problem: QP) -> Solution:
    P, G = np.ascontiguousarray(problem.P), np.ascontiguousarray(problem.G)
    solve = cast(Callable[..., Any], daqp.solve)  # pyright: ignore[reportUnknownMemberType] (has no types)
    u, _, status, information = solve(P, problem.q, G, problem.upper, problem.lower, primal_tol=TOLERANCE)
    if status != 1:  # no solution, or flat directions in which it got lost
        return _by_interior_points(problem)
    return Solution(np.asarray(u), np.asarray(information["lam"]))


SOLVERS = {"piqp": _by_interior_points, "daqp": _by_active_sets}
