"""Solvers side by side on the QPs of a walk, with the accuracy of what the QP is for: the next foothold."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import quadprog

from walkcore import Scenario, Simulation
from walkcore.mpc.preview import Layout
from walkcore.mpc.qp import QP, SOLVERS, Solver
from walkcore.values import Vector

TURN = 25  # QPs that a solver solves before it is the next one's turn: a machine that is busy is so for all of them
EXACT = "quadprog"  # Goldfarb and Idnani's dual active-set method, whose footholds the others are measured against
CLOCK = time.thread_time  # what other processes take of the core does not count
COST_UNIT = 1e6  # its tolerances are absolute, and the cost is small


@dataclass(frozen=True, slots=True)
class Durations:
    """Summary of the durations of something that was done many times [us]."""

    median: float
    p99: float
    max: float

    @classmethod
    def of(cls, seconds: Iterable[float]) -> "Durations":
        """The summary of durations.

        Args:
            seconds: one or more durations [s].
        """
        us = 1e6 * np.array(list(seconds))
        return cls(float(np.median(us)), float(np.percentile(us, 99)), float(np.max(us)))

    @property
    def tail(self) -> float:
        """Ratio of the 99th percentile to the median."""
        return self.p99 / self.median


@dataclass(frozen=True, slots=True)
class SolverResult:
    """Duration and accuracy of a solver on the QPs of a walk."""

    duration: Durations
    ratio: float
    """Median duration over that of the exact solver."""
    foothold_error_p95: float
    """95th percentile of the distance to the exact footholds, along each axis [mm]."""
    foothold_error_max: float
    """Largest such distance [mm]."""


def problems_of(scenario: Scenario, count: int) -> list[QP]:
    """QPs of a walk, evenly spread over it.

    Args:
        scenario: to be walked.
        count: number of QPs, roughly.
    """
    simulation = Simulation(scenario.robot, scenario.parameters)
    every = max(1, scenario.nb_ticks // count)
    problems: list[QP] = []
    for tick, command in enumerate(scenario.commands()):
        if tick % every == 0:
            problems.append(simulation.qp(command.reference))
        simulation.step(command)
    return problems


def compare(problems: Sequence[QP], nb_samples: int) -> dict[str, SolverResult]:
    """Solve QPs by every solver, taking turns.

    Args:
        problems: to be solved.
        nb_samples: samples of their horizons.
    """
    solvers: dict[str, Callable[[QP], Vector]] = {name: partial(_solution, kind()) for name, kind in SOLVERS.items()}
    solvers |= {EXACT: _exact}
    durations: dict[str, list[float]] = {name: [] for name in solvers}
    footholds: dict[str, list[Vector]] = {name: [] for name in solvers}
    for start in range(0, len(problems), TURN):
        for name, solve in solvers.items():
            for problem in problems[start : start + TURN]:
                begin = CLOCK()
                u = solve(problem)
                durations[name].append(CLOCK() - begin)
                _, positions = Layout(nb_samples, len(u) // 2 - nb_samples, has_foothold_variables=True).split(u)
                footholds[name].append(positions[:1].ravel())
    exact = np.concatenate(footholds[EXACT])
    return {
        name: _result(durations[name], durations[EXACT], np.concatenate(footholds[name]) - exact) for name in solvers
    }


def _result(durations: list[float], exact: list[float], errors: Vector) -> SolverResult:
    summary, mm = Durations.of(durations), 1e3 * np.abs(errors)
    ratio = summary.median / Durations.of(exact).median
    return SolverResult(summary, ratio, float(np.percentile(mm, 95)), float(np.max(mm)))


def _solution(solver: Solver, problem: QP) -> Vector:
    return solver.solve(problem).u


def _exact(problem: QP) -> Vector:
    above, below = np.isfinite(problem.upper), np.isfinite(problem.lower)
    C = np.vstack([-problem.G[above], problem.G[below]])
    b = np.concatenate([-problem.upper[above], problem.lower[below]])
    u, *_ = quadprog.solve_qp(COST_UNIT * problem.P, -COST_UNIT * problem.q, C.T, b)
    return u
