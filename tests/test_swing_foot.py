import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from walkcore.motion.swing_foot import standing, swing, swing_height
from walkcore.mpc.stance import Footstep, Side

TICK, MAX_SPEED = 0.005, np.array([1.5, 1.0, 1.5])
START = Footstep(Side.LEFT, np.zeros(2), 0.0)


def fly(targets, duration=0.7, support_yaw=0.0):
    """The foot at every tick, towards targets[i] from tick i on."""
    nb_ticks = round(duration / TICK)
    feet = [standing(START)]
    for i in range(nb_ticks):
        target = Footstep(Side.LEFT, targets[min(i * len(targets) // nb_ticks, len(targets) - 1)], 0.3)
        feet.append(swing(feet[-1], target, (nb_ticks - i) * TICK, TICK, MAX_SPEED, support_yaw, 0.0))
    return feet


def test_replanning_towards_the_same_foothold_stays_on_one_quintic():
    feet = fly([np.array([0.4, 0.1])])
    s = np.linspace(0.0, 1.0, len(feet))
    quintic = 10 * s**3 - 15 * s**4 + 6 * s**5
    assert np.allclose([foot.position[0] for foot in feet], 0.4 * quintic, atol=1e-9)


def test_the_foot_lands_at_rest_on_its_foothold():
    foot = fly([np.array([0.4, 0.1])])[-1]
    assert np.array_equal(foot.position, [0.4, 0.1])
    assert np.array_equal(foot.velocity, [0.0, 0.0, 0.0])
    assert foot.yaw == 0.3


coordinate = st.floats(-0.5, 0.5)


@given(st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=20), st.floats(-1.0, 1.0))
def test_no_late_change_within_the_speed_bound_makes_the_foot_faster_than_it(decided, yaw):
    c, s = np.cos(yaw), np.sin(yaw)
    R = np.array([[c, -s], [s, c]])
    foot, nb_ticks = standing(START), 140
    for i in range(nb_ticks):
        time_left = (nb_ticks - i) * TICK
        foothold = np.array(decided[i * len(decided) // nb_ticks])
        # What the QP may decide at this tick: (30).
        allowed = np.clip(R.T @ (foothold - foot.position), -time_left * MAX_SPEED[:2], time_left * MAX_SPEED[:2])
        target = foot.position + R @ allowed
        after = swing(foot, Footstep(Side.LEFT, target, 0.0), time_left, TICK, MAX_SPEED, yaw, 0.0)
        speed = np.abs(R.T @ (after.position - foot.position)) / TICK
        assert np.all(speed <= MAX_SPEED[:2] + 1e-9)
        # The foothold stays within reach, so the next QP does not lose it.
        assert np.all(np.abs(R.T @ (target - after.position)) <= (time_left - TICK) * MAX_SPEED[:2] + 1e-9)
        foot = after
    assert np.allclose(foot.position, target)


def test_the_sole_leaves_and_meets_the_ground_without_speed():
    progress = np.linspace(0.0, 1.0, 1001)
    heights = np.array([swing_height(p, 0.05) for p in progress])
    assert heights.max() == pytest.approx(0.05)
    assert heights[0] == heights[-1] == 0.0
    assert abs(heights[1] - heights[0]) < 1e-8
    assert np.all(heights >= 0.0)
