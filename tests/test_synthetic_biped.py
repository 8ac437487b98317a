"""A robot that nobody built walks by its file alone: bipeds of boxes, generated as URDFs of any size."""

import ast
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import viser
import yaml
from conftest import walk

from app import robot_picture
from app.robot_files import robot_text
from app.viewer.scene.frame import LIGHT
from app.viewer.scene.scene import WORLD, Scene
from walkcore import Command, Push, Reference, Simulation, load_robot, robot_names
from walkcore.errors import InvalidValueError
from walkcore.footholds.collisions import LegDistances
from walkcore.motion.body_model import load_model
from walkcore.robot import Robot
from walkcore.robot_import.findings import findings
from walkcore.robot_import.measure import measure, robot_mapping

ROOT = Path(__file__).parent.parent

LINK = """
  <link name="{name}">
    <inertial><origin xyz="{x} 0 {z}"/><mass value="{mass}"/>
      <inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>
    {shapes}
  </link>"""
SHAPE = '<{kind}><origin xyz="{x} 0 {z}"/><geometry><box size="{a} {b} {c}"/></geometry></{kind}>'
JOINT = """
  <joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>
    <axis xyz="{axis}"/><limit lower="{low}" upper="{high}" effort="{effort}" velocity="12"/></joint>"""


def link(name: str, mass: float, size: tuple[float, float, float], x: float = 0.0, z: float = 0.0) -> str:
    """A box about (x, 0, z) of the link's frame [kg], [m]."""
    a, b, c = size
    shapes = "".join(SHAPE.format(kind=kind, x=x, z=z, a=a, b=b, c=c) for kind in ("visual", "collision"))
    ixx, iyy, izz = (mass / 12 * (p * p + q * q) for p, q in ((b, c), (a, c), (a, b)))
    return LINK.format(name=name, mass=mass, x=x, z=z, ixx=ixx, iyy=iyy, izz=izz, shapes=shapes)


def biped(size: float) -> str:
    """URDF of a biped whose hips are 0.8 m over the ground at size 1, where it has 50 kg."""
    m, density = size, size**3  # lengths, masses
    parts = [link("trunk", 26 * density, (0.16 * m, 0.26 * m, 0.5 * m), z=0.25 * m)]
    crossing = (0.04 * m, 0.04 * m, 0.04 * m)
    for side, sign in (("left", 1), ("right", -1)):
        hip, effort = f"0 {sign * 0.09 * m} 0", 400 * density * m
        chain = [  # name, axis, place, limits, link's mass, size, middle
            ("hip_yaw", "0 0 1", hip, (-1.0, 1.0), 1.0, crossing, (0.0, 0.0)),
            ("hip_roll", "1 0 0", "0 0 0", (-0.7, 0.7), 1.0, crossing, (0.0, 0.0)),
            ("hip_pitch", "0 1 0", "0 0 0", (-2.0, 1.0), 5.0, (0.1 * m, 0.1 * m, 0.3 * m), (0.0, -0.2 * m)),
            ("knee", "0 1 0", f"0 0 {-0.4 * m}", (-0.05, 2.4), 3.0, (0.08 * m, 0.08 * m, 0.3 * m), (0.0, -0.2 * m)),
            ("ankle_pitch", "0 1 0", f"0 0 {-0.4 * m}", (-1.2, 0.9), 0.5, crossing, (0.0, 0.0)),
            ("ankle_roll", "1 0 0", "0 0 0", (-0.6, 0.6), 1.5, (0.2 * m, 0.1 * m, 0.03 * m), (0.02 * m, -0.065 * m)),
        ]  # fmt: skip
        parent = "trunk"
        for name, axis, place, (low, high), mass, box, (x, z) in chain:
            child = f"{side}_{name}_link"
            values = {"name": f"{side}_{name}", "parent": parent, "child": child, "xyz": place, "axis": axis}
            parts += [link(child, mass * density, box, x, z), JOINT.format(**values, low=low, high=high, effort=effort)]
            parent = child
    return f'<robot name="biped">{"".join(parts)}\n</robot>'


