"""Laws of the stabiliser: which error of the DCM the soles take back, and which the model takes over."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from walkcore.mpc.regions import nearest_within
from walkcore.mpc.stance import Footstep, Side, Stance
from walkcore.plant.stabilizer import (
    COP_GAIN,
    MODEL_GAIN,
    SATURATED_GAIN,
    catch_up,
    commanded_cop,
    share_inside,
)

SOLE = np.array([[-0.1, -0.06], [0.1, -0.06], [0.1, 0.06], [-0.1, 0.06]])
STANCE = Stance((Footstep(Side.LEFT, np.array([1.0, 0.1]), 0.4),), SOLE)
MIDDLE = np.array([1.0, 0.1])
OMEGA, PERIOD = 3.36, 0.005
directions = st.floats(-np.pi, np.pi).map(lambda angle: np.array([np.cos(angle), np.sin(angle)]))
lengths = st.floats(0.0, 0.3)


@given(directions, lengths)
def test_the_share_of_a_way_ends_inside_and_more_of_it_outside(direction, length):
    share = share_inside(STANCE.polygon, MIDDLE, length * direction)
    end = MIDDLE + share * length * direction
    assert nearest_within(STANCE.polygon, end) == pytest.approx(end, abs=1e-9)
    if share < 1.0:
        beyond = end + 1e-3 * direction
        assert np.hypot(*(nearest_within(STANCE.polygon, beyond) - beyond)) > 1e-6


def test_no_share_of_a_way_that_starts_outside_is_inside():
    assert share_inside(STANCE.polygon, MIDDLE + [0.5, 0.0], np.array([-0.5, 0.0])) == 0.0


@given(directions)
def test_the_model_follows_an_error_that_the_soles_take_back_slowly_and_the_rest_faster(direction):
    small, large = 0.01 * direction, 0.2 * direction
    np.testing.assert_allclose(
        catch_up(MIDDLE, small, STANCE, OMEGA, PERIOD), OMEGA * PERIOD * MODEL_GAIN * small, rtol=1e-12
    )
    taken = np.hypot(*catch_up(MIDDLE, large, STANCE, OMEGA, PERIOD)) / (OMEGA * PERIOD * 0.2)
    reach = share_inside(STANCE.polygon, MIDDLE, COP_GAIN * large)
    assert reach < 0.2
    assert taken == pytest.approx(MODEL_GAIN + SATURATED_GAIN * (1.0 - reach))


@given(directions, lengths)
def test_the_commanded_cop_lies_in_the_stance_beyond_the_error(direction, length):
    commanded = commanded_cop(MIDDLE, length * direction, STANCE, 0.015)
    assert nearest_within(STANCE.polygon, commanded) == pytest.approx(commanded, abs=1e-9)
    assert (commanded - MIDDLE) @ direction >= min(COP_GAIN * length, 0.0449) - 1e-9
