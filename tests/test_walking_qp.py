"""Laws of the walking QP and of its solution."""

from dataclasses import replace

import numpy as np
import pytest

import walkcore.pattern_generator as pattern_generator
from walkcore import Command, Parameters, Reference, Simulation, load_robot
from walkcore.errors import NoSolutionFoundError
from walkcore.lipm import CoMState, preview_matrices
from walkcore.qp import QP, solve_qp
from walkcore.regions import polygon
from walkcore.supports import Supports
from walkcore.walking_qp import Layout, Weights, build_qp, soften_margin

WALK = [Command(Reference())] * 10 + [Command(Reference(vx=0.3, vy=0.1))] * 20 + [Command(Reference(vx=-0.2))] * 20


@pytest.fixture(scope="module")
def problems():
    """The QPs of a short walk at the paper's period, with their solutions."""
    seen = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            pattern_generator, "solve_qp", lambda problem: seen.append((problem, solve_qp(problem))) or seen[-1][1]
        )
        simulation = Simulation(load_robot("hrp2"), Parameters(control_period=0.1, stepping_in_place=True))
        for command in WALK:
            simulation.step(command)
    return seen


def test_solutions_satisfy_the_kkt_conditions(problems):
    for problem, solution in problems:
        u, multipliers = solution.u, solution.multipliers
        stationarity = problem.P @ u + problem.q + problem.G.T @ multipliers
        assert np.max(np.abs(stationarity * problem.scale)) < 1e-8
        to_upper, to_lower = problem.upper - problem.G @ u, problem.G @ u - problem.lower
        assert np.min(to_upper) > -1e-8
        assert np.min(to_lower) > -1e-8
        pushes_up, pushes_down = multipliers > 0, multipliers < 0
        assert np.max((multipliers * to_upper)[pushes_up], initial=0.0) < 1e-8
        assert np.max((-multipliers * to_lower)[pushes_down], initial=0.0) < 1e-8


def test_no_step_along_a_feasible_direction_lowers_the_cost(problems):
    rng = np.random.default_rng(0)
    for problem, solution in problems[::7]:
        u = solution.u
        cost = 0.5 * u @ problem.P @ u + problem.q @ u
        inside = solve_qp(replace(problem, P=np.diag(1.0 / problem.scale**2), q=np.zeros_like(problem.q))).u
        for _ in range(10):
            v = u + rng.uniform(0.0, 1.0) * (inside - u) * (1.0 + 1e-3 * rng.normal())
            if np.all(problem.G @ v <= problem.upper) and np.all(problem.G @ v >= problem.lower):
                assert 0.5 * v @ problem.P @ v + problem.q @ v >= cost - 1e-9 * abs(cost)


PAPER = Weights(alpha=1e-6, beta=1.0, gamma=1e-6)


def problem_on_one_foot(com, margin=0.03, weights=PAPER):
    """Standing for ever on the left sole at the origin: no foothold in the horizon."""
    N = 16
    sole = polygon(load_robot("hrp2").sole).inset(margin)
    supports = Supports(
        known_centre=np.zeros((N, 2)),
        selection=np.zeros((N, 0)),
        cop_polygons=(sole,) * N,
        support_position=np.zeros(2),
        foothold_regions=(),
        swing_position=np.array([0.0, -0.2]),
        swing_reach=sole,
        capturable_soon=None,
        capturable_at_end=(),
        sides=(),
        yaws=(),
        stopping_offset=None,
    )
    preview = preview_matrices(np.full(N, 0.1), 0.814)
    return build_qp(com, supports, np.zeros((N, 2)), preview, weights), supports


def test_without_active_constraints_the_solution_is_the_normal_equations():
    com = CoMState([0.001, 0.0], [0.002, -0.001], [0.0, 0.0])
    weights = Weights(1e-2, 1.0, 1.0)
    problem, supports = problem_on_one_foot(com, margin=0.0, weights=weights)
    u = solve_qp(problem).u
    preview = preview_matrices(np.full(16, 0.1), 0.814)
    terms = [
        (weights.alpha, np.eye(16), np.zeros((16, 2))),
        (weights.beta, preview.Pvu, preview.Pvs @ com.matrix),
        (weights.gamma, preview.Pzu, preview.Pzs @ com.matrix),
    ]
    rows = np.vstack([np.sqrt(w) * A for w, A, _ in terms])
    offset = np.vstack([np.sqrt(w) * b for w, _, b in terms])
    expected, *_ = np.linalg.lstsq(rows, -offset, rcond=None)
    assert np.allclose(Layout.of(supports).jerks(u), expected, atol=1e-5 * np.abs(expected).max())


def test_an_infeasible_qp_raises():
    problem = QP(
        np.eye(1), np.zeros(1), np.array([[1.0], [1.0]]), np.array([1.0, -np.inf]), np.array([np.inf, -1.0]), np.ones(1)
    )
    with pytest.raises(NoSolutionFoundError, match="1 variables"):
        solve_qp(problem)


def test_a_soft_margin_that_can_be_kept_is_kept():
    problem, supports = problem_on_one_foot(CoMState([0.0, 0.0], [0.05, 0.1], [0.0, 0.0]))
    hard, soft = solve_qp(problem).u, solve_qp(soften_margin(problem, supports, 0.03)).u
    assert np.allclose(Layout.of(supports).jerks(soft), Layout.of(supports).jerks(hard), atol=1e-2)


def test_a_margin_that_cannot_be_kept_is_given_up_but_never_the_sole():
    # The CoP is 2 cm outside of the margin and its first sample 5 ms away: jerk alone cannot bring it back.
    supports_of = problem_on_one_foot(CoMState(np.zeros(2), np.zeros(2), np.zeros(2)))[1]
    conflicting = replace(supports_of.cop_polygons[0], lower=supports_of.cop_polygons[0].lower + 0.1)
    supports = replace(supports_of, cop_polygons=(conflicting, *supports_of.cop_polygons[1:]))
    preview = preview_matrices(np.full(16, 0.1), 0.814)
    com = CoMState(np.zeros(2), np.zeros(2), np.zeros(2))
    problem = build_qp(com, supports, np.zeros((16, 2)), preview, PAPER)
    with pytest.raises(NoSolutionFoundError):
        solve_qp(problem)
    u = solve_qp(soften_margin(problem, supports, 0.03)).u
    slack = u[-16:]
    assert np.all(slack > -1e-8)
    assert np.all(slack < 0.03 + 1e-8)
    assert slack[0] > 0.0
