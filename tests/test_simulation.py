import math
from itertools import pairwise

import numpy as np
import pytest
from oracle import excess

from walkcore import Command, Parameters, Push, Reference, Simulation, WalkError, load_robot
from walkcore.errors import InvalidValueError
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Footstep, Side, sole_vertices
from walkcore.scenario.recording import row
from walkcore.state import state_from_mapping

HRP2 = load_robot("hrp2")


STEPPING = Parameters(stepping_in_place=True)


def walk(simulation, seconds, reference, push=None):
    """The snapshots of a walk; the push comes first."""
    nb_ticks = round(seconds / simulation.parameters.control_period)
    return [simulation.step(Command(reference, push if tick == 0 else None)) for tick in range(nb_ticks)]


@pytest.mark.parametrize("robot", ["hrp2", "talos"])
def test_the_same_commands_give_the_same_bytes(robot):
    rng = np.random.default_rng(3)
    commands = [Command(Reference(vx=rng.uniform(0, 0.3)), Push([3.0, 1.0]) if i == 150 else None) for i in range(300)]

    def bytes_of(simulation):
        snapshots = [simulation.step(command) for command in commands]
        rows = np.array([list(row(s).values()) for s in snapshots])
        return rows.tobytes() + b"".join(s.q.tobytes() for s in snapshots if s.q is not None)

    simulation = Simulation(load_robot(robot))
    first = bytes_of(simulation)
    simulation.reset()
    assert bytes_of(simulation) == first
    assert bytes_of(Simulation(load_robot(robot))) == first


@pytest.mark.parametrize("control_period", [0.005, 0.02, 0.1])
def test_the_robot_walks_at_the_reference_velocity(control_period):
    simulation = Simulation(HRP2, Parameters(control_period=control_period))
    start = walk(simulation, 4.0, Reference(vx=0.3))[-1]
    end = walk(simulation, 4.8, Reference(vx=0.3))[-1]
    assert (end.com.position[0] - start.com.position[0]) / 4.8 == pytest.approx(0.3, rel=0.02)


def test_a_new_reference_changes_the_jerk_within_one_tick():
    asked, idle = Simulation(HRP2), Simulation(HRP2)
    walk(asked, 2.0 + 0.015, Reference())
    walk(idle, 2.0 + 0.015, Reference())
    assert asked.step(Command(Reference(vx=0.3))).jerk[0] > idle.step(Command(Reference())).jerk[0] + 1.0


def test_an_impulse_changes_the_velocity_by_impulse_over_mass():
    pushed, idle = Simulation(HRP2), Simulation(HRP2)
    walk(pushed, 2.0, Reference())
    walk(idle, 2.0, Reference())
    with_push, without = pushed.step(Command(push=Push([5.6, -2.8]))), idle.step(Command())
    assert np.allclose(with_push.com.velocity - without.com.velocity, [0.1, -0.05])
    assert np.array_equal(with_push.push, [5.6, -2.8])


def test_a_long_push_gives_its_impulse_over_its_duration():
    simulation = Simulation(HRP2)
    given = [s.push for s in walk(simulation, 0.5, Reference(), Push([2.0, 1.0], duration=0.1))]
    assert np.allclose(np.sum(given, axis=0), [2.0, 1.0])
    assert np.count_nonzero(np.any(given, axis=1)) == 20


def test_pushes_overlap():
    simulation = Simulation(HRP2)
    simulation.step(Command(push=Push([1.0, 0.0], duration=0.1)))
    given = [s.push for s in walk(simulation, 0.5, Reference(), Push([0.0, 2.0], duration=0.05))]
    assert np.allclose(np.sum(given, axis=0), [0.95, 2.0])


def test_a_push_that_no_step_can_catch_is_a_fall_that_is_reported_and_lasts():
    simulation = Simulation(HRP2, STEPPING)
    walk(simulation, 2.4, Reference())
    snapshots = walk(simulation, 4.0, Reference(), Push([0.0, 60.0]))
    fallen = [s for s in snapshots if s.status is Status.FALLEN]
    assert fallen
    assert all(s.reason for s in fallen)
    assert snapshots[-1].status is Status.FALLEN
    assert np.array_equal(snapshots[-1].com.position, fallen[1].com.position)
    gait = {(s.phase, s.support.side, round(s.time_to_touchdown, 9), s.step_duration) for s in fallen}
    assert len(gait) == 1  # it stops with the robot
    for s in snapshots:
        assert all(
            math.isfinite(v) for name, v in row(s).items() if not name.startswith(("foothold", "true_cop", "time_to"))
        )
    simulation.reset()
    assert walk(simulation, 2.0, Reference())[-1].status is Status.SOLVED
    assert simulation.step().tick == 400


