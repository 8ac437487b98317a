"""The methods that decide without a QP: their laws, on the model that all schemes walk with."""

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import survives_to_the_end

from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.analysis.survival import NominalWalk
from walkcore.errors import InvalidValueError
from walkcore.methods import METHODS
from walkcore.methods.dcm_tracker import dcm_reference
from walkcore.methods.morisawa import AnalyticPlan
from walkcore.methods.planning import jerk_to_cop
from walkcore.methods.situation import Situation
from walkcore.mpc.lipm import CoMState, Pendulum
from walkcore.mpc.plan import Status
from walkcore.mpc.regions import half_planes
from walkcore.mpc.schemes import SCHEMES, Footholds
from walkcore.mpc.stance import Footstep, Side

HRP2 = load_robot("hrp2")
PERIOD = 0.05  # [s]
FAST = Parameters(control_period=PERIOD, stepping_in_place=True)
STEP = 16  # ticks
STEADY = 64  # ticks from rest to a steady walk
IN_PLACE = Reference()
OMEGA = 3.5  # [1/s]


def test_a_scheme_that_minimises_nothing_is_refused():
    with pytest.raises(InvalidValueError, match="scheme") as refused:
        Parameters(scheme="speed_only", beta=0.0)
    assert refused.value.value == "speed_only"


def walk(scheme, push=None, at=STEADY, nb_ticks=8 * STEP, reference=IN_PLACE, robot=HRP2, **parameters):
    """Snapshots of a walk that is pushed at a tick."""
    simulation = Simulation(robot, replace(FAST, scheme=scheme, **parameters))
    commands = (Command(reference, push if tick == at else None) for tick in range(at + nb_ticks))
    return [simulation.step(command) for command in commands]


def walking(error=(0.0, 0.0), lift_off=0.0, time_in_air=0.5):
    """A situation in the middle of a walk ahead on the left foot, with some DCM beside the reference of the tracker."""
    feet = [
        Footstep(side, np.array([0.2 * k, 0.1 * side.sign]), 0.0) for k, side in enumerate((Side.LEFT, Side.RIGHT) * 3)
    ]
    now = Situation(
        com=CoMState.at_rest(np.zeros(2)),
        pendulum=Pendulum(9.81 / OMEGA**2),
        support=feet[0],
        swing=Footstep(Side.RIGHT, np.array([-0.2, -0.1]), 0.0),
        footholds=tuple(feet[1:5]),
        reachable=feet[1].position + np.array([[0.2, 0.1], [-0.2, 0.1], [-0.2, -0.1], [0.2, -0.1]]),
        is_stopping=False,
        lift_off=lift_off,
        time_in_air=time_in_air,
        stand_duration=0.7,
        double_support=0.1,
        single_support=0.7,
        stance_width=0.2,
        sole=HRP2.sole,
        inner_sole=0.6 * HRP2.sole,
    )
    dcm = dcm_reference(now).dcm(0.0) + error
    acceleration = OMEGA**2 * (dcm - feet[0].position)  # the CoP is in the middle of the foot
    return replace(now, com=CoMState(np.array([dcm, np.zeros(2), acceleration])))


def test_every_method_is_a_scheme():
    assert set(METHODS) == {name for name, scheme in SCHEMES.items() if scheme.footholds is Footholds.REGULATED}


@pytest.mark.parametrize("scheme", METHODS)
@pytest.mark.parametrize(
    "reference", [Reference(), Reference(vx=0.3), Reference(vx=-0.15), Reference(vx=0.1, yaw_rate=0.2)]
)
def test_a_nominal_walk_keeps_its_margin_and_follows_the_reference(scheme, reference):
    seen = walk(scheme, reference=reference)
    assert {now.status for now in seen[STEADY:]} == {Status.SOLVED}
    begin, end = seen[STEADY], seen[STEADY + 6 * STEP]
    assert end.heading - begin.heading == pytest.approx(6 * STEP * PERIOD * reference.yaw_rate, abs=0.02)
    speed = np.linalg.norm(end.com.position - begin.com.position) / (6 * STEP * PERIOD)
    if not reference.yaw_rate:
        assert speed == pytest.approx(math.hypot(reference.vx, reference.vy), abs=0.01)


