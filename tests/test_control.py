"""The control loop, tick by tick, without a process around it."""

import pytest
from conftest import Clock

from app.live.control import Control, NotPausedError
from app.live.live_state import NO_REFERENCE, LiveState, RandomPushes, ReferenceCommand
from walkcore import Parameters, Push, Reference, Simulation, WalkError, load_robot
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status

HRP2 = load_robot("hrp2")
PERIOD = 0.02  # [s]
PARAMETERS = Parameters(control_period=PERIOD)


@pytest.fixture
def shown() -> list[LiveState]:
    return []


@pytest.fixture
def control(clock, shown) -> Control:
    control = Control(HRP2, PARAMETERS, shown.append, clock)
    control.start()
    return control


def walk(control: Control, clock: Clock, nb_ticks: int) -> None:
    """Ticks at their times."""
    for _ in range(nb_ticks):
        clock.now += max(control.time_left, 0.0)
        control.tick()


def test_no_tick_is_due_before_the_start_nor_during_a_pause(clock, shown):
    control = Control(HRP2, PARAMETERS, shown.append, clock)
    assert control.time_left == float("inf") and control.latest.snapshot.tick == 0
    control.start()
    assert control.time_left == 0.0
    control.pause()
    assert control.time_left == float("inf")
    control.resume()
    assert control.time_left == 0.0


def test_a_pause_however_long_makes_no_tick_late(control, clock):
    walk(control, clock, 5)
    control.pause()
    clock.now += 30.0
    control.resume()
    walk(control, clock, 5)
    assert control.latest.timing.misses == 0 and control.latest.timing.lateness_max < 1e-9


def test_a_robot_at_rest_sleeps_once_nobody_attends_it_and_wakes_when_somebody_does(control, clock):
    control.attend(2.0)
    nb_ticks = 0
    while control.time_left < float("inf") and nb_ticks < 200:
        walk(control, clock, 1)
        nb_ticks += 1
    asleep_at = control.latest.snapshot.tick
    assert asleep_at == nb_ticks == pytest.approx(2.0 / PERIOD, abs=2)
    clock.now += 100.0
    control.attend(2.0)
    assert control.time_left == 0.0
    walk(control, clock, 3)
    assert control.latest.snapshot.tick == asleep_at + 3 and control.latest.timing.lateness_max < 1e-9


@pytest.mark.parametrize("what", ["reference", "push", "random pushes"])
def test_a_robot_that_is_not_at_rest_does_not_sleep(control, clock, what):
    control.attend(0.5)
    if what == "reference":
        control.set_reference(ReferenceCommand(Reference(vx=0.1), "api"))
    elif what == "push":
        walk(control, clock, 20)
        control.push(Push([8.0, 0.0]))
    else:
        control.push_at_random(RandomPushes(1.0, 60.0, 1))
    walk(control, clock, 20 if what == "push" else 40)
    assert control.time_left <= PERIOD


def test_every_tick_is_taken_and_shown(control, clock, shown):
    walk(control, clock, 50)
    assert [state.snapshot.tick for state in shown] == list(range(51))
    assert control.latest.real_t == pytest.approx(49 * PERIOD)
    assert set(control.latest.timing.stages) >= {"gait", "assemble", "solve", "swing_foot"}


def test_an_unexpected_error_pauses_the_robot_and_is_reported(control, clock, monkeypatch, caplog):
    def fail(*_: object) -> None:
        raise ZeroDivisionError("a bug")

    with monkeypatch.context() as broken:
        broken.setattr(Simulation, "step", fail)
        walk(control, clock, 1)
    assert control.latest.fault == "ZeroDivisionError: a bug" and not control.latest.running
    assert "a bug" in caplog.text
    assert control.reset().fault == "ZeroDivisionError: a bug" and not control.latest.running
    assert control.resume().fault == "" and control.latest.running


def test_steps_and_samples_are_taken_only_while_paused(control, clock):
    with pytest.raises(NotPausedError):
        control.step(1)
    walk(control, clock, 7)
    control.pause()
    assert control.step(5).snapshot.tick == 12
    assert control.step_samples(1).snapshot.tick == 15
    assert control.step_samples(1).snapshot.tick == 20
    assert control.step_samples(3).snapshot.tick == 35


def test_a_reference_expires_on_the_wall_and_a_held_one_does_not(control, clock):
    control.set_speed(0.1)
    control.set_reference(ReferenceCommand(Reference(vx=0.1), "joystick", expires_at=clock.now + 0.4, client="me"))
    walk(control, clock, 2)
    assert (control.latest.driver, control.latest.driver_client) == ("joystick", "me")
    walk(control, clock, 2)
    assert control.latest.driver == "none" and control.latest.snapshot.reference.is_zero
    control.set_reference(ReferenceCommand(Reference(vx=0.1), "rest"))
    walk(control, clock, 200)
    assert control.latest.driver == "rest" and control.latest.snapshot.reference.vx == 0.1


