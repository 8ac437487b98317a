"""The QP that is assembled is the one that the paper prints: (23)-(25), (28)-(30) and (31), in its own letters."""

import numpy as np
import pytest

from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.mpc.gait import Gait
from walkcore.mpc.lipm import CoMState, Pendulum, preview_matrices
from walkcore.mpc.pattern_generator import PatternGenerator
from walkcore.mpc.preview import FOOTHOLD_SCALE
from walkcore.mpc.stance import Footstep, Side
from walkcore.mpc.supports import SupportGeometry, WalkingProblem

ROBOT = load_robot("hrp2")
PENDULUM = Pendulum(ROBOT.com_height)
N, T = 16, 0.1
# Ticks of the paper's period: on both feet, in the first step, and in the one after it; and the steps until a stand.
MOMENTS = [
    (tick, nb_steps) for tick in (0, 7, 8, 9, 13, 15, 16, 20) for nb_steps in (None, 1, 2) if tick < 16 or nb_steps != 1
]


def problem_at(parameters, tick, nb_steps=None):
    """A robot somewhere in a walk, with a random state and a reference that turns."""
    rng = np.random.default_rng(tick)
    gait = Gait(parameters.timing, Side.LEFT, start=8, nb_steps=nb_steps)
    side = gait.support_side(tick)
    return WalkingProblem(
        com=CoMState(rng.normal(scale=0.02, size=(3, 2))),
        support=Footstep(side, np.array([0.1, 0.1 * side.sign]), 0.2),
        swing=Footstep(side.other, np.array([-0.1, -0.12 * side.sign]), 0.1),
        horizon=gait.horizon(tick),
        reference=Reference(vx=0.2, vy=0.05, yaw_rate=0.1),
        heading=0.15,
    )


class Paper:
    """The quantities of one tick, by the paper's letters."""

    def __init__(self, parameters, problem):
        intervals = np.full(parameters.horizon_samples, T)
        lipm = preview_matrices(intervals, PENDULUM)
        self.Pps, self.Ppu, self.Pvs, self.Pvu, self.Pzs, self.Pzu = (
            getattr(lipm, name) for name in ("Pps", "Ppu", "Pvs", "Pvu", "Pzs", "Pzu")
        )
        stances = problem.horizon.stances
        self.U, self.Uc = stances.U, stances.Uc
        self.x = problem.com.matrix  # both axes side by side
        both = stances.is_double_support[:, None]
        geometry = SupportGeometry(ROBOT, parameters)
        self.supports = geometry.supports(problem)
        self.reach = geometry.reach(problem.horizon.time_to_touchdown)
        self.known_centres = self.Uc * problem.support.position + both * self.supports.to_middle
        yaw = problem.heading + problem.reference.yaw_rate * lipm.times
        vx, vy = problem.reference.vx, problem.reference.vy
        self.dC_ref = np.column_stack([np.cos(yaw) * vx - np.sin(yaw) * vy, np.sin(yaw) * vx + np.cos(yaw) * vy])


def in_metres(qp, nb_samples):
    """P, q and G of a QP, with the footholds in metres."""
    n = len(qp.q) // 2
    axis = np.concatenate([np.ones(nb_samples), np.full(n - nb_samples, 1.0 / FOOTHOLD_SCALE)])
    scale = np.tile(axis, 2)
    return qp.P * np.outer(scale, scale), qp.q * scale, qp.G * scale


@pytest.mark.parametrize(("tick", "nb_steps"), MOMENTS)
def test_objective_is_24_and_25(tick, nb_steps):
    parameters = Parameters(control_period=T, alpha=1e-3, beta=0.7, gamma=0.2)
    problem = problem_at(parameters, tick, nb_steps)
    p = Paper(parameters, problem)
    alpha, beta, gamma = parameters.alpha, parameters.beta, parameters.gamma
    Q, q, _ = in_metres(PatternGenerator(ROBOT, parameters).qp(problem), N)

    Q_axis = np.block(  # (24)
        [
            [alpha * np.eye(N) + beta * p.Pvu.T @ p.Pvu + gamma * p.Pzu.T @ p.Pzu, -gamma * p.Pzu.T @ p.U],
            [-gamma * p.U.T @ p.Pzu, gamma * p.U.T @ p.U],
        ]
    )
    velocity, cop = p.Pvs @ p.x - p.dC_ref, p.Pzs @ p.x - p.known_centres
    p_axis = np.vstack([beta * p.Pvu.T @ velocity + gamma * p.Pzu.T @ cop, -gamma * p.U.T @ cop])  # (25)

    zero = np.zeros_like(Q_axis)
    np.testing.assert_allclose(Q, np.block([[Q_axis, zero], [zero, Q_axis]]), atol=1e-12)  # (23)
    np.testing.assert_allclose(q, p_axis.T.ravel(), atol=1e-12)