def imported(folder: Path, size: float) -> Robot:
    """The robot of a file that `walk import` would write."""
    urdf, out = folder / "biped.urdf", folder / "biped.yaml"
    urdf.write_text(biped(size), encoding="utf-8")
    values = robot_mapping(measure(urdf, folder), "biped", folder)
    out.write_text(robot_text(values, urdf.name), encoding="utf-8")
    return load_robot(out)


@pytest.mark.parametrize("size", [0.35, 1.0, 1.5])
def test_a_biped_of_any_size_walks_turns_stops_and_takes_a_push_as_imported(tmp_path, size):
    robot = imported(tmp_path, size)
    assert list(findings(measure(tmp_path / "biped.urdf", tmp_path), robot)) == []
    simulation = Simulation(robot, robot.parameters.changed({"dynamic_filter": True, "step_timing": "adaptive"}))
    fastest, turn = robot.max_reference["vx"][1], robot.max_reference["yaw_rate"][1]
    push = Push([0.0, 0.1 * robot.max_push])
    for reference in (Reference(vx=fastest), Reference(vx=fastest / 2, yaw_rate=turn), Reference()):
        for k in range(800):
            is_pushed = k == 300 and reference != Reference()
            snapshot = simulation.step(Command(reference, push if is_pushed else None))
            assert snapshot.status.name != "FALLEN", snapshot.reason
            com = np.array([*(snapshot.com.position + snapshot.com_offset), snapshot.com_height])
            assert max(simulation.body.errors(snapshot.q, com, snapshot.feet)) < 1e-3
    assert snapshot.phase.name == "STANDING" and np.hypot(*snapshot.com.position) > 2.0 * fastest
    assert np.hypot(*snapshot.com.velocity) < 0.02


def test_it_is_drawn_by_its_boxes(tmp_path, viser_server: viser.ViserServer):
    robot = imported(tmp_path, 0.35)
    scene = Scene(viser_server, robot, LIGHT)
    scene.draw(Simulation(robot).step(), robot.parameters, 0.0)
    assert len(scene.links) == 13 and all(name.startswith(f"{WORLD}/robot") for name in scene.links)


def names_in_code() -> dict[str, set[str]]:
    """Names of shipped robots that stand in the code as text of their own, by file."""
    found: dict[str, set[str]] = {}
    for path in [*ROOT.glob("app/**/*.py"), *ROOT.glob("walkcore/**/*.py")]:
        nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        texts = {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}
        found[str(path.relative_to(ROOT))] = texts & set(robot_names())
    for path in ROOT.glob("static/*"):
        words = set(re.findall(r"\w+", path.read_text(encoding="utf-8").lower()))
        found[str(path.relative_to(ROOT))] = words & set(robot_names())
    return {name: names for name, names in found.items() if names}


def test_no_robot_is_named_in_the_code_but_the_default_one():
    assert names_in_code() == {"walkcore/robot_file.py": {"talos"}}


def test_files_that_ship_name_their_robot_as_they_are_named():
    for path in ROOT.glob("walkcore/robots/*.yaml"):
        assert yaml.safe_load(path.read_text(encoding="utf-8"))["name"] == path.stem


SRDF = """<robot name="biped">
  <group_state name="{name}" group="all">
    <joint name="root_joint" value="0 0 0.7 0 0 0 1"/>
    {joints}
  </group_state>
  <disable_collisions link1="left_hip_pitch_link" link2="right_hip_pitch_link" reason="Never"/>
</robot>"""


def write_srdf(folder: Path, name: str = "half_sitting", **angles: float) -> Path:
    """An SRDF with a posture of bent knees, with some angles changed [rad]."""
    bent = {"hip_pitch": -0.4, "knee": 0.8, "ankle_pitch": -0.4}
    joints = {f"{side}_{joint}": angle for side in ("left", "right") for joint, angle in bent.items()} | angles
    text = "".join(f'<joint name="{joint}" value="{angle}"/>' for joint, angle in joints.items())
    path = folder / "biped.srdf"
    path.write_text(SRDF.format(name=name, joints=text), encoding="utf-8")
    return path


