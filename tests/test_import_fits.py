"""Values that `walk import` finds by walks, swing moments and fastest references, and those that it guesses."""

import re
from dataclasses import replace

import pytest
import yaml
from test_synthetic_biped import biped, imported

from app.commands.robot_commands import ImportCommand
from walkcore import Command, Reference, Simulation, load_robot
from walkcore.errors import InvalidValueError
from walkcore.robot_import.speed_limits import fastest_references, keeps_limits
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
