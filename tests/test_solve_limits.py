"""Limits of iterations and of time: every tick ends, and one that is not solved in time goes on with the last plan."""

from dataclasses import replace
from typing import Any

import daqp
import numpy as np
import pytest

from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.errors import InvalidValueError, NoSolutionFoundError, OutOfTimeError
from walkcore.mpc.plan import Status
from walkcore.mpc.qp import MAX_ACTIVE_SET_ITERATIONS, QP, SOLVERS, STALLED_GAP, InteriorPointSolver
from walkcore.scenario.recording import collect
from walkcore.scenario.scenario import scenario_from_mapping
from walkcore.simulation import NOT_IN_TIME
from walkcore.stages import unlimited
from walkcore.state import state_from_mapping

HRP2 = load_robot("hrp2")
WALK = Command(Reference(vx=0.2, yaw_rate=0.1))


def no_time() -> float:
    return 0.0


@pytest.mark.parametrize("scheme", ["adapted_steps", "mean_velocity"])
def test_the_active_set_method_ends_after_its_iterations(monkeypatch, scheme):
    iterations, solve = [], daqp.solve

    def counted(*matrices, **settings):
        solution = solve(*matrices, **settings)
        iterations.append(solution[3]["iterations"])
        return solution

    monkeypatch.setattr(daqp, "solve", counted)
    simulation = Simulation(HRP2, Parameters(solver="daqp", scheme=scheme, horizon_samples=35, alpha=0.0))
    snapshots = [simulation.step(WALK) for _ in range(3)]
    assert 0 < max(iterations) <= MAX_ACTIVE_SET_ITERATIONS + 50  # it looks at the limit between its outer iterations
    assert all(snapshot.status is not Status.FALLEN for snapshot in snapshots)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_solver_does_not_begin_without_time(solver):
    problem = Simulation(HRP2).qp(Reference())
    with pytest.raises(OutOfTimeError):
        SOLVERS[solver]().solve(problem, time_left=no_time)


@pytest.mark.parametrize("scheme", ["full", "mean_velocity", "adapted_steps", "fixed_steps"])
def test_a_tick_without_time_goes_on_with_the_last_plan_and_says_so(scheme):
    parameters = Parameters(scheme=scheme, horizon_samples=32, control_period=0.02)
    simulation = Simulation(HRP2, parameters)
    before = simulation.step(WALK)
    for tick in range(1, 180):
        in_time = tick % 3 == 0
        snapshot = simulation.step(WALK if tick < 120 else Command(), unlimited if in_time else no_time)
        assert snapshot.plan is not None and np.isfinite(snapshot.plan.com).all()
        if not in_time:
            assert (snapshot.status, snapshot.reason) == (Status.RELAXED, NOT_IN_TIME)
            is_at_sample = tick % parameters.timing.ticks_per_sample == 0
            assert snapshot.jerk.tolist() == before.plan.jerks[int(is_at_sample)].tolist()
        before = snapshot
    assert simulation.step().status is Status.SOLVED


def test_the_first_tick_is_solved_however_long_that_takes():
    assert Simulation(HRP2).step(WALK, no_time).status is Status.SOLVED


def test_a_horizon_that_grows_or_shrinks_between_plan_and_tick_is_no_fault():
    simulation = Simulation(HRP2, Parameters(horizon_samples=16))
    for tick in range(200):
        if tick % 50 == 49:
            simulation.change(
                simulation.parameters.changed({"horizon_samples": 40 - simulation.parameters.horizon_samples})
            )
        snapshot = simulation.step(WALK, no_time if tick % 50 == 49 else lambda: 1.0)
        assert snapshot.status is not Status.FALLEN


def test_a_push_during_a_tick_without_time_is_answered_by_the_next_one():
    simulation = Simulation(HRP2)
    for _ in range(300):
        simulation.step(WALK)
    assert simulation.step(Command(WALK.reference, Push([0.0, 6.0])), no_time).reason == NOT_IN_TIME
    assert all(simulation.step(WALK).status is not Status.FALLEN for _ in range(250))


@pytest.mark.parametrize("value", [[], {}, [[]], None, 1, True])
def test_a_solver_of_any_type_is_refused(value):
    with pytest.raises(InvalidValueError) as refused:
        Parameters().changed({"solver": value})
    assert refused.value.field == "solver"


def test_a_tick_without_time_is_no_reason_of_a_fall_in_a_recording():
    simulation = Simulation(HRP2, Parameters(control_period=0.1))
    scenario = scenario_from_mapping({"robot": "hrp2", "duration": 0.5, "parameters": {"control_period": 0.1}})
    snapshots = [simulation.step(WALK), *(simulation.step(WALK, no_time) for _ in range(4))]
    assert snapshots[-1].reason == NOT_IN_TIME
    assert collect(scenario, snapshots, None).reason == ""


STALLED: dict[str, Any] = {  # 0.25 s after the second of two pushes, of 24 N s, while turning to the right
    "tick": 56898,
    "gait": {
        "first_support": "left",
        "start": 2836,
        "nb_steps": None,
        "step_duration": 0.8,
        "retiming": {"offset": 12, "first_step_ticks": 100, "samples_per_step": 4},
    },
    "flight": None,
    "com": {
        "position": [-1.9031452288377537, -2.9628095896565805],
        "velocity": [0.15887030964913434, 0.48562117897378565],
        "acceleration": [1.511798690461617, -0.35080712438674766],
    },
    "left_foot": {
        "pose": [-1.7637995643766922, -3.05103662935186, -1.7955533338803693],
        "velocity": [0.7949576607302118, 1.390712620416525, 0.27429026269860657],
        "acceleration": [0.0, 0.0, 0.0],
        "height": 0.01831892894375857,
    },
    "right_foot": {
        "pose": [-2.108829152442741, -3.0275035313265133, -1.731505985156172],
        "velocity": [0.0, 0.0, 0.0],
        "acceleration": [0.0, 0.0, 0.0],
        "height": 0.0,
    },
    "pushes": [],
    "why_fallen": "",
    "com_offset": {"position": [0.0, 0.0], "divergent": [0.0, 0.0]},
    "q": None,
    "q_before": None,
}


def test_a_relaxed_qp_at_which_rounding_stalls_the_solver_does_not_fell_the_robot():
    talos = replace(load_robot("talos"), body=None)
    parameters = talos.parameters.changed({"step_timing": "adaptive"})
    simulation = Simulation(talos, parameters)
    simulation.restore(state_from_mapping(STALLED, talos, parameters))
    command = Command(Reference(vx=0.3, vy=-0.2, yaw_rate=-0.064))
    assert simulation.step(command).status is Status.RELAXED
    assert all(simulation.step(command).status is not Status.FALLEN for _ in range(1600))


def test_a_qp_without_a_solution_has_none_however_the_solver_stalls():
    contradiction = QP(
        np.eye(1), np.zeros(1), np.array([[1.0], [1.0]]), np.array([1.0, -np.inf]), np.array([np.inf, 0.0])
    )
    with pytest.raises(NoSolutionFoundError):
        InteriorPointSolver(STALLED_GAP).solve(contradiction)
