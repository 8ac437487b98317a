"""Laws of the walking QP and of its solution."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.errors import NoSolutionFoundError
from walkcore.mpc.horizon import StanceSequence
from walkcore.mpc.lipm import CoMState, Pendulum, preview_matrices
from walkcore.mpc.plan import Status
from walkcore.mpc.preview import Preview, QPInputs
from walkcore.mpc.qp import QP, SOLVERS, solve_qp
from walkcore.mpc.regions import HalfPlanes, box, half_planes
from walkcore.mpc.schemes import SCHEMES
from walkcore.mpc.supports import Supports
from walkcore.mpc.walking_qp import phase_matrices, relaxed_qp, walking_qp

WALK = [Command(Reference())] * 10 + [Command(Reference(vx=0.3, vy=0.1))] * 20 + [Command(Reference(vx=-0.2))] * 20


@pytest.fixture(scope="module", params=SOLVERS)
def problems(request):
    """The QPs of a short walk at the paper's period, with their solutions."""
    simulation = Simulation(load_robot("hrp2"), Parameters(control_period=0.1, stepping_in_place=True))
    seen = []
    for command in WALK:
        problem = simulation.qp(command.reference)
        seen.append((problem, solve_qp(problem, request.param)))
        simulation.step(command)
    return seen


def test_solutions_satisfy_the_kkt_conditions(problems):
    for problem, solution in problems:
        u, multipliers = solution.u, solution.multipliers
        stationarity = problem.P @ u + problem.q + problem.G.T @ multipliers
        assert np.max(np.abs(stationarity)) < 1e-8
        to_upper, to_lower = problem.upper - problem.G @ u, problem.G @ u - problem.lower
        assert np.min(to_upper) > -1e-8
        assert np.min(to_lower) > -1e-8
        pushes_up, pushes_down = multipliers > 0, multipliers < 0
        assert np.max(multipliers[pushes_up] * to_upper[pushes_up], initial=0.0) < 1e-8
        assert np.max(-multipliers[pushes_down] * to_lower[pushes_down], initial=0.0) < 1e-8


def test_no_step_along_a_feasible_direction_lowers_the_cost(problems):
    rng = np.random.default_rng(0)
    for problem, solution in problems[::7]:
        u = solution.u
        cost = 0.5 * u @ problem.P @ u + problem.q @ u
        inside = solve_qp(replace(problem, P=np.eye(len(u)), q=np.zeros_like(problem.q))).u
        for _ in range(10):
            v = u + rng.uniform(0.0, 1.0) * (inside - u) * (1.0 + 1e-3 * rng.normal())
            if np.all(problem.G @ v <= problem.upper) and np.all(problem.G @ v >= problem.lower):
                assert 0.5 * v @ problem.P @ v + problem.q @ v >= cost - 1e-9 * abs(cost)


@dataclass
class Stand:
    """For ever on the left sole at the origin: no foothold in the horizon."""

    com: CoMState
    parameters: Parameters = Parameters()
    margin: float = 0.03
    first_polygon: HalfPlanes | None = None  # of the first sample, as if it were carried by both feet

    def __post_init__(self):
        sole = half_planes(load_robot("hrp2").sole).inset(self.margin)
        self.lipm = preview_matrices(np.full(16, 0.1), Pendulum(0.814))
        is_double_support = np.arange(16) < (self.first_polygon is not None)
        stances = StanceSequence(np.zeros(16, int), is_double_support, False, np.zeros(16, int))
        supports = Supports(
            cop_polygons=(sole, self.first_polygon) if self.first_polygon else (sole,),
            foothold_regions=(),
            flight=box([0.0, 0.0]),
            region_vertices=(),
            to_middle=np.zeros(2),
            later_flight=None,
            viable_at_next_sample=None,
            viable_on_foothold=None,
            viable_on_foothold_tight=None,
            terminal_set_tight=box([10.0, 10.0]),
            terminal_set_on_whole_soles=sole,
            sides=(),
            yaws=(),
            stopping_offset=None,
        )
        preview = Preview(stances, self.lipm, samples_per_step=8, has_foothold_variables=True)
        phase = phase_matrices(preview, self.parameters, supports.nb_edges)
        nowhere = np.zeros(2)
        inputs = QPInputs(self.com, nowhere, np.array([0.0, -0.2]), nowhere, np.zeros((0, 2)), np.zeros((16, 2)))
        self.walking = walking_qp(phase, supports, nowhere, inputs)

    def split(self, u):
        jerks, _ = self.walking.preview.layout.split(u)
        return jerks

    def jerks(self):
        return self.split(solve_qp(self.walking.qp).u)

    def relaxed(self):
        return solve_qp(relaxed_qp(self.walking, 0.03).qp).u


