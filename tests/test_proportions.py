"""Sizes of what is drawn, in proportion to the robot."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
import viser

from app.viewer.scene.drag_push import spring_force
from app.viewer.scene.frame import LIGHT
from app.viewer.scene.proportions import HEIGHT, Proportions
from app.viewer.scene.pushes import CHEST, arrow_away, arrow_from
from app.viewer.scene.robot_mesh import shared_parts
from app.viewer.scene.scene import WORLD, Scene
from walkcore import Parameters, Simulation, load_robot, robot_names
from walkcore.motion.body_model import load_model
from walkcore.robot import Robot

LEVEL = np.array([0.5, -0.5, 0.5, -0.5])  # a camera that looks along x, with z up


def smaller(robot: Robot, size: float) -> Robot:
    """A point mass of another size and the same density."""
    return replace(robot, body=None, com_height=size * robot.com_height, mass=size**3 * robot.mass)


def length(arrow: np.ndarray) -> float:
    return float(np.linalg.norm(arrow[0, 1] - arrow[0, 0]))


def test_arrows_of_pushes_that_look_alike_are_as_long_for_their_robots():
    one, half = Proportions(1.0, 80.0), Proportions(0.5, 10.0)
    for speed in (0.1, 0.5):  # given to the CoM; a robot half as high walks alike at the root of half the speed
        arrow = arrow_away(np.array([0.0, speed * one.mass]), 1.0, one)
        of_half = arrow_away(np.array([0.0, math.sqrt(0.5) * speed * half.mass]), 0.5, half)
        assert length(of_half) == pytest.approx(0.5 * length(arrow), abs=2e-3)
        assert of_half[0, 0, 1] == pytest.approx(0.5 * arrow[0, 0, 1], abs=2e-3)
    forces = (np.array([0.2 * robot.weight, 0.0]) for robot in (one, half))
    of_one, of_half = (length(arrow_from(force, robot)) for force, robot in zip(forces, (one, half), strict=True))
    assert of_half == pytest.approx(0.5 * of_one, abs=2e-3)


def test_a_drag_of_a_smaller_robot_pulls_with_as_much_of_its_weight():
    one, half = Proportions(1.0, 80.0), Proportions(0.5, 10.0)
    for drag in (0.2, 0.8, 5.0):  # the last one with the strongest force
        strong = spring_force(np.array([0.0, -drag, 0.0]), LEVEL, one)
        weak = spring_force(np.array([0.0, -drag / 2, 0.0]), LEVEL, half)
        assert strong is not None and weak is not None
        assert weak / half.weight == pytest.approx(strong / one.weight)


@pytest.mark.parametrize("name", robot_names())
def test_the_strongest_push_of_a_robot_is_an_arrow_about_as_long_as_its_legs(name):
    robot = load_robot(name)
    arrow = length(arrow_away(np.array([robot.max_push, 0.0]), 1.0, Proportions.of(robot)))
    assert 0.5 * robot.com_height < arrow < 1.4 * robot.com_height


@pytest.mark.parametrize("name", ["talos", "g1", "alexander"])
def test_the_arrow_of_the_lightest_push_lies_outside_the_body(name):
    robot = load_robot(name)
    assert robot.body is not None
    snapshot = Simulation(robot, robot.parameters).step()
    model = load_model(robot.body)
    data = model.createData()
    pin.forwardKinematics(model, data, snapshot.q)
    places = [
        part.vertices @ data.oMi[part.joint].rotation.T + data.oMi[part.joint].translation
        for part in shared_parts(robot.body, LIGHT.face_ratio)
    ]
    from_com = np.vstack(places) - [*snapshot.com.position, CHEST * snapshot.com_height]
    size = Proportions.of(robot).size
    level = from_com[np.abs(from_com[:, 2]) < 0.05 * size]  # the arrow's
    for direction in np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]):
        near_end = arrow_away(0.01 * direction, 0.0, Proportions.of(robot))[0, 0, :2] @ direction
        in_the_way = level[np.abs(level[:, :2] @ direction[::-1]) < 0.05 * size]
        assert near_end > np.max(in_the_way[:, :2] @ direction, initial=0.0)


def test_dots_and_camera_of_a_scene_follow_the_size(viser_server: viser.ViserServer):
    robot = load_robot("hrp2")
    robot = replace(robot, com_height=HEIGHT)
    seen: list[tuple[float, float, float]] = []
    for one in (robot, smaller(robot, 0.5)):
        scene = Scene(viser_server, one, LIGHT)
        scene.draw(Simulation(one, Parameters()).step(), Parameters(), 0.0)
        ball = viser_server.scene.get_handle_by_name(f"{WORLD}/com/mass/ball")
        dot = viser_server.scene.get_handle_by_name(f"{WORLD}/com/dot/face")
        assert ball is not None and dot is not None
        distance = float(np.linalg.norm(viser_server.initial_camera.position))
        seen.append((ball.radius, dot.render_width, distance))
    assert np.array(seen[1]) == pytest.approx(0.5 * np.array(seen[0]))
