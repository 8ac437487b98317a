import numpy as np
import pytest

from walkcore import Command, Parameters, Reference, Simulation, load_robot
from walkcore.motion.dynamic_filter import LOOK_AHEAD, NO_OFFSET, SMOOTHING
from walkcore.motion.swing_foot import standing, swing, swing_accelerations, swing_height
from walkcore.mpc.stance import Footstep, Side


def test_planned_accelerations_are_those_of_the_flight():
    tick, duration, speed = 0.001, 0.7, np.array([9.0, 9.0, 9.0])
    foothold = Footstep(Side.LEFT, np.array([0.4, 0.1]), 0.2)
    foot, positions = standing(Footstep(Side.LEFT, np.zeros(2), 0.0)), []
    for k in range(700):
        positions.append(foot.position)
        foot = swing(foot, foothold, duration - k * tick, tick, speed, 0.0, 0.0)
    times = np.arange(700) * tick
    heights = np.array([swing_height(t / duration, 0.05) for t in times])
    start = standing(Footstep(Side.LEFT, np.zeros(2), 0.0))
    of_motion, of_apex = swing_accelerations(0.0, duration, 0.0, times)
    xy, z = of_motion @ [*start.matrix[:, :2], foothold.position], 0.05 * of_apex
    assert np.allclose(np.diff(positions, 2, axis=0) / tick**2, xy[1:-1], atol=0.02)
    assert np.allclose(np.diff(heights, 2) / tick**2, z[1:-1], atol=0.02)


def test_the_offset_solves_its_equation():
    """For e = E cos(w t), known for ever, d - ddd/omega^2 = -e has the bounded solution -e / (1 + (w/omega)^2)."""
    omega, w, E, period = 3.4, 7.85, 0.03, 0.005
    s = np.arange(0.5, 4.0 / 0.002) * 0.002
    offset, seen, expected = NO_OFFSET, [], []
    for k in range(1000):
        t = k * period
        xi = -omega * 0.002 * np.sum(np.exp(-omega * s) * E * np.cos(w * (t + SMOOTHING + s)))
        offset = offset.towards(np.array([xi, 0.0]), omega, period)
        seen.append(offset.position[0])
        expected.append(-E * np.cos(w * (t + period)) / (1 + (w / omega) ** 2))
    assert np.allclose(seen[600:], expected[600:], atol=4e-4)
    assert np.exp(-omega * LOOK_AHEAD) < 0.02


@pytest.mark.parametrize("is_filtered", [False, True])
def test_the_true_cop_stays_within_two_centimetres_of_the_models_with_the_filter(is_filtered):
    """The paper says that the difference is usually less than 2 cm."""
    simulation = Simulation(load_robot("talos"), Parameters(dynamic_filter=is_filtered))
    walk = [simulation.step(Command(Reference(vx=0.3))) for _ in range(1000)]
    distance = [np.linalg.norm(s.true_cop - s.cop) for s in walk]
    offset = max(np.linalg.norm(s.com_offset) for s in walk)
    assert (np.percentile(distance, 95) < 0.02) == is_filtered
    assert offset < (0.012 if is_filtered else 1e-12)