def test_a_fallen_body_keeps_its_last_configuration():
    simulation = Simulation(load_robot("talos"), Parameters(control_period=0.02))
    snapshots = walk(simulation, 5.0, Reference(), Push([0.0, 60.0]))
    assert snapshots[-1].status is Status.FALLEN
    assert np.all(np.isfinite(snapshots[-1].q))
    assert np.array_equal(snapshots[-1].q, snapshots[-2].q)


def test_random_walks_never_fall_and_hardly_ever_need_the_margin():
    simulation = Simulation(HRP2, Parameters(control_period=0.05))
    rng = np.random.default_rng(0)
    limits = HRP2.max_reference
    seen = []
    for _ in range(60):
        reference = {name: rng.choice([low, 0.0, high, rng.uniform(low, high)]) for name, (low, high) in limits.items()}
        seen += [snapshot.status for snapshot in walk(simulation, rng.uniform(0.1, 3.0), Reference(**reference))]
    assert Status.FALLEN not in seen
    assert seen.count(Status.RELAXED) < 0.01 * len(seen)


def test_planned_footholds_alternate_from_the_support():
    simulation = Simulation(HRP2, STEPPING)
    plan = walk(simulation, 1.2, Reference())[-1].plan
    assert [foot.side for foot in plan.footholds] == [Side.RIGHT, Side.LEFT]


def test_a_plan_starts_where_the_robot_is():
    simulation = Simulation(HRP2)
    for before in walk(simulation, 3.0, Reference(vx=0.2)):
        after_one_sample = before.com.integrated(before.plan.jerks[0], before.plan.times[0])
        assert np.allclose(before.plan.com[0], after_one_sample.position)
        assert np.allclose(before.plan.cop[0], before.pendulum.cop(after_one_sample))


@pytest.mark.parametrize(
    ("build", "field"),
    [
        (lambda: Reference(vx=math.nan), "reference.vx"),
        (lambda: Reference(vy=math.inf), "reference.vy"),
        (lambda: Reference(yaw_rate="fast"), "reference.yaw_rate"),
        (lambda: Push([0.0, math.nan]), "push.impulse[1]"),
        (lambda: Push([0.0]), "push.impulse"),
        (lambda: Push([0.0, 1.0], duration=-1.0), "push.duration"),
        (lambda: Push([0.0, 1.0], frame="moon"), "push.frame"),
        (lambda: Parameters(alpha=-1.0), "alpha"),
        (lambda: Parameters(scheme="magic"), "scheme"),
        (lambda: Parameters(control_period=0.03), "sampling_period"),
        (lambda: Parameters(step_duration=0.85), "step_duration"),
        (lambda: Parameters(double_support_duration=0.2), "double_support_duration"),
        (lambda: Parameters(horizon_samples=16.5), "horizon_samples"),
        (lambda: Parameters(horizon_samples=8), "horizon_samples"),
        (lambda: Parameters.from_mapping({"alhpa": 1.0}), "parameters.alhpa"),
        (lambda: HRP2.check_reference(Reference(vx=5.0)), "reference.vx"),
        (lambda: HRP2.check_push(Push([1e3, 0.0])), "push.impulse"),
    ],
)
def test_bad_input_is_refused_with_its_field(build, field):
    with pytest.raises(InvalidValueError) as refused:
        build()
    assert refused.value.field == field
    assert refused.value.limit


def test_the_older_name_of_a_scheme_is_still_taken():
    parameters = Parameters(scheme="mean_speed", horizon_samples=32)
    assert parameters == Parameters(scheme="mean_velocity", horizon_samples=32)
    assert parameters.to_mapping()["scheme"] == "mean_velocity"


def test_clamping_brings_a_reference_within_the_limits():
    clamped = HRP2.clamped_reference(Reference(vx=9.0, vy=-9.0, yaw_rate=0.0))
    assert HRP2.check_reference(clamped) == clamped
    assert clamped.vx == HRP2.max_reference["vx"][1]


def test_the_robot_stands_still_until_a_reference_comes():
    snapshots = walk(Simulation(HRP2), 2.0, Reference())
    assert all(s.phase is Phase.STANDING for s in snapshots)
    assert np.allclose([s.com.position for s in snapshots], 0.0, atol=1e-6)


