"""A drag of the robot's body aims a push, and its end gives it."""

import math
import warnings
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.viewer import LIGHT
from app.viewer.scene.drag_push import MAX_FORCE, STIFFNESS, DragPush, on_ground
from app.viewer.scene.link_points import LinkPoints
from app.viewer.scene.scene import Scene
from walkcore import Command, Parameters, Simulation, load_robot


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
@pytest.mark.parametrize("pitch", [0.0, 0.4, 1.5])
def test_drag_across_the_screen_is_a_way_on_the_ground(yaw, pitch):
    heading = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    forward = np.cos(pitch) * heading - np.sin(pitch) * np.array([0.0, 0.0, 1.0])
    right = np.array([heading[1], -heading[0], 0.0])
    down = np.cross(forward, right)
    x, y, z, w = Rotation.from_matrix(np.column_stack([right, down, forward])).as_quat()
    camera = np.array([w, x, y, z])
    assert on_ground(0.3 * right, camera) == pytest.approx(0.3 * right[:2])
    assert on_ground(-0.2 * down, camera) == pytest.approx(0.2 * heading[:2])


class Dragger:
    """Drags by clients whose camera looks along x."""

    def __init__(self, push: DragPush, node: str = "") -> None:
        camera = Rotation.from_matrix(np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])).as_quat()
        self._client = SimpleNamespace(camera=SimpleNamespace(wxyz=np.roll(camera, 1)))
        self.push, self._node = push, node

    def drag(self, phase: str, right: float, up: float, client: int = 1, at: Any = (0.0, 0.0, 0.0)) -> None:
        start, end = tuple(at), tuple(np.add(at, (0.0, -right, up)))
        event: Any = SimpleNamespace(
            phase=phase,
            client_id=client,
            client=self._client,
            target=SimpleNamespace(name=self._node),
            start_position=start,
            end_position=end,
        )
        try:
            self.push.drag(event).send(None)  # it awaits nothing
        except StopIteration:
            pass


@pytest.fixture
def runner():
    robot = load_robot("talos")
    pushes: list[Any] = []
    return SimpleNamespace(robot=robot, pushes=pushes, push=lambda push: pushes.append(robot.check_push(push)))


@pytest.fixture
def dragger(viser_server, runner, monkeypatch):
    monkeypatch.setattr(viser_server, "get_clients", lambda: {1: None, 2: None})
    return Dragger(DragPush(viser_server, runner, []))


def test_end_of_a_drag_pushes_along_it_and_no_harder_than_allowed(dragger, runner):
    dragger.drag("start", 0.0, 0.0)
    dragger.drag("update", 0.2, 0.0)
    assert runner.pushes == [] and dragger.push.aim.impulse == pytest.approx([0.0, -12.0])
    dragger.drag("end", 0.0, 0.3)
    assert runner.pushes[0].impulse == pytest.approx([18.0, 0.0]) and runner.pushes[0].frame == "world"
    dragger.drag("start", 0.0, 0.0)
    dragger.drag("end", 7.0, 0.0)
    assert np.linalg.norm(runner.pushes[1].impulse) == pytest.approx(runner.robot.max_push)
    for angle in np.linspace(0.0, 6.0, 50):  # in no direction is it beyond the limit by a rounding
        dragger.drag("start", 0.0, 0.0)
        dragger.drag("end", 3.0 * np.cos(angle), 3.0 * np.sin(angle))
    assert len(runner.pushes) == 52
    assert dragger.push.aim is None


@pytest.mark.parametrize("end", [(0.0, 0.0), (0.01, 0.03), (np.nan, 0.0), (1e9, 0.0)])
def test_drag_that_goes_back_or_nowhere_gives_nothing(dragger, runner, end):
    dragger.drag("start", 0.0, 0.0)
    dragger.drag("update", 0.4, 0.0)
    dragger.drag("end", *end)
    assert runner.pushes == []


