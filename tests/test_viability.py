"""Viable states of the DCM with the flight of the foot in the air, against linear programming and against walks."""

import math
from dataclasses import replace

import numpy as np
import pytest
from oracle import edges
from scipy.optimize import linprog

from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.mpc.capture import StepTiming, viable_vertices
from walkcore.mpc.gait import Phase
from walkcore.mpc.lipm import Pendulum
from walkcore.mpc.plan import Status
from walkcore.mpc.regions import inset_vertices
from walkcore.mpc.stance import Footstep, Side, mirrored, on_side
from walkcore.mpc.viability import Allowance, Landings, Outline, ViableSets

TALOS = replace(load_robot("talos"), body=None)
OMEGA = Pendulum(TALOS.com_height).omega
MARGIN, T, STEP = 0.03, 0.1, 0.6


def region_of_left_foot():
    straight = next(region for region in TALOS.foothold_regions if region.lowest_yaw <= 0.0 <= region.highest_yaw)
    return on_side(Side.LEFT, straight.vertices)


def test_the_reachable_part_of_a_region_is_found_by_linear_programming_too():
    region, rng = region_of_left_foot(), np.random.default_rng(0)
    rows, bounds = zip(*edges(region, 0.0), strict=True)
    seen = set()
    for _ in range(150):
        foot, reach, normal = rng.uniform([-0.6, 0.0], [0.6, 0.7]), rng.uniform(0.01, 0.5, 2), rng.normal(size=2)
        box = [(foot[i] - reach[i], foot[i] + reach[i]) for i in (0, 1)]
        found = linprog(-normal, A_ub=rows, b_ub=bounds, bounds=box)
        support = Outline(region).support_within(foot, reach[None], normal[None])[0, 0]
        seen.add(found.status)
        assert support == -math.inf if found.status == 2 else support == pytest.approx(-found.fun, abs=1e-9)
    assert seen == {0, 2}