def test_without_active_constraints_the_solution_is_the_normal_equations():
    com = CoMState([[0.001, 0.0], [0.002, -0.001], [0.0, 0.0]])
    parameters = Parameters(alpha=1e-2, beta=1.0, gamma=1.0)
    stand = Stand(com, parameters, margin=0.0)
    lipm = stand.lipm
    terms = [
        (parameters.alpha, np.eye(16), np.zeros((16, 2))),
        (parameters.beta, lipm.Pvu, lipm.Pvs @ com.matrix),
        (parameters.gamma, lipm.Pzu, lipm.Pzs @ com.matrix),
    ]
    rows = np.vstack([np.sqrt(w) * A for w, A, _ in terms])
    offset = np.vstack([np.sqrt(w) * b for w, _, b in terms])
    expected, *_ = np.linalg.lstsq(rows, -offset, rcond=None)
    assert np.allclose(stand.jerks(), expected, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize("solver", SOLVERS)
def test_an_infeasible_qp_raises(solver):
    problem = QP(np.eye(1), np.zeros(1), np.array([[1.0], [1.0]]), np.array([1.0, -np.inf]), np.array([np.inf, -1.0]))
    with pytest.raises(NoSolutionFoundError, match="1 variables"):
        solve_qp(problem, solver)


def test_both_solvers_decide_the_same():
    def walk(solver):
        simulation = Simulation(load_robot("hrp2"), Parameters(control_period=0.1, solver=solver))
        return [simulation.step(command) for command in WALK]

    for one, other in zip(walk("piqp"), walk("daqp"), strict=True):
        assert one.status == other.status == Status.SOLVED
        for foothold, same in zip(one.plan.footholds, other.plan.footholds, strict=True):
            assert np.allclose(foothold.position, same.position, atol=1e-3)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_direction_in_which_the_cost_is_flat_ends_at_its_bound(solver):
    problem = QP(np.diag([1.0, 0.0]), np.array([1.0, -1.0]), np.eye(2), np.full(2, -2.0), np.array([2.0, 3.0]))
    assert np.allclose(solve_qp(problem, solver).u, [-1.0, 3.0], atol=1e-6)


def test_a_soft_margin_that_can_be_kept_is_kept():
    stand = Stand(CoMState([[0.0, 0.0], [0.05, 0.1], [0.0, 0.0]]))
    assert np.allclose(stand.split(stand.relaxed()), stand.jerks(), atol=1e-2)


def test_a_margin_that_cannot_be_kept_is_given_up_but_never_the_sole():
    sole = half_planes(load_robot("hrp2").sole).inset(0.03)
    conflicting = replace(sole, lower=sole.lower + 0.1)  # the first sample is asked to be where no margin is left
    stand = Stand(CoMState.at_rest(np.zeros(2)), first_polygon=conflicting)
    with pytest.raises(NoSolutionFoundError):
        stand.jerks()
    slack = stand.relaxed()[-17:-1]
    assert np.all(slack > -1e-8)
    assert np.all(slack < 0.03 + 1e-8)
    assert slack[0] > 0.0


@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_scheme_walks(scheme):
    horizon = max(16, SCHEMES[scheme].least_horizon(8))
    parameters = Parameters(scheme=scheme, control_period=0.05, horizon_samples=horizon)
    simulation = Simulation(load_robot("hrp2"), parameters)
    start = [simulation.step(Command(Reference(vx=0.2))) for _ in range(80)][-1]
    end = [simulation.step(Command(Reference(vx=0.2))) for _ in range(96)][-1]
    assert end.status == Status.SOLVED
    assert (end.com.position[0] - start.com.position[0]) / 4.8 == pytest.approx(0.2, rel=0.05)


def test_a_push_that_needs_another_step_topples_planned_footsteps_only():
    for scheme, falls in (("full", False), ("adapted_steps", False), ("preview_control", True), ("fixed_steps", True)):
        parameters = Parameters(scheme=scheme, control_period=0.05, stepping_in_place=True)
        simulation = Simulation(load_robot("hrp2"), parameters)
        walk = [simulation.step(Command(push=Push([16.0, 0.0]) if tick == 52 else None)) for tick in range(150)]
        assert (walk[-1].status == Status.FALLEN) == falls
        assert bool(walk[-1].reason) == falls


@pytest.mark.parametrize("robot", ["talos", "g1"])
@pytest.mark.parametrize(
    "scheme",
    [
        name if name == "fixed_steps" else pytest.param(name, marks=pytest.mark.exhaustive)
        for name, scheme in SCHEMES.items()
        if scheme.nb_steps_to_last > 1
    ],
)
def test_a_walk_with_planned_steps_lasts_with_the_horizon_that_it_needs(scheme, robot):
    horizon = SCHEMES[scheme].lasting_horizon(8)
    parameters = Parameters(scheme, control_period=0.02, stepping_in_place=True, solver="daqp", horizon_samples=horizon)
    simulation = Simulation(replace(load_robot(robot), body=None), parameters)
    walk = [simulation.step(Command()) for _ in range(1600)]
    assert all(snapshot.status is not Status.FALLEN for snapshot in walk)
    aside, a_cycle_ago = walk[-1].com.position[1], walk[-81].com.position[1]
    assert aside == pytest.approx(a_cycle_ago, abs=1e-5), "it drifts aside"