@pytest.mark.parametrize(
    "reference", [Reference(vx=0.3), Reference(vx=-0.2), Reference(vy=0.2), Reference(vx=0.2, vy=-0.1)]
)
def test_a_walk_ends_in_a_stand_with_aligned_feet(reference):
    simulation = Simulation(HRP2, Parameters(control_period=0.02))
    walk(simulation, 6.3, reference)
    stop = walk(simulation, 5.0, Reference())
    end = stop[-1]
    assert end.phase is Phase.STANDING
    left, right = end.left_foot, end.right_foot
    assert np.allclose(left.position - right.position, [0.0, HRP2.stance_width], atol=1e-9)
    assert np.linalg.norm(end.com.velocity) < 5e-3
    assert all(s.status is Status.SOLVED for s in stop)
    first_stand = next(s for s in stop if s.phase is Phase.STANDING)
    assert first_stand.tick * 0.02 - 6.3 < 3.0
    for s in stop:
        feet = [sole_vertices(HRP2.sole, Footstep(side, foot.position, foot.yaw)) for side, foot in s.feet.items()]
        ground = feet[s.support.side] if s.phase is Phase.SINGLE_SUPPORT else np.vstack(feet)
        assert excess(s.cop, ground) < 0.0


@pytest.mark.parametrize(("impulse", "steps"), [((3.0, 0.0), False), ((0.0, 4.0), False), ((16.0, 0.0), True)])
def test_a_push_at_rest_is_stood_if_it_can_be_and_stepped_if_it_must_be(impulse, steps):
    simulation = Simulation(HRP2, Parameters(control_period=0.02))
    walk(simulation, 1.0, Reference())
    snapshots = walk(simulation, 8.0, Reference(), Push(impulse))
    assert any(s.phase is Phase.SINGLE_SUPPORT for s in snapshots) == steps
    assert all(s.status is not Status.FALLEN for s in snapshots)
    assert snapshots[-1].phase is Phase.STANDING
    assert np.linalg.norm(snapshots[-1].com.velocity) < 5e-3


def test_the_first_step_goes_where_the_reference_leads():
    for reference, swings in ((Reference(vy=0.2), Side.LEFT), (Reference(vy=-0.2), Side.RIGHT)):
        first = next(s for s in walk(Simulation(HRP2), 2.0, reference) if s.phase is Phase.SINGLE_SUPPORT)
        assert first.support.side is swings.other


def test_schemes_and_weights_change_while_the_robot_walks():
    simulation = Simulation(HRP2)
    walk(simulation, 3.0, Reference(vx=0.2))
    for change in (
        {"scheme": "speed_and_jerk"},
        {"scheme": "mean_velocity", "horizon_samples": 32},
        {"scheme": "fixed_steps", "horizon_samples": 16},
        {"scheme": "full", "gamma": 1e-5, "cop_margin": 0.02},
    ):
        simulation.change(simulation.parameters.changed(change))
        assert walk(simulation, 2.0, Reference(vx=0.2))[-1].status is Status.SOLVED


@pytest.mark.parametrize("duration", [0.5, 0.6, 1.2])
def test_steps_take_another_time_from_the_next_one_on(duration):
    simulation = Simulation(HRP2)
    seen = walk(simulation, 3.1, Reference(vx=0.2))  # in the middle of a step
    simulation.change(simulation.parameters.changed({"step_duration": duration}))
    seen += walk(simulation, 5.0, Reference(vx=0.2))
    landed = [now.t for now, after in pairwise(seen) if now.support.side is not after.support.side and now.t > 1.0]
    assert np.diff(landed) == pytest.approx([0.8] * 2 + [duration] * (len(landed) - 3))
    assert all(snapshot.status is Status.SOLVED for snapshot in seen)
    heights = np.array([[foot.height for foot in snapshot.feet.values()] for snapshot in seen])
    assert np.abs(np.diff(heights, axis=0)).max() < 0.005  # 1 m/s: no foot jumps


def test_a_state_knows_how_long_the_step_under_way_takes():
    one, other = Simulation(HRP2), Simulation(HRP2, Parameters(step_duration=0.6))
    walk(one, 3.1, Reference(vx=0.2))
    one.change(one.parameters.changed({"step_duration": 0.6}))
    mapping = one.state.to_mapping()
    assert mapping["gait"]["step_duration"] == 0.8
    other.restore(state_from_mapping(mapping, HRP2, other.parameters))
    for here, there in zip(walk(one, 2.0, Reference(vx=0.2)), walk(other, 2.0, Reference(vx=0.2)), strict=True):
        assert str(row(here)) == str(row(there))


@pytest.mark.parametrize(
    "change", [{"control_period": 0.01}, {"com_height": 0.7}, {"cop_margin": 0.1}, {"scheme": "mean_velocity"}]
)
def test_a_change_that_a_walk_cannot_take_leaves_it_as_it_was(change):
    simulation = Simulation(HRP2)
    with pytest.raises(WalkError):
        simulation.change(simulation.parameters.changed(change))
    assert simulation.parameters == Parameters()
    assert walk(simulation, 2.0, Reference(vx=0.2))[-1].status is Status.SOLVED