def can_be_caught(xi, z, swing, landing):
    """Whether CoPs and a foothold within reach bring xi, seen from the right foot, into the set of the left foot."""
    to_sample, to_touchdown, in_air = landing
    a, e = math.exp(OMEGA * T), math.exp(OMEGA * to_touchdown)
    kappa = 1 - (1 - math.exp(-OMEGA * to_sample)) / (OMEGA * to_sample)
    sole = inset_vertices(TALOS.sole, MARGIN)
    timing = StepTiming(T, STEP - T, OMEGA)
    after = viable_vertices(TALOS.sole, MARGIN, TALOS.foothold_region, timing)[Side.LEFT][-1]
    reach = swing + in_air * TALOS.max_foot_speed * [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    rows, bounds = [], []

    def keep(blocks, known, corners):
        for normal, bound in edges(corners, 0.0):  # of (mean CoP, CoP at touchdown, foothold, CoP from the foothold)
            rows.append(np.concatenate([factor * normal for factor in blocks]))
            bounds.append(bound - normal @ known)

    for k, corners in enumerate((mirrored(sole), mirrored(sole), region_of_left_foot(), sole)):
        keep(np.eye(4)[k], np.zeros(2), corners)
    keep(np.eye(4)[2], np.zeros(2), reach)
    mean = e * (1 - 1 / e - kappa)
    known = a * e * (xi - kappa * z)
    keep([-a * mean, -(a - 1) / 2, -(a - 1) / 2 - 1, -(a - 1) / 2], known, after)
    return linprog(np.zeros(8), A_ub=rows, b_ub=bounds, bounds=[(None, None)] * 8).status == 0


def test_the_margin_is_positive_where_steps_can_catch_the_robot_and_negative_elsewhere():
    sets = ViableSets(TALOS, (Allowance(MARGIN),), (STEP,), T, OMEGA)
    rng, seen = np.random.default_rng(1), []
    for _ in range(60):
        xi, z = rng.uniform([-0.3, -0.15], [0.3, 0.3]), rng.uniform([-0.1, -0.05], [0.1, 0.05])
        swing, to_touchdown = rng.uniform([-0.3, 0.16], [0.3, 0.4]), rng.uniform(0.1, 0.6)
        landing = (rng.uniform(0.01, 0.1), to_touchdown, to_touchdown)
        support, foot = Footstep(Side.RIGHT, np.zeros(2), 0.0), Footstep(Side.LEFT, swing, 0.0)
        margin = sets.margins(support, foot, 0.0, xi, z, Landings(*(np.array([time]) for time in landing)))[0, 0, 0]
        if abs(margin) > 1e-6:
            seen.append(margin > 0.0)
            assert can_be_caught(xi, z, swing, landing) == (margin > 0.0)
    assert 10 < sum(seen) < len(seen) - 10


def test_the_set_is_the_same_wherever_the_robot_stands_and_looks():
    sets = ViableSets(TALOS, (Allowance(MARGIN), Allowance(0.0, 0.6)), (STEP, 0.4), T, OMEGA)
    landings = Landings(np.full(3, 0.05), np.array([0.1, 0.3, 0.5]), np.array([0.1, 0.3, 0.5]))
    points = np.array([[0.0, 0.0], [-0.2, 0.2], [0.05, 0.08], [0.02, 0.01]])  # support, swing, DCM, CoP

    def margins(place, yaw):
        c, s = math.cos(yaw), math.sin(yaw)
        support, swing, dcm, cop = place + points @ np.array([[c, s], [-s, c]])
        feet = Footstep(Side.RIGHT, support, yaw), Footstep(Side.LEFT, swing, yaw)
        return sets.margins(*feet, yaw, dcm, cop, landings)

    assert margins(np.array([3.0, -2.0]), 0.7) == pytest.approx(margins(np.zeros(2), 0.0), abs=1e-9)


def walking(parameters, reference, seconds):
    """A walk just after a touchdown, at least so long after its beginning."""
    simulation = Simulation(TALOS, parameters)
    before = simulation.step(Command(reference))
    while before.t < seconds or not (
        before.phase is Phase.SINGLE_SUPPORT and simulation.preview(Command(reference)).phase is Phase.DOUBLE_SUPPORT
    ):
        before = simulation.step(Command(reference))
    return simulation


@pytest.mark.parametrize(("into_step", "impulse"), [(0.64, 56.0), (0.68, 52.0), (0.72, 48.0)])
def test_a_push_is_not_taken_for_harmless_because_of_a_foothold_that_is_out_of_reach(into_step, impulse):
    simulation = walking(Parameters(stepping_in_place=True, control_period=0.02), Reference(), 3.0)
    for _ in range(round(into_step / 0.02)):
        simulation.step()
    pushed = [simulation.step(Command(push=Push([0.0, impulse])))]
    pushed += [simulation.step() for _ in range(100)]
    assert pushed[-1].status is Status.FALLEN
    assert pushed[0].status is not Status.SOLVED


def test_the_rest_of_a_double_support_is_no_time_to_fly():
    parameters = Parameters(stepping_in_place=True, step_duration=0.4, control_period=0.02)
    simulation = walking(parameters, Reference(), 3.0)
    state, limits = simulation.state, 0.3 * TALOS.max_foot_speed + 1e-6
    farthest = np.zeros(2)
    for angle in np.arange(0.0, 2 * math.pi, math.pi / 8):
        for impulse in (20.0, 30.0, 40.0):
            simulation.restore(state)
            push = Push([impulse * math.cos(angle), impulse * math.sin(angle)])
            snapshot = simulation.step(Command(push=push))
            if snapshot.plan is not None:
                swing = snapshot.feet[snapshot.support.side.other]
                farthest = np.maximum(farthest, np.abs(snapshot.plan.footholds[0].position - swing.position))
    assert np.all(farthest <= limits) and np.any(farthest > 0.9 * limits)
