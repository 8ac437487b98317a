"""The set that `capture.py` computes is the one from which a step leads back into it, by linear programming."""

import math

import numpy as np
from oracle import edges
from scipy.optimize import linprog

from walkcore import load_robot
from walkcore.mpc.capture import StepTiming, capture_vertices, minkowski_sum
from walkcore.mpc.regions import half_planes
from walkcore.mpc.stance import Side, mirrored, on_side

ROBOT = load_robot("hrp2")
TIMING = StepTiming(0.1, 0.7, math.sqrt(9.81 / ROBOT.com_height))


def a_step_leads_back(xi, on_right):
    """Whether some old CoP, foothold and new CoP bring xi, seen from the right foot, into the left foot's set."""
    a, b = math.exp(TIMING.omega * 0.1), math.exp(TIMING.omega * 0.7)
    rows, bounds = [], []
    for k, corners in enumerate((mirrored(ROBOT.sole), on_side(Side.LEFT, ROBOT.foothold_region), ROBOT.sole)):
        for normal, bound in edges(corners, 0.0):  # of z_old, f and z_new, which are the unknowns
            row = np.zeros(6)
            row[2 * k : 2 * k + 2] = normal
            rows.append(row)
            bounds.append(bound)
    for normal, bound in edges(mirrored(on_right), 0.0):  # xi at the next touchdown, seen from the new foot
        factors = (-b * (a - 1) / 2, -b * (a + 1) / 2, -b * (a - 1) / 2 - (b - 1))
        rows.append(np.concatenate([factor * normal for factor in factors]))
        bounds.append(bound - a * b * normal @ xi)
    return linprog(np.zeros(6), A_ub=rows, b_ub=bounds, bounds=[(None, None)] * 6).status == 0


def test_inside_the_set_a_step_leads_back_into_it_and_outside_none_does():
    on_right = capture_vertices(ROBOT.sole, ROBOT.foothold_region, TIMING)[Side.RIGHT]
    rng, planes = np.random.default_rng(0), half_planes(on_right)
    low, high = on_right.min(axis=0) - 0.1, on_right.max(axis=0) + 0.1
    seen = set()
    for xi in rng.uniform(low, high, size=(200, 2)):
        excess = planes.excess(xi)
        if abs(excess) > 1e-6:
            seen.add(excess < 0.0)
            assert a_step_leads_back(xi, on_right) == (excess < 0.0)
    assert seen == {True, False}


def test_the_sets_of_both_feet_are_mirror_images():
    sets = capture_vertices(ROBOT.sole, ROBOT.foothold_region, TIMING)
    assert np.allclose(mirrored(sets[Side.LEFT]), sets[Side.RIGHT])


def test_the_sum_of_two_boxes_is_the_box_of_the_sums():
    box = np.array([[1.0, 2.0], [-1.0, 2.0], [-1.0, -2.0], [1.0, -2.0]])
    total = minkowski_sum(box, 0.5 * box)
    assert np.allclose(sorted(map(tuple, total)), sorted(map(tuple, 1.5 * box)))
