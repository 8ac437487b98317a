import math

import numpy as np
import pytest

from walkcore.mpc.gait import Gait, Phase
from walkcore.mpc.stance import Side
from walkcore.parameters import Parameters

PAPER = Parameters(control_period=0.1)
FAST = Parameters(control_period=0.005)


def walking(parameters):
    """A gait whose first step begins after the initial double support."""
    return Gait(parameters.timing, start=parameters.timing.samples_before_first_step)


def test_samples_per_step_are_eight():
    horizon = walking(PAPER).horizon(8).stances  # the first step's first tick
    assert horizon.samples_on_support == 8
    assert horizon.nb_footholds == 1
    assert np.array_equal(horizon.Uc[:, 0], [1.0] * 8 + [0.0] * 8)
    assert np.array_equal(horizon.U, [[0.0]] * 8 + [[1.0]] * 8)


def test_one_sample_later_a_second_foothold_appears():
    horizon = walking(PAPER).horizon(9).stances
    assert horizon.samples_on_support == 7
    assert horizon.nb_footholds == 2
    assert np.array_equal(horizon.U[-2:], [[1.0, 0.0], [0.0, 1.0]])


@pytest.mark.parametrize("parameters", [PAPER, FAST])
def test_every_sample_has_exactly_one_support(parameters):
    gait = walking(parameters)
    for tick in range(0, 40 * parameters.timing.ticks_per_sample, 3):
        horizon = gait.horizon(tick).stances
        total = horizon.Uc[:, 0] + horizon.U.sum(axis=1)
        assert np.array_equal(total, np.ones(parameters.horizon_samples))


def test_the_first_interval_shrinks_from_a_period_to_one_tick_and_back():
    assert [walking(FAST).horizon(tick).ticks_to_sample for tick in (0, 1, 19, 20, 21)] == [20, 19, 1, 20, 19]


def test_samples_of_all_ticks_between_two_grid_points_have_the_same_supports():
    gait = walking(FAST)
    on_grid = gait.horizon(180).stances
    for tick in range(181, 200):
        assert np.array_equal(gait.horizon(tick).stances.foot_of_sample, on_grid.foot_of_sample)


def test_no_sample_falls_inside_a_double_support():
    gait = walking(FAST)
    for sample in range(8, 60):
        before, after = gait.at(20 * sample - 1).phase, gait.at(20 * sample).phase
        assert Phase.SINGLE_SUPPORT in (before, after) or sample == 8


def test_feet_alternate_and_land_when_said():
    gait = walking(FAST)
    landings = [tick for tick in range(1, 2000) if gait.support_side(tick) != gait.support_side(tick - 1)]
    assert np.array_equal(np.diff(landings), [160] * (len(landings) - 1))
    for tick in landings:
        assert gait.support_side(tick) == gait.support_side(tick - 1).other
        assert gait.at(tick - 1).time_to_touchdown == pytest.approx(0.005)
        assert gait.at(tick).time_to_touchdown == pytest.approx(0.8)
        assert gait.at(tick - 1).swing_progress == pytest.approx(139 / 140)


def test_the_walk_starts_standing_on_both_feet():
    gait = walking(PAPER)
    assert [gait.at(tick).phase for tick in (0, 7, 8, 9, 15, 16)] == [
        Phase.STANDING,
        Phase.STANDING,
        Phase.DOUBLE_SUPPORT,
        Phase.SINGLE_SUPPORT,
        Phase.SINGLE_SUPPORT,
        Phase.DOUBLE_SUPPORT,
    ]
    assert gait.support_side(0) is Side.LEFT
    assert np.array_equal(gait.horizon(0).stances.is_double_support, [True] * 8 + [False] * 8)


def test_a_stand_has_no_end_until_a_walk_is_requested():
    stand = Gait(FAST.timing)
    assert stand.at(10_000).phase is Phase.STANDING
    assert math.isnan(stand.at(10_000).time_to_touchdown)
    assert stand.horizon(10_000).stances.is_double_support.all()
    assert stand.candidates(100, walks=False, first_support=Side.LEFT)[0] == stand
    walk = stand.candidates(100, walks=True, first_support=Side.RIGHT)[0]
    assert (walk.start, walk.first_support, walk.nb_steps) == (5 + 8, Side.RIGHT, None)
    assert walk.candidates(200, walks=True, first_support=Side.LEFT)[0] == walk
    assert walk.candidates(200, walks=False, first_support=Side.LEFT)[0].start is None


def test_a_stop_takes_one_free_step_and_one_that_aligns_the_feet():
    walk = walking(FAST)
    tick = 160 + 50  # in the first step
    stop = walk.candidates(tick, walks=False, first_support=Side.LEFT)[0]
    assert stop.nb_steps == 2
    assert stop.horizon(tick).stances.nb_footholds == 1
    assert np.array_equal(stop.horizon(tick).stances.is_double_support, [False] * 14 + [True] * 2)
    horizon = stop.horizon(160 + 2 * 160 - 1).stances
    assert horizon.is_stopping
    assert horizon.nb_footholds == 0
    assert np.array_equal(horizon.is_double_support, [False] + [True] * 15)
    assert not stop.has_ended(160 + 2 * 160 - 1)
    assert stop.has_ended(160 + 2 * 160)
    assert stop.candidates(tick + 20, walks=True, first_support=Side.LEFT) == (walk,)
