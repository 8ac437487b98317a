"""The schedule of the ticks, and the measures of how they keep up."""

import pytest
from conftest import Clock

from app.live.tick_scheduler import MAX_CATCH_UP, TickScheduler


def starts(scheduler: TickScheduler, clock: Clock, durations: list[float]) -> list[float]:
    """Time at which each tick starts, if the ticks take so long."""
    start, times = clock.now, []
    for duration in durations:
        clock.now += max(scheduler.time_left, 0.0)
        scheduler.start_tick()
        times.append(clock.now - start)
        clock.now += duration
        scheduler.record(duration, {"solve": duration / 2})
    return times


def test_ticks_keep_the_period_and_catch_up_after_a_short_delay(clock):
    scheduler = TickScheduler(0.005, clock)
    times = starts(scheduler, clock, [0.002, 0.002, 0.009, 0.002, 0.002, 0.002])
    assert times == pytest.approx([0.0, 0.005, 0.010, 0.019, 0.021, 0.025])
    assert scheduler.timing.misses == 0 and scheduler.timing.tick_ms_max == pytest.approx(9.0)


def test_a_long_delay_makes_one_tick_late_and_moves_the_schedule(clock):
    scheduler = TickScheduler(0.005, clock)
    times = starts(scheduler, clock, [0.002, 0.002, 0.018, 0.002, 0.002, 0.002])
    assert times == pytest.approx([0.0, 0.005, 0.010, 0.028, 0.033, 0.038])
    assert scheduler.timing.misses == 1 and scheduler.timing.real_time_factor == pytest.approx(25 / 38)


def test_every_late_tick_is_counted_by_how_late_it_started(clock):
    scheduler = TickScheduler(0.005, clock)
    starts(scheduler, clock, [0.002, 0.0065, 0.012, 0.002, 0.002, 0.002, 0.070, 0.002])
    timing = scheduler.timing
    assert timing.ticks == 8
    # 1.5 ms after the second tick, 8.5 after the third, 65 after the seventh
    assert timing.lateness == (5, 1, 1, 1)
    assert [timing.later_than(edge) for edge in (0.001, 0.005, 0.05)] == [3, 2, 1]
    assert timing.lateness_max == pytest.approx(0.065)
    assert timing.lateness_sum == pytest.approx(0.0015 + 0.0085 + 0.065)


def test_far_behind_the_schedule_moves_and_the_factor_drops(clock):
    scheduler = TickScheduler(0.005, clock)
    times = starts(scheduler, clock, [0.002] * 200 + [1.0] + [0.002] * 200)
    assert times[-1] - times[201] == pytest.approx(199 * 0.005)
    assert scheduler.timing.real_time_factor == pytest.approx(400 * 0.005 / times[-1])
    slow = TickScheduler(0.005, clock)
    starts(slow, clock, [0.010] * 2000)
    assert slow.timing.real_time_factor == pytest.approx(0.5, abs=0.01)
    assert -slow.time_left < MAX_CATCH_UP + 0.010


@pytest.mark.parametrize("speed", [0.1, 4.0])
def test_the_factor_is_relative_to_the_requested_speed_and_real_t_is_not(clock, speed):
    scheduler = TickScheduler(0.005, clock)
    starts(scheduler, clock, [0.0] * 100)
    scheduler.set_speed(speed)
    before = scheduler.real_t
    times = starts(scheduler, clock, [0.0005] * 401)
    assert times[-1] - times[0] == pytest.approx(400 * 0.005 / speed)
    assert scheduler.timing.real_time_factor == pytest.approx(1.0)
    assert scheduler.real_t - before == pytest.approx(400 * 0.005 / speed)
    assert scheduler.timing.misses == 0


def test_a_pause_counts_neither_against_the_factor_nor_as_real_time(clock):
    scheduler = TickScheduler(0.005, clock)
    starts(scheduler, clock, [0.002] * 101)
    clock.now += 60.0
    scheduler.restart()
    starts(scheduler, clock, [0.002] * 101)
    assert scheduler.timing.real_time_factor == pytest.approx(1.0) and scheduler.timing.misses == 0
    assert scheduler.real_t == pytest.approx(200 * 0.005)


def test_stages_are_smoothed_and_fade_where_they_no_longer_come(clock):
    scheduler = TickScheduler(0.005, clock)
    starts(scheduler, clock, [0.002] * 300)
    assert scheduler.timing.stages == {"solve": pytest.approx(1.0)}
    for _ in range(500):
        scheduler.record(0.001, {"gait": 0.001})
    assert scheduler.timing.stages["solve"] < 1e-3 and scheduler.timing.stages["gait"] == pytest.approx(1.0)
