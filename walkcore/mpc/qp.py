"""Quadratic programs, and the only file that knows solvers.

    minimise  1/2 u^T P u + q^T u    subject to    lower <= G u <= upper

The cost of the walking QP is almost flat along the foot positions: with metres as
their unit a solver stops centimetres away while its residuals look fine. So they come
in units of 10 km (`preview.py`); with these tolerances the footholds are within 0.2 mm of
an exact solver's on the recorded walks (tests/test_recorded_walks.py). DAQP, an active-set
method, is exact and more than twice as fast, but at a loss where the cost has flat directions
at all, as in the rescue QP.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import daqp
import numpy as np
import piqp

from walkcore.errors import NoSolutionFoundError
from walkcore.stages import UNTIMED, Stages
from walkcore.values import Matrix, Vector

TOLERANCE = 1e-9  # of the residuals of the scaled problem, absolute and relative
GAP_TOLERANCE = 1e-11  # of the duality gap: what moves the footholds last
MAX_ITERATIONS = 100


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


def solve_qp(problem: QP, solver: str = "piqp", stages: Stages = UNTIMED) -> Solution:
    """The minimiser of a QP.

    Args:
        problem: any.
        solver: one of `SOLVERS`.
        stages: is told when all is ready for the solver ("assemble") and when the solver is done ("solve").

    Raises:
        NoSolutionFoundError: if the solver does not reach its tolerance, which an infeasible problem ends in.
    """
    solution = SOLVERS[solver](problem, stages) if len(problem.lower) else _without_bounds(problem, stages)
    if not math.isfinite(solution.u.sum()):  # as no sum is with a term that is not
        raise NoSolutionFoundError(f"{solver} gave a solution that is not finite for {problem.summary}")
    return solution


def _without_bounds(problem: QP, stages: Stages) -> Solution:
    stages.lap("assemble")
    u = np.asarray(np.linalg.solve(problem.P, -problem.q), dtype=np.float64)
    stages.lap("solve")
    return Solution(u, np.zeros(0))


def _by_interior_points(problem: QP, stages: Stages) -> Solution:
    solver = _interior_point_solver()
    P, G = np.asfortranarray(problem.P), np.asfortranarray(problem.G)
    stages.lap("assemble")
    solver.setup(P=P, c=problem.q, G=G, h_l=problem.lower, h_u=problem.upper)
    status = solver.solve()
    stages.lap("solve")
    if status != piqp.PIQP_SOLVED:
        raise NoSolutionFoundError(f"no solution ({status.name}) for {problem.summary}")
    return Solution(solver.result.x, solver.result.z_u - solver.result.z_l)


def _interior_point_solver() -> piqp.DenseSolver:
    solver = piqp.DenseSolver()
    settings = solver.settings
    settings.eps_abs = settings.eps_rel = TOLERANCE
    settings.eps_duality_gap_abs = settings.eps_duality_gap_rel = GAP_TOLERANCE
    settings.max_iter = MAX_ITERATIONS
    settings.preconditioner_iter = 0  # the units are ours; PIQP's scaling makes the footholds 1 cm worse
    return solver


def _by_active_sets(problem: QP, stages: Stages) -> Solution:
    P, G = np.ascontiguousarray(problem.P), np.ascontiguousarray(problem.G)
    solve = cast(Callable[..., Any], daqp.solve)  # pyright: ignore[reportUnknownMemberType] (has no types)
    stages.lap("assemble")
    u, _, status, information = solve(P, problem.q, G, problem.upper, problem.lower, primal_tol=TOLERANCE)
    stages.lap("solve")
    if status != 1:  # no solution, or flat directions in which it got lost
        return _by_interior_points(problem, stages)
    return Solution(np.asarray(u), np.asarray(information["lam"]))


SOLVERS = {"piqp": _by_interior_points, "daqp": _by_active_sets}
