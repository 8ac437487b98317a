import math
from dataclasses import replace

import numpy as np
import pytest

from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot, record
from walkcore.analysis.push_recovery import BalanceState, PushRecoveryMonitor, balance_state, push_recoveries
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Footstep, Side
from walkcore.scenario.scenario import scenario_from_mapping

STEP = 0.8  # [s]
NOTHING = np.zeros(2)


def steps(offsets, push_at=math.nan, statuses=(), of=("com", "dcm")):
    """A walk sideways in steps, three moments each; these points are so far off their places [m] at the touchdowns."""
    for k, offset in enumerate(offsets):
        side = Side(k % 2)
        foot = Footstep(side, np.array([0.2 * k, side.sign * 0.1]), 0.0)
        landing = BalanceState(
            t=k * STEP,
            push=NOTHING,
            com=foot.position + [0.0, offset * ("com" in of)],
            dcm=foot.position + [0.1, -side.sign * 0.1 + offset * ("dcm" in of)],
            cop=foot.position,
            support=foot,
            phase=Phase.DOUBLE_SUPPORT,
            status=Status(statuses[k]) if k < len(statuses) else Status.SOLVED,
        )
        swinging = replace(landing, phase=Phase.SINGLE_SUPPORT)
        for moment in (landing, replace(swinging, t=landing.t + 0.3), replace(swinging, t=landing.t + 0.6)):
            is_pushed = math.isclose(moment.t, push_at)
            yield replace(moment, push=np.array([0.0, 5.0])) if is_pushed else moment


def followed(moments):
    monitor = PushRecoveryMonitor()
    for moment in moments:
        monitor.update(moment)
    return monitor.last


@pytest.mark.parametrize("of", [("com",), ("dcm",)])
def test_a_walk_has_recovered_once_com_and_dcm_are_at_a_touchdown_where_they_were_before(of):
    last = followed(steps([0, 0, 0, 0, 0.10, 0.06, 0.03, 0.01, 0.0], push_at=3 * STEP + 0.3, of=of))
    assert (last.survived, last.steps, last.impulse) == (True, 4, (0.0, 5.0))
    assert last.time == pytest.approx(7 * STEP - 3 * STEP - 0.3)


def test_a_walk_to_elsewhere_has_recovered_once_it_repeats_itself():
    last = followed(steps([0, 0, 0, 0, 0.10, 0.06, 0.05, 0.05, 0.05], push_at=3 * STEP + 0.3))
    assert (last.survived, last.steps) == (True, 4)


def test_a_touchdown_at_the_tick_of_the_push_is_before_it():
    last = followed(steps([0, 0, 0, 0, 0], push_at=3 * STEP))
    assert (last.survived, last.steps, last.time) == (True, 1, pytest.approx(STEP))


def test_a_step_on_which_margin_was_given_up_is_no_recovery():
    last = followed(steps([0] * 7, push_at=2 * STEP + 0.3, statuses=[0, 0, 0, 1, 0, 0]))
    assert (last.survived, last.steps) == (True, 3)


def test_a_robot_that_falls_has_not_survived():
    last = followed(steps([0, 0, 0, 0.1, 0.2, 0.3], push_at=2 * STEP + 0.3, statuses=[0, 0, 0, 0, 1, 2]))
    assert (last.survived, last.time) == (False, None)


def standing(t, com, dcm, cop, push=0.0, status=Status.SOLVED):
    along = [np.array([x, 0.0]) for x in (push, com, dcm, cop)]
    return BalanceState(t, *along, Footstep(Side.LEFT, NOTHING, 0.0), Phase.STANDING, status)


def test_a_robot_that_stands_has_recovered_once_it_rests_wherever_that_is():
    story = [
        standing(0.0, 0.0, 0.0, 0.0, push=5.0),
        standing(0.1, 0.0, 0.10, 0.10),  # it moves on
        standing(0.2, 0.10, 0.10, 0.14),  # it turns back
        standing(0.3, 0.06, 0.06, 0.06, status=Status.RELAXED),
        standing(0.4, 0.06, 0.06, 0.06),
        standing(0.5, 0.06, 0.06, 0.06),
    ]
    assert [followed(story[: k + 1]).survived for k in range(5)] == [None] * 5
    last = followed(story)
    assert (last.survived, last.steps, last.time) == (True, 0, 0.5)


