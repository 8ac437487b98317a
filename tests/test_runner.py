"""The thread that keeps the tick rate, without a server around it."""

import time
from collections.abc import Callable, Iterator

import pytest

from app.pace import MAX_LATENESS, Pace
from app.runner import NotPausedError, Runner
from walkcore import Parameters, Push, Reference, WalkError, load_robot

PATIENCE = 20.0  # [s] on a busy machine


def wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


@pytest.fixture
def runner() -> Iterator[Runner]:
    runner = Runner(load_robot("hrp2"), Parameters())
    runner.start()
    yield runner
    runner.stop()


def test_there_is_a_state_before_the_first_start():
    runner = Runner(load_robot("hrp2"), Parameters())
    assert runner.latest.snapshot.tick == 0 and runner.latest.driver == "none"
    runner.stop()


def test_every_tick_is_taken_and_none_is_skipped(runner, monkeypatch):
    ticks = []
    step = runner._simulation.step
    monkeypatch.setattr(runner._simulation, "step", lambda command: ticks.append(s := step(command)) or s)
    wait_for(lambda: len(ticks) > 200)
    numbers = [snapshot.tick for snapshot in ticks]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def test_unexpected_error_pauses_the_robot_and_is_told_and_the_thread_lives(runner, monkeypatch, caplog):
    def fail(_: object) -> None:
        raise ZeroDivisionError("a bug")

    with monkeypatch.context() as broken:
        broken.setattr(runner._simulation, "step", fail)
        wait_for(lambda: runner.latest.fault != "")
        assert runner.latest.fault == "ZeroDivisionError: a bug" and not runner.latest.running
        assert "a bug" in caplog.text
        assert runner.reset().result(PATIENCE).fault == "ZeroDivisionError: a bug"
    assert runner.reset().result(PATIENCE).fault == ""
    assert runner.resume().result(PATIENCE).running
    wait_for(lambda: runner.latest.snapshot.tick > 10)


def test_reset_and_step_answer_with_the_state_that_they_lead_to(runner):
    with pytest.raises(NotPausedError):
        runner.step(1).result(PATIENCE)
    runner.pause()
    assert runner.reset().result(PATIENCE).snapshot.tick == 0
    assert runner.step(7).result(PATIENCE).snapshot.tick == 7


def test_wish_that_nobody_waits_for_any_more_is_harmless(runner):
    wishes = [runner.pause(), runner.step(1), runner.resume()]
    for wish in wishes:
        wish.cancel()
    tick = runner.latest.snapshot.tick
    wait_for(lambda: runner.latest.running and runner.latest.snapshot.tick > tick + 5)


def test_reference_expires_and_a_held_one_does_not(runner):
    runner.drive(Reference(vx=0.1), "joystick", expires_after=0.05)
    wait_for(lambda: runner.latest.driver == "joystick")
    wait_for(lambda: runner.latest.driver == "none")
    assert runner.latest.snapshot.reference.is_zero
    runner.drive(Reference(vx=0.1), "sliders")
    wait_for(lambda: runner.latest.driver == "sliders")
    tick = runner.latest.snapshot.tick
    wait_for(lambda: runner.latest.snapshot.tick > tick + 100)
    assert runner.latest.snapshot.reference.vx == 0.1


def test_push_begins_once(runner):
    runner.pause().result(PATIENCE)
    runner.push(Push([0.0, 5.0]))
    assert [runner.step(1).result(PATIENCE).snapshot.push[1] for _ in range(2)] == [5.0, 0.0]


@pytest.mark.parametrize("beyond", [Reference(vx=99.0), Push([1e4, 0.0])])
def test_what_is_beyond_the_limits_does_not_get_in(runner, beyond):
    with pytest.raises(WalkError):
        runner.drive(beyond, "rest") if isinstance(beyond, Reference) else runner.push(beyond)
    time.sleep(0.05)
    assert runner.latest.driver == "none" and runner.latest.snapshot.status == 0


class Clock:
    """Time that passes only when it is told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def perf_counter(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        assert duration >= 0.0
        self.now += duration


@pytest.fixture
def clock(monkeypatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr("app.pace.time", clock)
    return clock


def starts(pace: Pace, clock: Clock, durations: list[float]) -> list[float]:
    """When each tick starts, if the ticks take so long."""
    times = []
    for duration in durations:
        pace.wait()
        times.append(clock.now - 100.0)
        clock.now += duration
        pace.record(duration)
    return times


def test_ticks_keep_the_period_and_catch_up_after_a_short_delay(clock):
    pace = Pace(0.005)
    times = starts(pace, clock, [0.002, 0.002, 0.018, 0.002, 0.002, 0.002, 0.002, 0.002, 0.002])
    assert times == pytest.approx([0.0, 0.005, 0.010, 0.028, 0.030, 0.032, 0.034, 0.036, 0.040])
    assert pace.timing.misses == 3 and pace.timing.tick_ms_max == pytest.approx(18.0)


def test_far_behind_the_schedule_moves_and_the_factor_tells(clock):
    pace = Pace(0.005)
    times = starts(pace, clock, [0.002] * 200 + [1.0] + [0.002] * 200)
    assert times[-1] - times[201] == pytest.approx(199 * 0.005)
    assert pace.timing.real_time_factor == pytest.approx(400 * 0.005 / times[-1])
    slow = Pace(0.005)
    starts(slow, clock, [0.010] * 2000)
    assert slow.timing.real_time_factor == pytest.approx(0.5, abs=0.01)
    assert clock.now - slow._due < MAX_LATENESS + 0.010


def test_a_pause_does_not_count_against_the_factor(clock):
    pace = Pace(0.005)
    starts(pace, clock, [0.002] * 100)
    clock.now += 60.0
    pace.restart()
    starts(pace, clock, [0.002] * 100)
    assert pace.timing.real_time_factor == pytest.approx(1.0) and pace.timing.misses == 0