def test_a_refused_change_changes_nothing(control):
    before = control.parameters
    for refused in ({"scheme": "magic"}, {"control_period": 0.005}, {"cop_margin": 0.15}):
        with pytest.raises(WalkError):
            control.change(refused)
    assert control.parameters is before
    assert control.change({"cop_margin": 0.02}).cop_margin == 0.02 == control.parameters.cop_margin


def test_reset_forgets_references_and_pushes(control, clock):
    control.set_reference(ReferenceCommand(Reference(vx=0.2), "rest"))
    walk(control, clock, 75)
    control.push(Push([0.0, 3.0]))
    walk(control, clock, 10)
    control.push(Push([0.0, 3.0]))
    state = control.reset()
    assert (state.snapshot.tick, state.driver, state.real_t) == (0, NO_REFERENCE.driver, 0.0)
    assert state.last_push is None and not state.snapshot.push.any()
    assert state.running and control.time_left == 0.0


def test_speed_sets_how_often_ticks_come(control, clock):
    for speed in (0.1, 4.0):
        assert control.set_speed(speed).speed == speed
        start = clock.now
        walk(control, clock, 101)
        assert clock.now - start == pytest.approx(100 * PERIOD / speed)


def test_a_preview_is_of_the_reference_in_force_and_all_at_once(control, clock):
    control.set_reference(ReferenceCommand(Reference(vx=0.2), "rest"))
    walk(control, clock, 75)
    slow, sudden = (control.preview(Push([0.0, 6.0], duration)) for duration in (0.5, 0.0))
    assert slow.push.tolist() == sudden.push.tolist() == pytest.approx([0.0, 6.0])
    assert slow.reference.vx == 0.2
    assert control.latest.last_push is None
    walk(control, clock, 1)
    assert not control.latest.snapshot.push.any()


def random_pushes(control: Control, clock: Clock, seed: int) -> list[tuple[int, float, float]]:
    control.reset()
    control.push_at_random(RandomPushes(2.0, 0.5, seed))
    found = []
    for _ in range(500):
        walk(control, clock, 1)
        snapshot = control.latest.snapshot
        if snapshot.push.any():
            found.append((snapshot.tick, *snapshot.push))
    return found


def test_random_pushes_come_at_their_interval_within_their_strength_and_again_for_the_same_seed(control, clock):
    pushes = random_pushes(control, clock, 1)
    assert 12 <= len(pushes) <= 28
    assert all(1.0 - 1e-9 <= (x * x + y * y) ** 0.5 <= 2.0 + 1e-9 for _, x, y in pushes)
    assert random_pushes(control, clock, 1) == pushes != random_pushes(control, clock, 2)
    assert control.latest.random_pushes == RandomPushes(2.0, 0.5, 2)
    assert control.push_at_random(None).random_pushes is None


def follow(control: Control, clock: Clock, push: Push, nb_ticks: int = 400) -> list[object]:
    control.push(push)
    story = []
    for _ in range(nb_ticks):
        walk(control, clock, 1)
        if not story or control.latest.last_push != story[-1]:
            story.append(control.latest.last_push)
    return story


def test_a_push_that_is_survived_is_reported_with_its_steps(control, clock):
    control.set_reference(ReferenceCommand(Reference(vx=0.2), "rest"))
    walk(control, clock, 300)
    story = follow(control, clock, Push([0.0, 12.0]))
    assert story[0].t == 301 * PERIOD and story[0].impulse == pytest.approx((0.0, 12.0))
    assert [push.survived for push in story[:-1]] == [None] * (len(story) - 1)
    assert story[-1].survived is True and 1 <= story[-1].steps <= 6
    assert [push.steps for push in story[:-1]] == list(range(len(story) - 1))
    assert follow(control, clock, Push([0.0, 0.5]))[-1].steps == 1


def test_a_standing_robot_survives_a_light_push_without_a_step(control, clock):
    walk(control, clock, 100)
    *_, last = follow(control, clock, Push([0.0, 0.5], 0.1))
    assert (last.survived, last.steps) == (True, 0) and last.impulse == pytest.approx((0.0, 0.5))


@pytest.mark.parametrize(("impulse", "has_steps"), [([0.0, 18.0], False), ([14.0, 0.0], True)])
def test_a_standing_robot_that_stands_again_has_survived_wherever_it_stands(control, clock, impulse, has_steps):
    walk(control, clock, 100)
    story = follow(control, clock, Push(impulse))
    assert control.latest.snapshot.phase is Phase.STANDING
    assert [push.survived for push in story] == [None] * (len(story) - 1) + [True]
    assert (story[-1].steps > 0) is has_steps


def test_a_push_to_the_ground_is_a_failed_solve_and_not_survived(control, clock):
    walk(control, clock, 100)
    *_, last = follow(control, clock, Push([0.0, 45.0]))
    assert last.survived is False
    assert control.latest.snapshot.status is Status.FALLEN
    assert control.latest.counts.failed == 1 and control.latest.counts.relaxed > 0
    walk(control, clock, 20)
    assert control.latest.counts.failed == 1
