"""The bound of survivable pushes, against the linear program of its docstring with every CoP as a variable."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.analysis import push_bound
from walkcore.analysis.push_bound import StepClass, largest_impulses
from walkcore.errors import NoSolutionFoundError
from walkcore.mpc.capture import StepTiming, viable_vertices
from walkcore.mpc.gait import Phase
from walkcore.mpc.regions import half_planes
from walkcore.mpc.stance import mirrored
from walkcore.values import rotation

TALOS = replace(load_robot("talos"), body=None)
T = 0.1
CLASS = StepClass(durations=(0.4, 0.8))
DIRECTIONS = np.array([[math.cos(angle), math.sin(angle)] for angle in (0.3, 2.0, 4.1, 5.5)])


def walked(nb_ticks):
    """The snapshot before the next tick of a walk that turns a little, and that a push has disturbed."""
    simulation = Simulation(TALOS, Parameters(step_timing="adaptive", control_period=0.02, solver="daqp"))
    command = Command(Reference(vx=0.2, vy=0.05, yaw_rate=0.1))
    simulation.step(Command(command.reference, Push([4.0, 6.0])))
    for _ in range(nb_ticks):
        simulation.step(command)
    return simulation.preview(command)


def left_or_right(vertices, side):
    return vertices if side.sign > 0 else mirrored(vertices)


def largest_on_schedule(snapshot, direction, durations):
    """The largest impulse where the step under way ends on schedule, and these durations follow [N s].

    Variables are the impulse, four footholds, then the CoP of each phase: all as the docstring of the bound has them.
    """
    omega, side = snapshot.pendulum.omega, snapshot.support.side
    R = rotation(snapshot.support.yaw)
    swing = (snapshot.feet[side.other].position - snapshot.support.position) @ R
    landing = [side.other, side, side.other, side]
    waiting = snapshot.time_to_touchdown - (snapshot.step_duration - T)  # in a double support
    waiting = waiting if snapshot.phase is Phase.DOUBLE_SUPPORT else 0.0
    flights = [snapshot.time_to_touchdown - waiting, *(duration - T for duration in durations)]
    n = 1 + 8 + 2 * (4 + 8 + 1)
    foot = [np.zeros((2, n)), *(np.eye(2, n, 1 + 2 * k) for k in range(4))]
    cops = [np.eye(2, n, 9 + 2 * i) for i in range(13)]
    rows, uppers = [], []

    def keep(point, offset, vertices):
        planes = half_planes(vertices)
        for normal, low, high in zip(planes.normals, planes.lower, planes.upper, strict=True):
            rows.append(normal @ point)
            uppers.append(high - normal @ offset)
            if np.isfinite(low):
                rows.append(-normal @ point)
                uppers.append(normal @ offset - low)

    xi, known = np.zeros((2, n)), (snapshot.dcm - snapshot.support.position) @ R
    xi[:, 0] = direction @ R / (TALOS.mass * omega)
    e = math.exp(omega * waiting)
    xi, known = e * xi - (e - 1) * cops[12], e * known
    soles = [left_or_right(TALOS.sole, side), swing + left_or_right(TALOS.sole, side.other)]
    keep(cops[12], np.zeros(2), np.vstack(soles))
    a = math.exp(omega * T)
    mean = (a - 1) / (omega * T)
    for k, flight in enumerate(flights):
        e = math.exp(omega * flight)
        single, old, new = cops[3 * k : 3 * k + 3]
        xi = a * (e * xi - (e - 1) * single) - (a - mean) * old - (mean - 1) * new
        known = a * e * known
        sides = [side, *landing]
        for cop, at in ((single, k), (old, k), (new, k + 1)):
            keep(cop - foot[at], np.zeros(2), left_or_right(TALOS.sole, sides[at]))
        region = next(r.vertices for r in TALOS.foothold_regions if r.lowest_yaw <= 0.0 <= r.highest_yaw)
        keep(foot[k + 1] - foot[k], np.zeros(2), left_or_right(region, landing[k]))
        before, there = (foot[0], swing) if k == 0 else (foot[k - 1], np.zeros(2))
        x, y = flight * TALOS.max_foot_speed
        keep(foot[k + 1] - before, -there, np.array([[x, y], [-x, y], [-x, -y], [x, -y]]))
    shortest = StepTiming(T, CLASS.durations[0] - T, omega)
    keep(xi - foot[4], known, viable_vertices(TALOS.sole, 0.0, TALOS.foothold_region, shortest)[side][-1])
    bounds = [(0.0, None)] + [(None, None)] * (n - 1)
    found = linprog(-np.eye(1, n)[0], A_ub=np.vstack(rows), b_ub=np.array(uppers), bounds=bounds)
    return found.x[0] if found.status == 0 else 0.0


@pytest.mark.parametrize(("nb_ticks", "phase"), [(112, Phase.SINGLE_SUPPORT), (121, Phase.DOUBLE_SUPPORT)])
def test_the_bound_is_that_of_the_program_with_every_cop(nb_ticks, phase):
    before = walked(nb_ticks)
    assert before.phase is phase
    steps = StepClass(durations=CLASS.durations, is_adaptive=False)
    found = largest_impulses(before, TALOS, T, DIRECTIONS, steps)
    for direction, bound in zip(DIRECTIONS, found, strict=True):
        choices = [(second, third, 0.4) for second in steps.durations for third in steps.durations]
        assert bound == pytest.approx(max(largest_on_schedule(before, direction, times) for times in choices), abs=1e-6)


@pytest.mark.parametrize("nb_ticks", [0, 112])  # standing, in single support
def test_no_times_that_are_left_out_would_allow_more(nb_ticks, monkeypatch):
    before = walked(nb_ticks)
    found = largest_impulses(before, TALOS, T, DIRECTIONS[:1], CLASS)
    tried = push_bound._Program.maximum
    nb_tried = []

    def counted(*arguments):
        nb_tried.append(tried(*arguments))
        return nb_tried[-1]

    monkeypatch.setattr(push_bound._Program, "maximum", counted)
    monkeypatch.setattr(push_bound._Ground, "bounds_without_reach", lambda *_: np.full(1, np.inf))
    assert found == pytest.approx(largest_impulses(before, TALOS, T, DIRECTIONS[:1], CLASS), abs=1e-6)
    assert len(nb_tried) > 30


def test_what_one_direction_says_of_the_others_takes_nothing_from_them():
    before = walked(112)
    angles = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    alone = [largest_impulses(before, TALOS, T, direction[None], CLASS)[0] for direction in directions]
    assert largest_impulses(before, TALOS, T, directions, CLASS) == pytest.approx(alone, abs=1e-6)


class StallingSolver(push_bound.InteriorPointSolver):
    """Gets no nearer to its tolerance than PIQP may, by rounding, in every second program."""

    nb_solved = 0

    def solve(self, *args, **options):
        self.nb_solved += 1
        if self.nb_solved % 2:
            raise NoSolutionFoundError("no solution (PIQP_MAX_ITER_REACHED)")
        return super().solve(*args, **options)


def test_a_solver_that_stalls_makes_no_bound_too_low(monkeypatch):
    snapshot = walked(30)
    exact = largest_impulses(snapshot, TALOS, T, DIRECTIONS, CLASS)
    monkeypatch.setattr(push_bound, "InteriorPointSolver", StallingSolver)
    stalled = largest_impulses(snapshot, TALOS, T, DIRECTIONS, CLASS)
    assert np.all(stalled > exact - 1e-6) and np.all(exact > 1.0)