@pytest.mark.parametrize("scheme", METHODS)
@pytest.mark.parametrize("seed", range(2))
def test_under_any_push_the_cop_stays_in_the_soles_and_nothing_is_nan(scheme, seed):
    random = np.random.default_rng(seed)
    push = Push(random.uniform(-30.0, 30.0, 2), duration=float(random.choice([0.0, 0.2])))
    for now in walk(scheme, push, at=STEADY + int(random.integers(STEP)), nb_ticks=3 * STEP):
        assert np.isfinite(now.com.matrix).all() and np.isfinite(now.left_foot.matrix).all()
        if now.status is Status.FALLEN:
            return
        assert half_planes(now.stance.corners).excess(now.cop) < 1e-6
        assert np.isfinite(now.plan.cop).all() and np.isfinite(now.plan.dcm).all()
        for foothold, region in zip(now.plan.footholds[:1], now.plan.foothold_regions, strict=False):
            assert half_planes(region).excess(foothold.position) < 1e-6


@pytest.mark.parametrize("scheme", METHODS)
def test_a_push_that_topples_planned_footsteps_is_survived(scheme):
    pushed = walk(scheme, Push([16.0, 0.0]), at=STEADY + STEP // 2)
    assert pushed[-1].status is Status.SOLVED
    assert np.linalg.norm(pushed[-1].com.velocity) < 0.5
    assert walk("fixed_steps", Push([16.0, 0.0]), at=STEADY + STEP // 2)[-1].status is Status.FALLEN


@pytest.mark.parametrize("scheme", METHODS)
def test_a_robot_that_stands_holds_a_push_by_its_cop(scheme):
    seen = walk(scheme, Push([6.0, 0.0]), at=4, nb_ticks=8 * STEP, stepping_in_place=False)
    assert {now.status for now in seen[-STEP:]} == {Status.SOLVED} and seen[-1].left_foot.position[0] == 0.0
    assert np.linalg.norm(seen[-1].com.velocity) < 0.02


@pytest.mark.parametrize("scheme", METHODS)
def test_a_stop_ends_in_a_stand_between_the_feet(scheme):
    simulation = Simulation(HRP2, replace(FAST, scheme=scheme, stepping_in_place=False))
    for _ in range(STEADY):
        simulation.step(Command(Reference(vx=0.2)))
    seen = [simulation.step(Command()) for _ in range(6 * STEP)][-1]
    assert np.allclose(seen.com.position, seen.stance.centre, atol=0.01) and len(seen.stance.feet) == 2


@pytest.mark.parametrize("scheme", METHODS)
def test_one_tick_from_a_state_is_the_same_in_another_simulation(scheme):
    simulation, other = (Simulation(HRP2, replace(FAST, scheme=scheme)) for _ in range(2))
    for tick in range(STEADY):
        simulation.step(Command(Reference(vx=0.2), Push([0.0, 8.0]) if tick == STEADY - 5 else None))
    other.restore(simulation.state)
    for _ in range(STEP):
        one, same = (robot.step(Command(Reference(vx=0.2))) for robot in (simulation, other))
        assert one.com.matrix.tobytes() == same.com.matrix.tobytes()


def test_a_push_that_the_forecast_gives_up_is_followed_to_the_end():
    robot = replace(load_robot("talos"), body=None)
    nominal = NominalWalk(robot, replace(FAST, scheme="dcm_tracker", control_period=0.02), Reference())
    push = Push(28.034 * np.array([math.cos(1.10312), math.sin(1.10312)]))
    assert nominal.survives(0.8632, push) and survives_to_the_end(nominal, 0.8632, push)


def test_the_jerk_of_a_tick_brings_the_cop_where_it_is_wanted():
    pendulum, com = Pendulum(0.8), CoMState(np.array([[0.1, 0.0], [0.2, -0.3], [0.5, 0.1]]))
    for tick in (0.005, 0.1):
        jerk = jerk_to_cop(com, np.array([0.03, -0.05]), tick, pendulum)
        assert np.allclose(pendulum.cop(com.integrated(jerk, tick)), [0.03, -0.05], atol=1e-12)


@pytest.mark.parametrize(("lift_off", "time_in_air"), [(0.0, 0.5), (0.04, 0.7), (0.6, 0.7)])
def test_the_dcm_reference_obeys_the_pendulum_and_ends_on_the_last_foothold(lift_off, time_in_air):
    now = walking(lift_off=lift_off, time_in_air=time_in_air)
    reference, end = dcm_reference(now), sum(interval.duration for interval in now.intervals)
    assert np.allclose(reference.dcm(end - 1e-12), now.footholds[-1].position, atol=1e-9)
    h = 1e-4
    for t in np.linspace(2 * h, end - 2 * h, 301):
        rate = (reference.dcm(t + h) - reference.dcm(t - h)) / (2 * h)
        error = rate - OMEGA * (reference.dcm(t) - reference.cop(t))
        assert np.abs(error).max() < 1e-2  # where two intervals meet, the CoP has a kink


def test_a_dcm_error_that_the_cop_can_mend_shrinks_and_moves_no_foothold():
    now = walking(error=[0.01, 0.005])
    decision = METHODS["dcm_tracker"].decide(now, 0.005, np.linspace(0.1, 1.6, 16))
    moved = decision.steps.footholds[0].position - now.footholds[0].position
    assert np.linalg.norm(moved) < 0.005
    assert np.all((decision.cop - dcm_reference(now).cop(0.005)) / [0.01, 0.005] > 1.5)


def test_what_the_cop_cannot_mend_by_the_touchdown_the_foothold_takes():
    now, omega = walking(error=[0.115, 0.0]), OMEGA
    decision = METHODS["dcm_tracker"].decide(now, 0.005, np.linspace(0.1, 1.6, 16))
    toe = now.sole[:, 0].max()
    assert decision.cop[0] == pytest.approx(toe)
    growth = math.exp(omega * now.touchdown)
    at_touchdown = toe + growth * (now.dcm[0] - toe)  # as the CoP stays at the toe
    reached = dcm_reference(decision.steps).dcm(now.touchdown + 1e-9)[0]
    assert reached == pytest.approx(at_touchdown, abs=2e-3)


@pytest.mark.parametrize(("lift_off", "time_in_air"), [(0.0, 0.5), (0.04, 0.7), (0.6, 0.7)])
def test_the_analytic_plan_goes_on_from_the_cop_and_the_dcm_of_the_present(lift_off, time_in_air):
    now = walking(error=[0.02, -0.01], lift_off=lift_off, time_in_air=time_in_air)
    plan, h = AnalyticPlan(now), 1e-4
    assert np.allclose(plan.dcm(0.0), now.dcm, atol=1e-12)
    assert np.allclose(plan.cop(0.0), now.pendulum.cop(now.com), atol=1e-12)
    for t in np.linspace(2 * h, 3.0, 200):
        rate = (plan.dcm(t + h) - plan.dcm(t - h)) / (2 * h)
        assert np.abs(rate - OMEGA * (plan.dcm(t) - plan.cop(t))).max() < 1e-2


def test_an_analytic_plan_that_is_solved_again_later_is_the_same_plan():
    now, passed = walking(error=[0.02, -0.01]), 0.2
    plan = AnalyticPlan(now)
    cop, dcm = plan.cop(passed), plan.dcm(passed)
    com = np.array([cop, OMEGA * (dcm - cop), np.zeros(2)])  # a state with that CoP and that DCM
    later = AnalyticPlan(replace(now, com=CoMState(com), time_in_air=now.time_in_air - passed))
    for t in np.linspace(0.0, 1.0, 11):
        assert np.allclose(later.cop(t), plan.cop(t + passed), atol=1e-9)


def test_the_foot_place_is_modified_where_the_zmp_would_leave_the_sole():
    now = walking(error=[0.07, 0.0])
    modified = METHODS["morisawa"].decide(now, 0.005, np.linspace(0.1, 1.6, 16)).steps
    before, after = (
        max(AnalyticPlan(steps).cop(t)[0] for t in np.linspace(0.0, 0.49, 50)) for steps in (now, modified)
    )
    toe = now.sole[:, 0].max()
    assert before > toe + 0.01 and after == pytest.approx(toe, abs=0.005)
    assert modified.footholds[0].position[0] > now.footholds[0].position[0] + 0.02
    calm = walking(error=[0.02, 0.0])
    assert METHODS["morisawa"].decide(calm, 0.005, np.linspace(0.1, 1.6, 16)).steps.footholds == calm.footholds


def test_the_regulator_moves_a_foot_only_where_its_cop_saturates():
    times = np.linspace(0.1, 1.6, 16)
    calm, pushed = walking(error=[0.01, 0.0]), walking(error=[0.13, 0.0])
    decided = METHODS["sugihara"].decide(calm, 0.005, times)
    assert np.allclose(decided.steps.footholds[0].position, calm.footholds[0].position, atol=1e-9)
    decided = METHODS["sugihara"].decide(pushed, 0.005, times)
    assert decided.steps.footholds[0].position[0] > pushed.footholds[0].position[0] + 0.02
