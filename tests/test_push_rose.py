"""The rose of pushes: what the controller says of each push, and the bound around it."""

import math
import multiprocessing
from dataclasses import replace

import numpy as np
import pytest
from conftest import wait_for
from scene_reader import latest

from app.live import push_roses
from app.live.live_state import LiveState
from app.live.push_roses import PushRoses
from app.viewer import LIGHT
from app.viewer.scene.scene import WORLD, Scene
from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.analysis.push_bound import StepClass, largest_impulse
from walkcore.analysis.push_rose import NB_DIRECTIONS, NB_HALVINGS, NB_INTERVALS, PushRose, is_survived, push_rose
from walkcore.mpc.plan import Status

TALOS = replace(load_robot("talos"), body=None)
PARAMETERS = Parameters(step_timing="adaptive", solver="daqp", control_period=0.02)
AHEAD = Reference(vx=0.2, yaw_rate=0.2)
TOLERANCE = TALOS.max_push / NB_INTERVALS / 2**NB_HALVINGS


@pytest.fixture(scope="module")
def walk():
    """A walk in a curve, so that its heading is none of the world's axes."""
    simulation = Simulation(TALOS, PARAMETERS)
    for _ in range(160):
        simulation.step(Command(AHEAD))
    return simulation


def unit(rose, k, heading):
    angle = heading + rose.directions[k]
    return np.array([np.cos(angle), np.sin(angle)])


def test_each_petal_ends_between_a_push_that_the_plan_survives_and_one_that_it_does_not(walk):
    rose = push_rose(walk, AHEAD, nb_directions=4)
    heading, limit = walk.state.model.heading, TALOS.max_com_distance
    assert rose.tick == walk.state.model.tick and abs(heading) > 0.2
    assert min(rose.survived) > 2 * TOLERANCE and max(rose.survived) <= TALOS.max_push
    for k, impulse in enumerate(rose.survived):
        direction = unit(rose, k, heading)
        outcomes = [
            is_survived(walk.preview(Command(AHEAD, Push(strength * direction, frame="world"))), limit)
            for strength in (0.999 * impulse, min(impulse + TOLERANCE, 0.999 * TALOS.max_push))
        ]
        assert outcomes == [True, impulse > TALOS.max_push - TOLERANCE]
        before = walk.preview(Command(AHEAD))
        assert rose.bound[k] == pytest.approx(largest_impulse(before, TALOS, 0.1, direction, StepClass()), abs=1e-6)


def test_what_a_petal_promises_comes_true(walk):
    rose, state = push_rose(walk, AHEAD, nb_directions=4), walk.state
    heading = state.model.heading
    for k, impulse in enumerate(rose.survived):
        walk.restore(state)
        snapshot = walk.step(Command(AHEAD, Push(0.99 * impulse * unit(rose, k, heading), frame="world")))
        for _ in range(200):
            snapshot = walk.step(Command(AHEAD))
        assert snapshot.status is not Status.FALLEN
    walk.restore(state)


def test_no_push_counts_as_survived_that_no_step_can_catch_or_that_needs_longer_legs(walk):
    direction = np.array([0.0, 1.0])
    bound = largest_impulse(walk.preview(Command(AHEAD)), TALOS, 0.1, direction, StepClass())
    lethal, light = (
        walk.preview(Command(AHEAD, Push(impulse * direction, frame="world"))) for impulse in (1.2 * bound, 2.0)
    )
    assert not is_survived(lethal, max_com_distance=math.inf)
    assert is_survived(light, TALOS.max_com_distance) and not is_survived(light, max_com_distance=0.0)


def test_a_robot_that_lies_has_no_rose():
    simulation = Simulation(TALOS, PARAMETERS)
    snapshot = simulation.step(Command(push=Push([0.0, 200.0])))
    while snapshot.status is not Status.FALLEN:
        snapshot = simulation.step()
    assert push_rose(simulation, Reference(), nb_directions=4) is None


class Walking:
    """Stand-in for a control process: a walk that a test takes on."""

    def __init__(self, walk):
        self._walk = walk
        self.step()

    def step(self):
        snapshot = self._walk.step(Command(AHEAD))
        timing = None
        self.latest = LiveState(snapshot, timing, True, "none", next_state=self._walk.state)  # type: ignore[arg-type]


@pytest.fixture
def live(walk, monkeypatch):
    """Roses of a walk whose process goes before nothing."""
    monkeypatch.setattr(push_roses, "NICENESS", 0)
    monkeypatch.setattr(push_roses, "KEPT_FOR", 1e9)
    state, walking = walk.state, Walking(walk)
    roses = PushRoses(walk.robot, lambda: walking.latest, lambda: PARAMETERS)
    yield roses, walking
    roses.stop()
    walk.restore(state)


def test_roses_come_while_they_are_asked_for_of_the_latest_state_and_after_the_death_of_their_process(
    live, monkeypatch
):
    roses, walking = live
    assert roses.latest is None, "nobody has asked"
    roses.request()
    first = walking.latest.next_state.model.tick
    wait_for(lambda: roses.latest is not None)
    assert roses.latest.tick == first
    for process in multiprocessing.active_children():
        if process.name == "walk job":  # and not a worker of sweeps in other tests
            process.kill()
    walking.step()
    wait_for(lambda: roses.latest is not None and roses.latest.tick == first + 1)
    monkeypatch.setattr(push_roses, "KEPT_FOR", 0.0)
    assert roses.latest is None, "nobody asks any more"


def test_the_rose_is_drawn_around_the_robot_in_its_heading_frame_while_there_is_one(walk, viser_server):
    scene = Scene(viser_server, TALOS, LIGHT)
    assert "push_rose" not in scene.shown, "it costs a process"
    scene.show("push_rose", True)
    survived = np.linspace(10.0, 25.0, NB_DIRECTIONS)
    rose = PushRose(0, survived, 1.5 * survived)
    snapshot, node = walk.preview(Command(AHEAD)), f"{WORLD}/push_rose/at_com"
    scene.draw(snapshot, PARAMETERS, 0.03, push_rose=rose)
    assert latest(scene.updates, "visible")[node]
    x, y, _ = latest(scene.updates, "position")[node]
    assert (x, y) == pytest.approx(snapshot.com.position, abs=1e-4)
    w, _, _, z = latest(scene.updates, "wxyz")[node]
    assert 2 * math.atan2(z, w) == pytest.approx(snapshot.heading, abs=1e-4)
    corners = latest(scene.updates, "vertices")[f"{node}/survived"][1:, :2]
    angles = np.unwrap(np.arctan2(corners[:, 1], corners[:, 0]))
    assert angles == pytest.approx(rose.directions, abs=0.01)
    assert np.hypot(*corners.T) / np.hypot(*corners[0]) == pytest.approx(survived / survived[0], abs=0.02)
    edge = latest(scene.updates, "points")[f"{node}/bound"][:, 0, :2]
    assert edge == pytest.approx(1.5 * corners, abs=2e-3)
    assert latest(scene.updates, "text")[f"{node}/weakest"] == "10 of 15 N·s"
    scene.draw(snapshot, PARAMETERS, 0.03)
    assert not latest(scene.updates, "visible")[node]
