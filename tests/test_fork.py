"""Time that runs backwards: a walk goes on from an earlier tick, exactly as it was or as it might have been."""

import numpy as np
import pytest

from app.live import session_log
from app.live.control import MAX_TICK_TIME, Control
from app.live.fork import Fork
from app.live.live_state import RandomPushes, ReferenceCommand
from app.live.session_log import Session
from walkcore import Parameters, Push, Reference, load_robot
from walkcore.errors import InvalidValueError
from walkcore.mpc.plan import Status
from walkcore.scenario.recording import record

HRP2, TALOS = load_robot("hrp2"), load_robot("talos")
FAST = Parameters(control_period=0.02, initial_double_support_duration=0.3)
LIVE = TALOS.parameters.changed(
    {"initial_double_support_duration": 0.3, "dynamic_filter": True, "step_timing": "adaptive"}
)


def walked(robot, parameters, nb_ticks, changed_at=None, clock=None) -> Control:
    """A walk with references and pushes at random."""
    control = Control(robot, parameters, lambda _: None, *([clock] if clock else []))
    control.start()
    rng = np.random.default_rng(2)
    for tick in range(1, nb_ticks):
        if tick % 23 == 1:
            control.set_reference(ReferenceCommand(Reference(rng.uniform(0.0, 0.3), rng.uniform(-0.1, 0.1)), "rest"))
        if tick % 37 == 0:
            control.push(Push(rng.uniform(-3.0, 3.0, 2), 0.05 * rng.integers(2)))
        if tick == changed_at:
            control.change({"alpha": 3e-6})
        control.tick()
        control.tidy()
    return control


def recording(control, robot, before_reset=False):
    """The walk as it is saved, or the one before its reset or fork."""
    return Session.unpacked(list(control.save(before_reset))).recording("walk", robot)


def run_to(control, tick) -> None:
    while control.latest.snapshot.tick < tick:
        control.tick()
        control.tidy()


class JumpingClock:
    """A clock that stands still, but now and then jumps by more than a tick may take."""

    def __init__(self) -> None:
        self._rng, self._now = np.random.default_rng(1), 0.0

    def __call__(self) -> float:
        self._now += 2.0 * MAX_TICK_TIME * (self._rng.random() < 0.05)
        return self._now


CASES = {
    "point mass": (HRP2, FAST, 150),
    "body": (TALOS, LIVE, 120),
    "physics": (TALOS, LIVE.changed({"plant": "mujoco"}), 90),
    "physics with twin": (TALOS, LIVE.changed({"plant": "mujoco", "twin": True}), 70),
}


@pytest.mark.parametrize("case", CASES)
def test_a_fork_without_a_change_leads_to_the_same_bytes(case):
    robot, parameters, nb_ticks = CASES[case]
    control = walked(robot, parameters, nb_ticks, changed_at=30)
    was = recording(control, robot)
    for tick in (nb_ticks - 3, 47, 31):
        control.fork(Fork(tick))
        assert control.latest.snapshot.tick == tick and control.latest.driver == "past"
        run_to(control, nb_ticks - 1)
        again = recording(control, robot)
        assert again.columns == was.columns and again.rows.tobytes() == was.rows.tobytes()
        comparison = control.latest.comparison
        assert comparison is not None and comparison.now == comparison.was


def test_ticks_that_ran_out_of_time_come_again_as_they_were():
    control = walked(HRP2, FAST, 200, clock=JumpingClock())
    was = recording(control, HRP2)
    assert any("solves_in_time" in event for event in was.scenario.source["events"])
    starts = [
        segment.first_tick
        for segment in (packed.unpacked() for packed in control.save(False))
        if not segment.can_come_first and segment.first_tick > 0
    ]
    assert starts
    for tick in (starts[-1] + 3, starts[0], 31):  # where a segment begins with a tick that takes up the last plan
        control.fork(Fork(tick))
        run_to(control, 199)
        assert recording(control, HRP2).rows.tobytes() == was.rows.tobytes()


def test_other_parameters_reference_or_push_lead_elsewhere_beside_the_walk_that_was():
    for fork in (
        Fork(50, {"gamma": 1e-4}),
        Fork(50, {}, reference=Reference(vx=-0.1)),
        Fork(50, {}, push=Push([0.0, 5.0])),
        Fork(50, {}, follows=False),
    ):
        control = walked(HRP2, FAST, 100)
        was = control.latest.snapshot
        control.fork(fork)
        run_to(control, 99)
        now = control.latest
        assert now.was is not None and np.array_equal(now.was.com.position, was.com.position)
        assert not np.array_equal(now.snapshot.com.position, was.com.position)
        assert now.comparison is not None and now.comparison.now != now.comparison.was
        run_to(control, 101)
        assert control.latest.was is None and control.latest.comparison.is_over


