"""When ticks are due, and what is told of how they keep up."""

import pytest

from app.live.pace import MAX_LATENESS, Pace

START = 100.0


class Clock:
    """Time that passes only when it is told to."""

    def __init__(self) -> None:
        self.now = START

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def starts(pace: Pace, clock: Clock, durations: list[float]) -> list[float]:
    """When each tick starts, if the ticks take so long."""
    times = []
    for duration in durations:
        clock.now += max(pace.time_left, 0.0)
        pace.begin()
        times.append(clock.now - START)
        clock.now += duration
        pace.record(duration, {"solve": duration / 2})
    return times


def test_ticks_keep_the_period_and_catch_up_after_a_short_delay(clock):
    pace = Pace(0.005, clock)
    times = starts(pace, clock, [0.002, 0.002, 0.009, 0.002, 0.002, 0.002])
    assert times == pytest.approx([0.0, 0.005, 0.010, 0.019, 0.021, 0.025])
    assert pace.timing.misses == 0 and pace.timing.tick_ms_max == pytest.approx(9.0)


def test_a_long_delay_makes_one_tick_late_and_moves_the_schedule(clock):
    pace = Pace(0.005, clock)
    times = starts(pace, clock, [0.002, 0.002, 0.018, 0.002, 0.002, 0.002])
    assert times == pytest.approx([0.0, 0.005, 0.010, 0.028, 0.033, 0.038])
    assert pace.timing.misses == 1 and pace.timing.real_time_factor == pytest.approx(25 / 38)


def test_every_late_tick_is_counted_by_how_late_it_started(clock):
    pace = Pace(0.005, clock)
    starts(pace, clock, [0.002, 0.0065, 0.012, 0.002, 0.002, 0.002, 0.070, 0.002])
    timing = pace.timing
    assert timing.ticks == 8
    # 1.5 ms after the second tick, 8.5 after the third, 65 after the seventh
    assert timing.lateness == (5, 1, 1, 1)
    assert [timing.later_than(edge) for edge in (0.001, 0.005, 0.05)] == [3, 2, 1]
    assert timing.lateness_max == pytest.approx(0.065)
    assert timing.lateness_sum == pytest.approx(0.0015 + 0.0085 + 0.065)


def test_far_behind_the_schedule_moves_and_the_factor_tells(clock):
    pace = Pace(0.005, clock)
    times = starts(pace, clock, [0.002] * 200 + [1.0] + [0.002] * 200)
    assert times[-1] - times[201] == pytest.approx(199 * 0.005)
    assert pace.timing.real_time_factor == pytest.approx(400 * 0.005 / times[-1])
    slow = Pace(0.005, clock)
    starts(slow, clock, [0.010] * 2000)
    assert slow.timing.real_time_factor == pytest.approx(0.5, abs=0.01)
    assert -slow.time_left < MAX_LATENESS + 0.010


@pytest.mark.parametrize("speed", [0.1, 4.0])
def test_the_factor_is_relative_to_the_speed_asked_and_real_t_is_not(clock, speed):
    pace = Pace(0.005, clock)
    starts(pace, clock, [0.0] * 100)
    pace.set_speed(speed)
    before = pace.real_t
    times = starts(pace, clock, [0.0005] * 401)
    assert times[-1] - times[0] == pytest.approx(400 * 0.005 / speed)
    assert pace.timing.real_time_factor == pytest.approx(1.0)
    assert pace.real_t - before == pytest.approx(400 * 0.005 / speed)
    assert pace.timing.misses == 0


def test_a_pause_counts_neither_against_the_factor_nor_as_real_time(clock):
    pace = Pace(0.005, clock)
    starts(pace, clock, [0.002] * 101)
    clock.now += 60.0
    pace.restart()
    starts(pace, clock, [0.002] * 101)
    assert pace.timing.real_time_factor == pytest.approx(1.0) and pace.timing.misses == 0
    assert pace.real_t == pytest.approx(200 * 0.005)


def test_stages_are_smoothed_and_fade_where_they_no_longer_come(clock):
    pace = Pace(0.005, clock)
    starts(pace, clock, [0.002] * 300)
    assert pace.timing.stages == {"solve": pytest.approx(1.0)}
    for _ in range(500):
        pace.record(0.001, {"gait": 0.001})
    assert pace.timing.stages["solve"] < 1e-3 and pace.timing.stages["gait"] == pytest.approx(1.0)
