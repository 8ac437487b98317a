import numpy as np
import pytest

from walkcore.gait import Gait, Phase, Side
from walkcore.parameters import Parameters

PAPER = Parameters(control_period=0.1)
FAST = Parameters(control_period=0.005)


def test_samples_per_step_are_eight():
    horizon = Gait(PAPER).horizon(8)  # the first step's first tick
    assert horizon.nb_samples_on_support == 8
    assert horizon.nb_footholds == 1
    assert np.array_equal(horizon.support_selection, [1.0] * 8 + [0.0] * 8)
    assert np.array_equal(horizon.foothold_selection, [[0.0]] * 8 + [[1.0]] * 8)


def test_one_sample_later_a_second_foothold_appears():
    horizon = Gait(PAPER).horizon(9)
    assert horizon.nb_samples_on_support == 7
    assert horizon.nb_footholds == 2
    assert np.array_equal(horizon.foothold_selection[-2:], [[1.0, 0.0], [0.0, 1.0]])


@pytest.mark.parametrize("parameters", [PAPER, FAST])
def test_every_sample_has_exactly_one_support(parameters):
    gait = Gait(parameters)
    for tick in range(0, 40 * parameters.ticks_per_sample, 3):
        horizon = gait.horizon(tick)
        total = horizon.support_selection + horizon.foothold_selection.sum(axis=1)
        assert np.array_equal(total, np.ones(parameters.horizon_samples))


def test_the_first_interval_shrinks_from_a_period_to_one_tick_and_back():
    assert [Gait(FAST).horizon(tick).ticks_to_sample for tick in (0, 1, 19, 20, 21)] == [20, 19, 1, 20, 19]


def test_samples_of_all_ticks_between_two_grid_points_have_the_same_supports():
    gait = Gait(FAST)
    on_grid = gait.horizon(180)
    for tick in range(181, 200):
        assert np.array_equal(gait.horizon(tick).foot, on_grid.foot)


def test_no_sample_falls_inside_a_double_support():
    gait = Gait(FAST)
    for sample in range(8, 60):
        before, after = gait.phase(20 * sample - 1), gait.phase(20 * sample)
        assert Phase.SINGLE_SUPPORT in (before, after) or sample == 8


def test_feet_alternate_and_land_when_said():
    gait = Gait(FAST)
    landings = [tick for tick in range(2000) if gait.is_touchdown(tick)]
    assert np.array_equal(np.diff(landings), [160] * (len(landings) - 1))
    for tick in landings:
        assert gait.support_side(tick) == gait.support_side(tick - 1).other
        assert gait.time_to_touchdown(tick - 1) == pytest.approx(0.005)
        assert gait.time_to_touchdown(tick) == pytest.approx(0.8)
        assert gait.swing_progress(tick - 1) == pytest.approx(139 / 140)


def test_the_walk_starts_standing_on_both_feet():
    gait = Gait(PAPER)
    assert [gait.phase(tick) for tick in (0, 7, 8, 9, 15, 16)] == [
        Phase.STANDING,
        Phase.STANDING,
        Phase.DOUBLE_SUPPORT,
        Phase.SINGLE_SUPPORT,
        Phase.SINGLE_SUPPORT,
        Phase.DOUBLE_SUPPORT,
    ]
    assert gait.support_side(0) is Side.LEFT
    assert np.array_equal(gait.horizon(0).is_on_both, [True] * 8 + [False] * 8)
