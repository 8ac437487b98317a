"""Quadratic programs, and the only file that knows solvers.

    minimise  1/2 u^T P u + q^T u    subject to    lower <= G u <= upper

The cost of the walking QP is almost flat along the foot positions: with metres as their
unit a solver stops centimetres away while its residuals look fine. So u holds them divided
by `FOOTHOLD_SCALE` (`preview.py`); with these tolerances the footholds are within 0.2 mm of an
exact solver's on the recorded walks (tests/test_recorded_walks.py).

PIQP, an interior-point method, is the default: it takes the same time for every QP, be it of a
walk or of a push, and solves the relaxed QP, whose cost has flat directions. DAQP, an active-set
method, is exact and takes less than half as long on the walking QP, for whom many walks matter
more than a steady tick; where it finds no solution, PIQP decides.

Every solve is bounded by iterations, whose number decides the same on every machine. A live walk limits the time too.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol, cast

import daqp
import numpy as np
import piqp

from walkcore.errors import InfeasibleError, NoSolutionFoundError, OutOfTimeError
from walkcore.stages import UNTIMED, Stages, TimeLeft, unlimited
from walkcore.values import Matrix, Vector

TOLERANCE = 1e-9  # of the residuals of the scaled problem, absolute and relative
GAP_TOLERANCE = 1e-11  # of the duality gap: what moves the footholds last
STALLED_GAP = 1e-6  # duality gap over the cost, at which a relaxed QP whose solve gets no further counts as solved
MAX_ITERATIONS = 100  # of PIQP; a QP of a walk takes 10 to 40
MAX_ACTIVE_SET_ITERATIONS = 500  # of DAQP; a QP of a walk takes 30 to 300, one with flat directions runs to any limit


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


class Solver(Protocol):
    """A solver with its workspace, for one QP after the other."""

    def solve(self, problem: QP, stages: Stages = UNTIMED, time_left: TimeLeft = unlimited) -> Solution:
        """The minimiser of a QP, which depends on that QP alone.

        Args:
            problem: of any size.
            stages: gets a lap when all is ready for the solver ("assemble") and when the solver is done ("solve").
            time_left: for the solve; PIQP, whose iterations are few, only starts within it, DAQP has to end, too.

        Raises:
            InfeasibleError: if the solver has found that the bounds contradict each other.
            NoSolutionFoundError: if it does not reach its tolerance, in which an infeasible problem may end, too.
            OutOfTimeError: if the time is over.
        """
        ...


class InteriorPointSolver:
    """PIQP."""

    def __init__(self, stalled_gap: float = 0.0) -> None:
        """Choose the tolerances.

        Args:
            stalled_gap: duality gap over the cost, at which a feasible point counts as the solution when the solver
                gets no nearer to its tolerance; by default it never does.
        """
        self._stalled_gap, self._solver = stalled_gap, piqp.DenseSolver()
        settings = self._solver.settings
        settings.eps_abs = settings.eps_rel = TOLERANCE
        settings.eps_duality_gap_abs = settings.eps_duality_gap_rel = GAP_TOLERANCE
        settings.max_iter = MAX_ITERATIONS
        settings.preconditioner_iter = 0  # the units are ours; PIQP's scaling makes the footholds 1 cm worse

    def solve(self, problem: QP, stages: Stages = UNTIMED, time_left: TimeLeft = unlimited) -> Solution:
        """See `Solver`."""
        if not len(problem.lower):
            return _without_bounds(problem, stages)
        _check_time(problem, time_left())
        solver, P, G = self._solver, np.asfortranarray(problem.P), np.asfortranarray(problem.G)
        stages.lap("assemble")
        solver.setup(P=P, c=problem.q, G=G, h_l=problem.lower, h_u=problem.upper)
        status = solver.solve()
        stages.lap("solve")
        result = solver.result
        if status != piqp.PIQP_SOLVED and not self._has_stalled_near_enough(result.info):
            error = InfeasibleError if status == piqp.PIQP_PRIMAL_INFEASIBLE else NoSolutionFoundError
            raise error(f"no solution ({status.name}) for {problem.summary}")
        return _finite(Solution(result.x, result.z_u - result.z_l), problem)

    def _has_stalled_near_enough(self, info: Any) -> bool:
        """Whether rounding keeps the solver from its tolerance, at a point that keeps all bounds and costs no more."""
        gap = info.duality_gap / (1.0 + abs(info.primal_obj))
        return bool(info.primal_res <= TOLERANCE and gap <= self._stalled_gap)


class ActiveSetSolver:
    """DAQP, and PIQP where it finds no solution."""

    def __init__(self) -> None:
        """Prepare the workspace of both."""
        self._fallback = InteriorPointSolver()
        self._solve = cast(Callable[..., Any], daqp.solve)  # pyright: ignore[reportUnknownMemberType] (has no types)

    def solve(self, problem: QP, stages: Stages = UNTIMED, time_left: TimeLeft = unlimited) -> Solution:
        """See `Solver`."""
        if not len(problem.lower):
            return _without_bounds(problem, stages)
        P, G = np.ascontiguousarray(problem.P.T), np.ascontiguousarray(problem.G)  # P is symmetric
        stages.lap("assemble")
        limit = _check_time(problem, time_left())
        u, _, status, information = self._solve(
            *(P, problem.q, G, problem.upper, problem.lower),
            primal_tol=TOLERANCE,
            iter_limit=MAX_ACTIVE_SET_ITERATIONS,
            time_limit=limit if math.isfinite(limit) else 0.0,  # for DAQP, 0 is no limit
        )
        stages.lap("solve")
        _check_time(problem, time_left())  # else whether DAQP came to its end would depend on its own clock
        if status != 1:  # no solution, or flat directions in which it got lost
            return self._fallback.solve(problem, stages, time_left)
        return _finite(Solution(np.asarray(u), np.asarray(information["lam"])), problem)


SOLVERS: Mapping[str, type[Solver]] = MappingProxyType({"piqp": InteriorPointSolver, "daqp": ActiveSetSolver})
"""Solvers by the names that `Parameters.solver` may have."""


def solve_qp(problem: QP, solver: str = "piqp") -> Solution:
    """The minimiser of a single QP by a solver of its own; raises as `Solver.solve` does.

    Args:
        problem: of any size.
        solver: one of `SOLVERS`.
    """
    return SOLVERS[solver]().solve(problem)


def _without_bounds(problem: QP, stages: Stages) -> Solution:
    stages.lap("assemble")
    u = np.asarray(np.linalg.solve(problem.P, -problem.q), dtype=np.float64)
    stages.lap("solve")
    return _finite(Solution(u, np.zeros(0)), problem)


def _check_time(problem: QP, time_left: float) -> float:
    """The time left [s], if there is any."""
    if time_left <= 0.0:
        raise OutOfTimeError(f"no time is left for {problem.summary}")
    return time_left


def _finite(solution: Solution, problem: QP) -> Solution:
    if not math.isfinite(solution.u.sum()):  # as no sum is with a term that is not
        raise NoSolutionFoundError(f"the solution is not finite for {problem.summary}")
    return solution