def test_a_long_push_is_judged_when_it_is_over():
    rest = [standing(0.1 * k, 0.0, 0.0, 0.0, push=1.0 if k < 3 else 0.0) for k in range(5)]
    assert followed(rest[:3]).survived is None
    assert followed(rest).impulse == (3.0, 0.0) and followed(rest).time == pytest.approx(0.3)


def test_a_touchdown_during_a_long_push_is_no_recovery():
    moments = [
        replace(moment, push=np.array([1.0, 0.0])) if 0.5 < moment.t / STEP - 2 < 1.5 else moment
        for moment in steps([0] * 6)
    ]
    last = followed(moments)
    assert (last.survived, last.steps) == (True, 2)


def test_the_dcm_of_a_moment_is_that_before_its_push():
    simulation = Simulation(load_robot("hrp2"))
    for _ in range(10):
        simulation.step(Command(Reference(vx=0.2)))
    found = [balance_state(simulation.preview(Command(push=push)), 56.0) for push in (None, Push([0.0, 8.0]))]
    assert found[1].push.tolist() == [0.0, 8.0]
    assert found[1].dcm == pytest.approx(found[0].dcm, abs=1e-12)


def test_another_push_leaves_the_first_one_open():
    moments = list(steps([0, 0, 0.1, 0.1, 0, 0], push_at=STEP + 0.3))
    moments[7] = replace(moments[7], push=np.array([1.0, 0.0]))
    monitor, seen = PushRecoveryMonitor(), {}
    for moment in moments:
        monitor.update(moment)
        if monitor.last is not None:
            seen[monitor.last.t] = monitor.last
    first, second = seen.values()
    assert first.survived is None and second.survived is True


def test_the_steps_that_were_shortened_are_named():
    durations = [0.8, 0.8, 0.6, 0.4, 0.8, 0.8, 0.8]
    moments = [
        replace(
            moment, step_duration=durations[k // 3] if k > 6 else 0.8, next_step_duration=0.4 if 6 < k < 12 else 0.8
        )
        for k, moment in enumerate(steps([0, 0, 0, 0.1, 0.1, 0, 0], push_at=2 * STEP + 0.3))
    ]
    last = followed(moments)
    assert (last.survived, last.shortened) == (True, (0.6, 0.4))
    again = [replace(moment, push=np.array([0.0, 5.0]) if k == 10 else moment.push) for k, moment in enumerate(moments)]
    assert followed(again).shortened == (0.4,)  # of the usual time before the first push, and since the second one


def test_the_shortened_steps_of_a_recorded_push_are_those_of_the_live_one():
    events = [{"t": 1.0, "push": {"impulse": [20.0, 0.0]}}]
    parameters = {"step_timing": "adaptive", "control_period": 0.02}
    story = {"name": "push", "robot": "hrp2", "duration": 7.0, "parameters": parameters, "events": events}
    monitor, simulation = PushRecoveryMonitor(), Simulation(load_robot("hrp2"), Parameters.from_mapping(parameters))
    for k in range(350):
        push = Push([20.0, 0.0]) if k == 50 else None
        monitor.update(balance_state(simulation.step(Command(push=push)), 56.0))
    assert monitor.last.survived and monitor.last.shortened
    recorded = push_recoveries(record(scenario_from_mapping(story)))
    assert [push.shortened for push in recorded] == [monitor.last.shortened]


@pytest.mark.parametrize(("strength", "survived"), [(8.0, True), (58.0, False)])
def test_in_physics_the_body_is_judged_and_not_the_model_which_hears_of_a_push_later(strength, survived):
    events = [{"t": 0.5, "push": {"impulse": [0.0, -strength], "duration": 0.0}}]
    story = {"robot": "talos", "duration": 3.0, "parameters": {"plant": "mujoco"}, "events": events}
    simulation, monitor = Simulation(load_robot("talos"), Parameters(plant="mujoco")), PushRecoveryMonitor()
    for tick in range(600):
        push = Push([0.0, -strength]) if tick == 100 else None
        monitor.update(balance_state(simulation.step(Command(push=push)), simulation.robot.mass))
        if tick == 102:
            assert monitor.last.survived is None
    (recorded,) = push_recoveries(record(scenario_from_mapping(story)))
    assert monitor.last.survived is survived is (recorded.time is not None)
