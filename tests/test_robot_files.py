"""Robots from files: what is refused, and what an imported URDF becomes."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml
from conftest import walk

from app.live.plant_choice import suitable_plant
from app.viewer.scene.robot_mesh import body_parts, drawn_height
from walkcore import Command, Reference, Simulation, load_robot, robot_names
from walkcore.errors import InvalidValueError
from walkcore.motion.body_model import load_model
from walkcore.mpc.stance import Side
from walkcore.named_files import shipped_files
from walkcore.robot_file import DEFAULT_ROBOT, robot_from_mapping
from walkcore.robot_import.findings import findings
from walkcore.robot_import.legs import find_legs
from walkcore.robot_import.measure import measure, robot_mapping

G1 = load_robot("g1")
FILE = Path(str(shipped_files("robots")["hrp2"]))
BODY = {"urdf": FILE.name, "left_sole": "l", "right_sole": "r", "torso": "t"}
OTHERS_WITH_A_BODY = [
    name for name in robot_names() if name != DEFAULT_ROBOT and load_robot(name).body is not None
]  # the default one has test files of its own


def hrp2(**changes):
    return yaml.safe_load(FILE.read_text()) | changes


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"mass": -1.0}, "robot.mass"),
        ({"mass": "heavy"}, "robot.mass"),
        ({"com_height": math.nan}, "robot.com_height"),
        ({"name": "../hrp2"}, "robot.name"),
        ({"sole": [[0.1, 0.0], [-0.1, 0.0], [0.0, 0.0]]}, "robot.sole"),
        ({"sole": [[0.1, 0.0], [-0.1]]}, "robot.sole[1]"),
        ({"foothold_regions": []}, "robot.foothold_regions"),
        ({"foothold_regions": [{"yaw": [0.1, -0.1], "region": []}]}, "robot.foothold_regions[0].yaw"),
        ({"max_reference": {"vx": [0.1, 0.3], "vy": [0, 0], "yaw_rate": [0, 0]}}, "robot.max_reference.vx"),
        ({"max_reference": {"vx": [0.0, 0.3]}}, "robot.max_reference.vy"),
        ({"gait": {"cop_margin": 9.0}}, "robot.gait.cop_margin"),
        ({"gait": {"scheme": "full"}}, "robot.gait.scheme"),
        ({"wheels": 2}, "robot.wheels"),
        ({"body": {"urdf": "no.urdf", "left_sole": "l", "right_sole": "r", "torso": "t"}}, "robot.body.urdf"),
        ({"body": {"urdf": "no.urdf"}}, "robot.body.left_sole"),
        ({"body": BODY | {"replaced_limits": {"knee": {"velocity": 1.0}}}}, "robot.body.replaced_limits.knee.source"),
        ({"body": BODY | {"replaced_limits": {"knee": {"velocity": 0.0, "source": "a sheet"}}}},
         "robot.body.replaced_limits.knee.velocity"),
        ({"body": BODY | {"replaced_limits": {"knee": {"speed": 1.0, "source": "a sheet"}}}},
         "robot.body.replaced_limits.knee.speed"),
        ({"body": BODY | {"replaced_limits": {"knee": {"source": "a sheet"}}}}, "robot.body.replaced_limits.knee"),
        ({"body": {"package": "no-such-wheel", "urdf": "u", "left_sole": "l", "right_sole": "r", "torso": "t"}},
         "robot.body.package"),
    ],
)  # fmt: skip
def test_a_bad_field_is_refused_by_name(changes, field):
    with pytest.raises(InvalidValueError) as refusal:
        robot_from_mapping(hrp2(**changes), FILE)
    assert refusal.value.field == field


def test_a_field_that_is_missing_is_named():
    values = hrp2()
    del values["max_push"]
    with pytest.raises(InvalidValueError, match=r"robot\.max_push"):
        robot_from_mapping(values, FILE)


def test_a_robot_file_by_path_walks_like_the_one_that_ships(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(FILE.read_text())
    robots = load_robot(path), load_robot("hrp2")
    assert robots[0].source == str(path) and load_robot(robots[0].source).mass == 56.0
    walks = [Simulation(robot) for robot in robots]
    for _ in range(300):
        mine, shipped = (walk.step(Command(Reference(vx=0.2))) for walk in walks)
    assert np.array_equal(mine.com.matrix, shipped.com.matrix) and mine.com.velocity[0] > 0.05


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"torso": "no_link"}, "robot.body.torso"),
        ({"left_sole": "no_link"}, "robot.body.left_sole"),
        ({"posture_angles": {"no_joint": 0.1}}, "robot.body.posture_angles"),
        ({"fixed_joints": ["no_joint"]}, "robot.body.fixed_joints"),
        ({"replaced_limits": {"no_joint": {"effort": 9.0, "source": "a sheet"}}}, "robot.body.replaced_limits"),
    ],
)
def test_names_that_the_urdf_does_not_have_are_refused(change, field):
    values = yaml.safe_load(shipped_files("robots")["g1"].read_text())
    robot = robot_from_mapping(values | {"body": values["body"] | change}, Path(str(shipped_files("robots")["g1"])))
    assert robot.body is not None
    with pytest.raises(InvalidValueError) as refusal:
        load_model(robot.body)
    assert refusal.value.field == field


def test_joints_that_are_held_fast_keep_their_angle_and_leave_the_configuration():
    values = yaml.safe_load(shipped_files("robots")["g1"].read_text())
    fixed = {"fixed_joints": ["left_elbow_joint", "right_elbow_joint"]}
    file = Path(str(shipped_files("robots")["g1"]))
    whole, less = (robot_from_mapping(values | {"body": values["body"] | more}, file) for more in ({}, fixed))
    models = [load_model(robot.body) for robot in (whole, less)]
    assert models[1].nq == models[0].nq - 2 and not models[1].existJointName("left_elbow_joint")
    places = []
    for model in models:
        data = model.createData()
        pin.framesForwardKinematics(model, data, model.referenceConfigurations["posture"])
        places.append(data.oMf[model.getFrameId("left_wrist_yaw_link")].translation.copy())
    assert np.allclose(*places, atol=1e-12)


def test_limits_with_a_better_source_replace_those_of_the_urdf_and_no_others():
    body = load_robot("romeo").body
    assert body is not None
    ours, urdf = (load_model(replace(body, replaced_limits=limits)) for limits in (body.replaced_limits, ()))
    names = list(ours.names)[2:]
    for limit in ("velocityLimit", "effortLimit"):
        differ = getattr(ours, limit)[6:] != getattr(urdf, limit)[6:]
        assert [name for name, other in zip(names, differ, strict=True) if other] == ["LHipYaw", "RHipYaw"]
    assert ours.velocityLimit[6] == 1.045 and ours.effortLimit[6] == 25.42


@pytest.mark.parametrize("name", OTHERS_WITH_A_BODY)
def test_every_robot_that_ships_keeps_its_promises_on_a_walk(name):
    robot = load_robot(name)
    walk = Simulation(robot)
    assert abs(walk.body.mass - robot.mass) < 1e-3
    fastest, turn = robot.max_reference["vx"][1], robot.max_reference["yaw_rate"][1]
    q, period = None, walk.parameters.control_period
    for reference in (Reference(vx=fastest), Reference(vx=fastest / 2, yaw_rate=turn), Reference()):
        for _ in range(500):
            snapshot = walk.step(Command(reference))
            assert snapshot.status == 0, snapshot.reason
            com = np.array([*snapshot.com.position, snapshot.com_height])
            assert max(walk.body.errors(snapshot.q, com, snapshot.feet)) < 1e-3
            assert q is None or np.all(np.abs(snapshot.q - q)[7:] <= walk.body.max_speeds * period)
            q = snapshot.q
    assert snapshot.com.position[0] > 0.5 * fastest


@pytest.mark.parametrize("name", OTHERS_WITH_A_BODY)
def test_every_robot_with_a_body_walks_in_physics(name):
    pytest.importorskip("mujoco", reason="mujoco-core is not installed on this platform")
    robot = load_robot(name)
    walk = Simulation(robot, robot.parameters.changed({"plant": "mujoco", "dynamic_filter": True}))
    for _ in range(1200):
        snapshot = walk.step(Command(Reference(vx=robot.max_reference["vx"][1])))
        assert snapshot.status != 2, snapshot.reason
    assert snapshot.plant.measured.com[0] > 0.7 * 1200 * 0.005 * robot.max_reference["vx"][1]


def imported(tmp_path, urdf=G1.body.urdf):
    measured = measure(urdf, G1.body.package_folder)
    return measured, robot_from_mapping(robot_mapping(measured, "mine", tmp_path), tmp_path / "mine.yaml")


def test_an_imported_robot_has_the_measures_of_the_one_that_ships_and_walks(tmp_path):
    measured, robot = imported(tmp_path)
    assert [leg.side for leg in measured.legs] == [Side.LEFT, Side.RIGHT]
    assert abs(robot.mass - G1.mass) < 1e-3 and abs(robot.com_height - G1.com_height) < 0.03
    assert measured.torso == "torso_link" and list(findings(measured, robot)) == []
    walk = Simulation(robot)
    for _ in range(500):
        snapshot = walk.step(Command(Reference(vx=0.15)))
        assert snapshot.status == 0, snapshot.reason
    assert snapshot.com.position[0] > 0.1


def changed_urdf(tmp_path, *changes):
    text = G1.body.urdf.read_text()
    for before, after in changes:
        assert before in text
        text = text.replace(before, after, 1)
    file = tmp_path / "changed.urdf"
    file.write_text(text)
    return file


def test_findings_name_what_is_wrong_in_a_urdf(tmp_path):
    lighter = ('<mass value="0.608"/>', '<mass value="0.408"/>')
    weak = ('effort="35"', 'effort="0.5"')
    told = " ".join(findings(*imported(tmp_path, changed_urdf(tmp_path, lighter, weak))))
    assert "left_ankle_roll_joint and right_ankle_roll_joint weigh 0.408 and 0.608 kg" in told
    assert "left_ankle_pitch_joint takes" in told and "of 0.5 N m to stand" in told


def robots_of_the_wheel() -> Path:
    return G1.body.urdf.parents[2]


def test_a_quadruped_is_refused_with_its_legs():
    urdf = robots_of_the_wheel() / "hyq_description/robots/hyq_no_sensors.urdf"
    with pytest.raises(InvalidValueError, match="4 .*must be two: only bipeds"):
        measure(urdf, G1.body.package_folder)


def test_a_robot_that_faces_backward_is_turned_around(tmp_path):
    urdf = robots_of_the_wheel() / "icub_description/robots/icub.urdf"
    measured, robot = imported(tmp_path, urdf)
    assert all(measured.model.names[leg.foot].startswith(side) for leg, side in zip(measured.legs, "lr", strict=True))
    walk = Simulation(robot)
    for _ in range(400):
        snapshot = walk.step(Command(Reference(vx=0.1)))
        assert snapshot.status == 0, snapshot.reason
    assert snapshot.com.position[0] > 0.03
    assert np.max(np.abs(snapshot.q[7:] - walk.body.posture[7:])) < 0.8  # no leg is twisted


def test_a_body_that_physics_does_not_know_is_refused_with_its_reason(tmp_path):
    pytest.importorskip("mujoco", reason="mujoco-core is not installed on this platform")
    _, robot = imported(tmp_path, robots_of_the_wheel() / "icub_description/robots/icub.urdf")
    with pytest.raises(InvalidValueError, match="inertia must have positive eigenvalues.*r_hip_pitch"):
        Simulation(robot, robot.parameters.changed({"plant": "mujoco"}))
    assert suitable_plant(robot, robot.parameters, "auto")[1].startswith("the ideal model: robot.body.urdf")


def test_meshes_of_collada_files_with_y_up_are_turned_as_the_urdf_means_them(tmp_path):
    _, robot = imported(tmp_path, robots_of_the_wheel() / "icub_description/robots/icub.urdf")
    length, width = np.ptp(robot.sole, axis=0)
    assert length > 2.0 * width, "iCub's soles are longer than wide"
    model = load_model(robot.body)
    parts = body_parts(robot.body, model, 1.0)
    assert 0.95 < drawn_height(parts, model, model.referenceConfigurations["posture"]) < 1.05  # m, its size
    feet = [
        part for part in parts if part.joint == model.frames[model.getFrameId(robot.body.sole(Side.LEFT))].parentJoint
    ]
    lowest = min(np.min(drawn_in(model, part)[:, 2]) for part in feet)
    assert abs(lowest - np.min(np.vstack([drawn_in(model, part) for part in parts])[:, 2])) < 2e-3, (
        "it stands on its feet"
    )


def drawn_in(model, part):
    """Vertices of a part in the world, in the posture of the model [m], shape (V, 3)."""
    data = model.createData()
    pin.forwardKinematics(model, data, model.referenceConfigurations["posture"])
    return part.vertices @ data.oMi[part.joint].rotation.T + data.oMi[part.joint].translation


def test_the_legs_may_be_named():
    model = load_model(G1.body)
    left, right = find_legs(model, ("left_ankle_roll_link", "right_ankle_roll_link"))
    assert (model.names[left.knee], model.names[right.knee]) == ("left_knee_joint", "right_knee_joint")
    with pytest.raises(InvalidValueError, match="must be a link"):
        find_legs(model, ("no_link", "right_ankle_roll_link"))


def test_walk_import_writes_a_file_that_can_be_loaded(tmp_path):
    out = tmp_path / "mine.yaml"
    done = walk("import", G1.body.urdf, "--out", out)
    assert done.returncode == 0, done.stderr
    assert load_robot(out).name == "mine" and "33.3 kg" in done.stdout
    (tmp_path / "broken.urdf").write_text("<robot>")
    refused = walk("import", tmp_path / "broken.urdf", "--out", out)
    assert refused.returncode == 2 and "\nwalk: urdf" in refused.stderr  # behind what it is doing