def test_the_present_parameters_hold_where_they_are_asked_for():
    control = walked(HRP2, FAST, 100, changed_at=60)
    assert control.fork(Fork(40)).alpha == FAST.alpha
    control = walked(HRP2, FAST, 100, changed_at=60)
    assert control.fork(Fork(40, {"beta": 2.0}, has_present_parameters=True)).alpha == 3e-6
    assert control.parameters.beta == 2.0


def test_a_shove_that_felled_the_robot_can_be_given_weaker():
    control = walked(HRP2, FAST, 60)
    control.push(Push([0.0, 60.0]))
    run_to(control, 300)
    assert control.latest.snapshot.status is Status.FALLEN
    assert [mark.kind for mark in control.timeline().marks][-2:] == ["push", "fall"]
    control.fork(Fork(60, push=Push([0.0, 4.0])))
    run_to(control, 299)
    comparison = control.latest.comparison
    assert comparison.was.fell_at is not None and not comparison.was.recovery.survived
    assert comparison.now.fell_at is None and comparison.now.recovery.survived
    assert control.timeline().marks[-2].kind == "fork"


def test_whoever_drives_ends_what_follows_the_walk_that_was():
    control = walked(HRP2, FAST, 100)
    control.push_at_random(RandomPushes(4.0, 0.2, seed=1))
    control.fork(Fork(50))
    run_to(control, 60)
    control.set_reference(ReferenceCommand(Reference(vx=0.05), "joystick", client="me"))
    run_to(control, 62)
    assert (control.latest.driver, control.latest.driver_client) == ("joystick", "me")
    assert control.latest.snapshot.reference == Reference(vx=0.05)
    assert control.latest.was is not None


def test_every_tick_that_is_kept_can_be_looked_at():
    control = walked(HRP2, FAST, 75)
    line = control.timeline()
    assert (line.first_tick, line.last_tick, line.control_period) == (0, 74, 0.02)
    for tick in (-5, 0, 9, 10, 42, 74, 99):
        segment = control.past(tick).unpacked()
        ticks = [was.snapshot.tick for was in segment.ticks]
        assert min(max(tick, 0), 74) in ticks
    control.fork(Fork(42))
    assert control.timeline().walk == line.walk + 1 and control.timeline().last_tick == 42
    assert control.past(42).unpacked().ticks[-1].snapshot.tick == 42


def test_a_fork_that_cannot_be_leaves_the_present_walk():
    control = walked(HRP2, FAST, 50)
    before = control.timeline()
    for fork in (Fork(-1), Fork(50), Fork(20, {"alpha": -1.0}), Fork(20, {"control_period": 0.1})):
        with pytest.raises(InvalidValueError):
            control.fork(fork)
        assert control.timeline() == before and control.parameters == FAST
    control.tick()
    assert control.latest.snapshot.tick == 50


def test_memory_is_bounded_and_the_oldest_ticks_go_first(monkeypatch):
    monkeypatch.setattr(session_log, "KEPT", 1.0)
    control = walked(HRP2, FAST, 175)
    first = control.timeline().first_tick
    assert 100 <= first <= 175 - 50
    with pytest.raises(InvalidValueError):
        control.fork(Fork(first - 1))
    control.fork(Fork(first))
    run_to(control, 174)
    assert control.timeline().first_tick == first


def test_the_walk_that_was_can_still_be_saved():
    control = walked(HRP2, FAST, 80)
    was = recording(control, HRP2)
    control.fork(Fork(40, push=Push([3.0, 0.0])))
    saved = recording(control, HRP2, before_reset=True)
    assert saved.rows.tobytes() == was.rows.tobytes()
    control.reset()
    assert control.latest.comparison is None and control.latest.was is None


def test_a_forked_walk_is_saved_as_a_scenario_that_leads_to_it():
    control = walked(HRP2, FAST, 90)
    control.fork(Fork(45, {"gamma": 1e-4}, push=Push([0.0, 2.0])))
    run_to(control, 110)
    driven = recording(control, HRP2)
    assert driven["tick"].tolist() == list(range(111))
    assert record(driven.scenario).rows.tobytes() == driven.rows.tobytes()