def test_escape_another_client_and_a_lost_browser_give_nothing(dragger, runner, viser_server, monkeypatch):
    dragger.drag("start", 0.3, 0.0)
    dragger.push.cancel()
    dragger.drag("update", 0.3, 0.0)
    dragger.drag("end", 0.3, 0.0)
    dragger.drag("start", 0.3, 0.0)
    dragger.drag("start", 0.3, 0.0, client=2)
    dragger.drag("end", 0.3, 0.0)
    assert runner.pushes == []
    monkeypatch.setattr(viser_server, "get_clients", lambda: {1: None})
    dragger.drag("end", 0.3, 0.0, client=2)
    assert runner.pushes == []


def test_a_camera_on_its_side_gives_no_push_and_no_warning():
    """Right is up there: no direction on the ground."""
    half = math.sqrt(0.5)
    with warnings.catch_warnings(action="error"):
        assert np.isnan(on_ground(np.array([0.0, 1.0, 1.0]), np.array([half, 0.0, -half, 0.0]))).all()


class HeldRobot:
    """Stand-in for a runner with contact physics: stands at rest, and keeps its pushes."""

    def __init__(self) -> None:
        self.robot = load_robot("talos")
        self.pushes: list[Any] = []
        physics = Parameters(plant="mujoco", dynamic_filter=True)
        self._simulation = Simulation(self.robot, physics)
        self.wait(1)

    def wait(self, nb_ticks: int) -> None:
        for _ in range(nb_ticks):
            snapshot = self._simulation.step(Command())
        self.latest = SimpleNamespace(snapshot=snapshot, running=True)

    def push(self, push: Any) -> None:
        self.pushes.append(self.robot.check_push(push))


def test_drag_in_physics_pulls_the_held_link_by_a_spring_until_it_ends(viser_server):
    pytest.importorskip("mujoco", reason="mujoco-core is not installed on this platform")
    runner = HeldRobot()
    scene = Scene(viser_server, runner.robot, LIGHT)
    scene.draw(runner.latest.snapshot, Parameters(), 0.0)
    points = LinkPoints(runner.robot.body, scene.links, lambda: (scene.rotation, scene.origin))
    node = next(name for name, link in scene.links.items() if link == "arm_left_7_joint")
    dragger = Dragger(DragPush(viser_server, runner, scene.draggable, points), node)
    wrist = points.in_scene("arm_left_7_joint", np.array([0.0, 0.0, -0.1]), runner.latest.snapshot)
    dragger.drag("start", 0.0, 0.0, at=wrist)
    dragger.push.pull()
    assert runner.pushes == [] and dragger.push.aim is None
    dragger.drag("update", 0.4, 0.0, at=wrist)
    runner.wait(4)
    dragger.push.pull()
    dragger.push.pull()  # no time has passed
    runner.wait(4)
    dragger.push.pull()
    assert len(runner.pushes) == 2
    push, aim = runner.pushes[-1], dragger.push.aim
    weight = 9.81 * runner.robot.mass
    stiffness = STIFFNESS * weight  # of a robot of size 1
    assert push.link == "arm_left_7_joint" and push.point == pytest.approx([0.0, 0.0, -0.1])
    assert push.duration == pytest.approx(0.02) and push.frame == "world"
    assert aim.force == pytest.approx([0.0, -0.4 * stiffness], abs=0.02 * stiffness)  # it sways by some millimetres
    assert push.impulse == pytest.approx(aim.force * push.duration)
    assert aim.impulse == pytest.approx(sum(push.impulse for push in runner.pushes))
    assert aim.point == pytest.approx(wrist - scene.origin, abs=0.02)
    dragger.drag("update", 5.0, 0.0, at=wrist)
    runner.wait(1)
    dragger.push.pull()
    assert np.hypot(*dragger.push.aim.force) == pytest.approx(MAX_FORCE * weight)
    dragger.drag("end", 0.4, 0.0, at=wrist)
    runner.wait(1)
    dragger.push.pull()
    assert len(runner.pushes) == 3 and dragger.push.aim is None