def test_mean_velocity_is_31():
    parameters = Parameters(control_period=T, scheme="mean_velocity", horizon_samples=32, alpha=1e-3, gamma=0.0)
    problem = problem_at(parameters, 8)
    p = Paper(parameters, problem)
    Q, q, _ = in_metres(PatternGenerator(ROBOT, parameters).qp(problem), 32)
    E = np.hstack([-np.eye(16), np.eye(16)])  # [-I 0 I] for two steps of eight samples in a horizon of four
    D, e = E @ p.Ppu / 1.6, E @ p.Pps @ p.x / 1.6 - p.dC_ref[16:]
    n = len(q) // 2
    np.testing.assert_allclose(Q[:32, :32], parameters.alpha * np.eye(32) + parameters.delta * D.T @ D, atol=1e-12)
    np.testing.assert_allclose(np.vstack([q[:32], q[n : n + 32]]).T, parameters.delta * D.T @ e, atol=1e-12)


@pytest.mark.parametrize(("tick", "nb_steps"), MOMENTS)
def test_constraints_are_28_and_the_regions_and_30(tick, nb_steps):
    parameters = Parameters(control_period=T)
    problem = problem_at(parameters, tick, nb_steps)
    p, qp = Paper(parameters, problem), PatternGenerator(ROBOT, parameters).qp(problem)
    _, _, G = in_metres(qp, N)
    m = p.U.shape[1]
    zero, footholds = np.zeros((N, N)), np.zeros((N, m))
    expected: list[tuple[np.ndarray, float, float]] = []

    known = p.known_centres - p.Pzs @ p.x
    both = np.block([[p.Pzu, -p.U, zero, footholds], [zero, footholds, p.Pzu, -p.U]])  # of (28)
    for i, stance in enumerate(problem.horizon.stances.stance_of_sample):
        planes = p.supports.cop_polygons[stance]
        for d, low, high in zip(planes.normals, planes.lower, planes.upper, strict=True):
            row = d[0] * both[i] + d[1] * both[N + i]  # a row of D_{k+1} (29)
            expected.append((row, low + d @ known[i], high + d @ known[i]))

    select = np.zeros((m, 2, 2 * (N + m)))  # the k-th foothold out of u
    for k in range(m):
        select[k, 0, N + k] = select[k, 1, N + m + N + k] = 1.0
    for k, planes in enumerate(p.supports.foothold_regions):
        before = select[k - 1] if k else np.zeros_like(select[0])
        start = np.zeros(2) if k else problem.support.position
        for d, low, high in zip(planes.normals, planes.lower, planes.upper, strict=True):
            expected.append((d @ (select[k] - before), low + d @ start, high + d @ start))
    if m:
        for d, reach in zip(p.supports.flight.normals, p.reach, strict=True):  # (30)
            start = d @ problem.swing.position
            expected.append((d @ select[0], start - reach, start + reach))

    rows, lower, upper = zip(*expected, strict=True)
    np.testing.assert_allclose(G, np.array(rows), atol=1e-12)
    np.testing.assert_allclose(qp.lower, lower, atol=1e-12)
    np.testing.assert_allclose(qp.upper, upper, atol=1e-12)


def test_active_bounds_are_the_edges_that_the_plan_touches():
    simulation = Simulation(ROBOT, Parameters(stepping_in_place=True))
    seen = set()
    for tick in range(900):
        push = Push([0.0, 7.0]) if tick == 500 else None
        plan = simulation.step(Command(Reference(vx=0.3), push)).plan
        margin, nb_samples = simulation.parameters.cop_margin, len(plan.times)
        for point, outward in plan.bounds.active():
            if point < nb_samples:
                stance = plan.stances[plan.stance_of_sample[point]]
                depth = np.max(stance.polygon @ outward) - margin - plan.cop[point] @ outward
            elif point < nb_samples + len(plan.footholds):
                depth = np.max(plan.foothold_regions[point - nb_samples] @ outward) - (
                    plan.footholds[point - nb_samples].position @ outward
                )
            else:
                continue
            assert abs(depth) < 1e-3
            seen.add(point < nb_samples)
    assert seen == {True, False}