def test_the_posture_of_an_srdf_is_taken_and_its_disabled_collisions_are_left_out(tmp_path):
    robot = imported(tmp_path, 1.0)
    urdf, srdf = tmp_path / "biped.urdf", write_srdf(tmp_path)
    measured = measure(urdf, tmp_path, srdf=srdf)
    values = robot_mapping(measured, "biped", tmp_path)
    assert values["body"]["srdf"] == "biped.srdf" and "posture_angles" not in values["body"]
    (tmp_path / "own.yaml").write_text(robot_text(values, urdf.name), encoding="utf-8")
    own = load_robot(tmp_path / "own.yaml")
    assert own.com_height < robot.com_height - 0.005, "its knees are bent more than an import bends them"
    models = [load_model(body) for body in (robot.body, own.body)]
    pairs = [len(LegDistances(r.body, m).distances(pin.neutral(m))) for r, m in zip((robot, own), models, strict=True)]
    assert pairs == [16, 15]
    simulation = Simulation(own)
    for _ in range(300):
        assert simulation.step(Command(Reference(vx=0.1))).status.name == "SOLVED"


@pytest.mark.parametrize(
    ("name", "angles", "words"),
    [
        ("standing", {}, "must be one of the SRDF: standing"),
        ("half_sitting", {"left_ankle_pitch": -0.3}, "left one is tilted by 0.10 rad"),
        (
            "half_sitting",
            {"right_hip_pitch": 0.0, "right_knee": 0.0, "right_ankle_pitch": 0.0},
            "right one is straight",
        ),
    ],
)
def test_a_posture_from_which_no_robot_walks_is_refused(tmp_path, name, angles, words):
    imported(tmp_path, 1.0)
    with pytest.raises(InvalidValueError, match=words):
        measure(tmp_path / "biped.urdf", tmp_path, srdf=write_srdf(tmp_path, name, **angles))


def test_an_import_draws_the_robot_and_tells_what_it_looks_at(tmp_path):
    (tmp_path / "biped.urdf").write_text(biped(1.0), encoding="utf-8")
    said = walk("import", tmp_path / "biped.urdf", "--out", tmp_path / "mine.yaml")
    assert said.returncode == 0 and "... picture" in said.stderr
    assert (tmp_path / "mine.png").read_bytes().startswith(b"\x89PNG")
    drawn = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(robot_picture, "_draw_hull", lambda _, points: drawn.append(points))
        robot_picture.draw_robot(load_robot(tmp_path / "mine.yaml"), tmp_path / "again.png")
    front, left, above = (np.vstack(drawn[13 * i : 13 * (i + 1)]) for i in range(3))
    assert np.ptp(front[:, 1]) == pytest.approx(np.ptp(left[:, 1])) and front[:, 1].min() == pytest.approx(
        0.0, abs=1e-3
    )
    assert np.ptp(front[:, 0]) == pytest.approx(0.28) and np.ptp(above[:, 0]) == pytest.approx(0.28)
    assert np.allclose(np.ptp(left[:, 0]), np.ptp(above[:, 1]))


@pytest.mark.exhaustive
def test_an_import_with_footholds_has_the_regions_of_its_study(tmp_path):
    (tmp_path / "biped.urdf").write_text(biped(1.0), encoding="utf-8")
    out = tmp_path / "mine.yaml"
    said = walk("import", tmp_path / "biped.urdf", "--out", out, "--footholds", "--samples", 250)
    assert said.returncode == 0, said.stderr
    regions = load_robot(out).foothold_regions
    assert len(regions) == 5 and np.ptp(regions[1].vertices[:, 0]) > 0.4
    assert "walk footholds" in out.read_text(encoding="utf-8")
    assert (tmp_path / "mine-footholds" / "footholds.svg").exists()
