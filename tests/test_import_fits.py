"""Values that `walk import` finds by walks, swing moments and fastest references, and those that it guesses."""

import re
from dataclasses import replace

import pytest
import yaml
from test_synthetic_biped import biped, imported

from app.commands.robot_commands import ImportCommand
from walkcore import Command, Reference, Simulation, load_robot, robot_names
from walkcore.errors import InvalidValueError
from walkcore.robot_import.measure import measure, robot_mapping
from walkcore.robot_import.speed_limits import fastest_references, foot_speeds, keeps_limits
from walkcore.robot_import.swing_fit import fit_swing_moments


def test_swing_moments_of_a_robot_that_ships_are_found_again():
    robot = load_robot("romeo")
    found = fit_swing_moments(robot, 0.02)
    for name in ("foot", "knee", "com"):
        assert getattr(found.moments, name) == pytest.approx(getattr(robot.swing_moments, name), rel=0.15)
    assert found.unexplained < 0.35 * found.error


def test_references_go_down_until_the_joints_keep_their_speeds(tmp_path):
    robot = imported(tmp_path, 1.0)
    slow = re.sub(r'velocity="12"', 'velocity="2"', (tmp_path / "biped.urdf").read_text(encoding="utf-8"))
    (tmp_path / "biped.urdf").write_text(slow, encoding="utf-8")
    robot = load_robot(tmp_path / "biped.yaml")
    found = dict(fastest_references(replace(robot, max_reference={"vx": robot.max_reference["vx"]})))["vx"]
    guessed = robot.max_reference["vx"]
    assert guessed[0] < found[0] < 0.0 < found[1] < guessed[1]
    assert keeps_limits(robot, Reference(vx=found[1])) and not keeps_limits(robot, Reference(vx=guessed[1]))


def test_an_imported_biped_walks_in_physics_at_the_speed_that_its_size_suggests(tmp_path):
    pytest.importorskip("mujoco", reason="mujoco-core is not installed on this platform")
    (tmp_path / "mine.urdf").write_text(biped(1.0), encoding="utf-8")
    ImportCommand(tmp_path / "mine.urdf", tmp_path / "mine.yaml", picture=False)()
    assert set(yaml.safe_load((tmp_path / "mine.yaml").read_text(encoding="utf-8"))["swing_moments"]) == {
        *("foot", "knee", "com")
    }
    robot = load_robot(tmp_path / "mine.yaml")
    walk = Simulation(robot, robot.parameters.changed({"plant": "mujoco", "dynamic_filter": True}))
    fastest = robot.max_reference["vx"][1]
    for _ in range(1000):
        snapshot = walk.step(Command(Reference(vx=fastest)))
        assert snapshot.status != 2, snapshot.reason
    assert snapshot.plant.measured.com[0] > 0.7 * 5.0 * fastest


def test_a_study_that_is_refused_leaves_a_file_that_says_what_is_guessed(tmp_path):
    (tmp_path / "mine.urdf").write_text(biped(1.0), encoding="utf-8")
    with pytest.raises(InvalidValueError, match="samples = 10: must be at least"):
        ImportCommand(tmp_path / "mine.urdf", tmp_path / "mine.yaml", footholds=True, samples=10)()
    text = (tmp_path / "mine.yaml").read_text(encoding="utf-8")
    assert "a guess from the size, see walk footholds" in text and "found by walk footholds" not in text


def test_a_folder_that_is_not_there_is_refused_at_once(tmp_path):
    (tmp_path / "mine.urdf").write_text("<robot>", encoding="utf-8")
    with pytest.raises(InvalidValueError, match="out = .*must be a file in a folder that is there"):
        ImportCommand(tmp_path / "mine.urdf", tmp_path / "no" / "mine.yaml")()


@pytest.mark.parametrize("name", [name for name in robot_names() if load_robot(name).body is not None])
def test_feet_of_robots_that_ship_are_no_faster_than_their_joints(name):
    robot, allowed = load_robot(name), foot_speeds(load_robot(name))
    assert all(robot.max_foot_speed <= [allowed.forward, allowed.sideways])
    assert robot.max_foot_yaw_rate <= allowed.yaw_rate


@pytest.mark.parametrize(
    ("velocity", "is_lowered", "said"),
    [
        ("12", False, "a guess from the robot's size, within "),
        ("1.0", True, "0.9 of the 0."),
        ("0", False, "a guess from the robot's size, as a joint of the legs has no speed limit"),
    ],
)
def test_an_import_makes_no_foot_faster_than_its_joints(tmp_path, velocity, is_lowered, said):
    urdf = tmp_path / "mine.urdf"
    urdf.write_text(biped(1.0).replace('velocity="12"', f'velocity="{velocity}"'), encoding="utf-8")
    guessed = robot_mapping(measure(urdf, tmp_path), "mine", tmp_path)
    ImportCommand(urdf, tmp_path / "mine.yaml", picture=False)()
    robot, text = load_robot(tmp_path / "mine.yaml"), (tmp_path / "mine.yaml").read_text(encoding="utf-8")
    assert said in text and bool(robot.max_foot_speed[0] < guessed["max_foot_speed"][0]) is is_lowered
    assert (robot.max_foot_yaw_rate < guessed["max_foot_yaw_rate"]) is is_lowered


def test_feet_are_as_much_faster_as_their_joints(tmp_path):
    imported(tmp_path, 1.0)
    text, found = (tmp_path / "biped.urdf").read_text(encoding="utf-8"), []
    for velocity in ("2", "6"):
        (tmp_path / "biped.urdf").write_text(text.replace('velocity="12"', f'velocity="{velocity}"'), encoding="utf-8")
        found.append(foot_speeds(load_robot(tmp_path / "biped.yaml")))
    slow, fast = found
    assert fast.forward == pytest.approx(3.0 * slow.forward) and fast.sideways == pytest.approx(3.0 * slow.sideways)
    assert slow.yaw_rate == pytest.approx(2.0, rel=0.02)  # the hips turn about z
    assert 2.0 * 0.4 < slow.forward < 2.0 * 0.8  # a leg of two links of 0.4 m
