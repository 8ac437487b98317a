"""Talos follows: recomputed from the recorded joint angles with Pinocchio alone."""

import numpy as np
import pinocchio as pin
import pytest

from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot, load_scenario, record
from walkcore.errors import InverseKinematicsError
from walkcore.motion.swing_foot import standing
from walkcore.motion.whole_body import BodyTarget, WholeBody
from walkcore.mpc.stance import Side

BOTH = (Side.LEFT, Side.RIGHT)


@pytest.fixture(scope="module")
def body():
    return WholeBody(load_robot("talos").body)


@pytest.fixture(scope="module")
def recording():
    return record(load_scenario("herdt-2010-section-6"))


@pytest.fixture(scope="module")
def configurations(recording):
    return np.column_stack([recording[name] for name in recording.columns if name.startswith("q_")])


def test_the_model_has_32_joints_and_the_mass_of_the_robot_file(body):
    assert body.model.nv == 6 + 32
    assert body.mass == pytest.approx(load_robot("talos").mass, abs=1e-6)


def test_com_and_soles_are_within_a_millimetre_at_every_tick(body, recording, configurations):
    model, data = body.model, body.model.createData()
    frames = {"left": model.getFrameId("left_sole_link"), "right": model.getFrameId("right_sole_link")}
    for k, q in enumerate(configurations):
        com = pin.centerOfMass(model, data, q)
        assert np.linalg.norm(com - [recording[f"com_{a}"][k] for a in "xyz"]) < 1e-3
        pin.updateFramePlacements(model, data)
        for foot, frame in frames.items():
            placement = data.oMf[frame]
            assert np.linalg.norm(placement.translation - [recording[f"{foot}_{a}"][k] for a in "xyz"]) < 1e-3
            assert np.linalg.norm(pin.log3(placement.rotation)) < 5e-3  # soles flat on the ground, facing x


def test_the_torso_stays_upright(body, configurations):
    model, data = body.model, body.model.createData()
    torso = model.getFrameId("torso_2_link")
    for q in configurations[::20]:
        pin.framesForwardKinematics(model, data, q)
        assert np.linalg.norm(pin.log3(data.oMf[torso].rotation)) < 0.01


def test_joints_stay_within_the_limits_of_the_urdf(configurations):
    urdf = load_robot("talos").body.urdf
    model = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
    assert np.all(configurations[:, 7:] >= model.lowerPositionLimit[7:])
    assert np.all(configurations[:, 7:] <= model.upperPositionLimit[7:])
    period = 0.005
    for now, after in zip(configurations[:-1], configurations[1:], strict=True):
        speed = np.abs(pin.difference(model, now, after))[6:] / period
        assert np.all(speed <= model.velocityLimit[6:])


def test_at_rest_the_true_cop_is_below_the_com(body):
    robot = load_robot("talos")
    feet = [standing(robot.foot_at_rest(side)) for side in Side]
    q = body.at_rest(BodyTarget(np.array([0.01, 0.02, robot.com_height]), *feet, heading=0.0))
    assert np.allclose(body.dynamics(q, q, q, 0.005, np.zeros(2), BOTH).true_cop, [0.01, 0.02], atol=1e-4)


def test_true_cop_of_a_rigid_acceleration_is_the_models(body):
    """The whole body carried along without turning: (5) is exact then, and a push is no ground force."""
    robot = load_robot("talos")
    feet = [standing(robot.foot_at_rest(side)) for side in Side]
    q = np.array(body.at_rest(BodyTarget(np.array([0.0, 0.0, robot.com_height]), *feet, heading=0.0)))
    period, acceleration = 0.005, 0.8
    before, after = q.copy(), q.copy()
    before[0] += acceleration * period**2 / 2
    after[0] += acceleration * period**2 / 2
    com = pin.centerOfMass(body.model, body.model.createData(), q)
    expected = com[0] - com[2] / 9.81 * acceleration
    assert body.dynamics(before, q, after, period, np.zeros(2), BOTH).true_cop[0] == pytest.approx(expected, abs=1e-6)
    force = np.array([robot.mass * acceleration, 0.0])
    assert body.dynamics(before, q, after, period, force, BOTH).true_cop[0] == pytest.approx(com[0], abs=1e-4)


def test_a_com_out_of_reach_is_an_error_of_ours(body):
    feet = [standing(load_robot("talos").foot_at_rest(side)) for side in Side]
    with pytest.raises(InverseKinematicsError, match="away from its target"):
        body.at_rest(BodyTarget(np.array([0.0, 0.0, 1.5]), *feet, heading=0.0))


def test_the_body_survives_what_the_page_may_ask():
    simulation = Simulation(load_robot("talos"), Parameters(control_period=0.02))
    rng = np.random.default_rng(1)
    limits = simulation.robot.max_reference
    for _ in range(20):
        reference = Reference(**{name: rng.uniform(*limits[name]) for name in limits})
        for _ in range(40):
            assert simulation.step(Command(reference)).status == 0
    assert simulation.step(Command(push=Push([5.0, 0.0]))).status == 0


@pytest.mark.parametrize("on_ground", [(Side.LEFT,), (Side.RIGHT,), BOTH])
def test_torques_and_ground_forces_balance_the_motion(body, on_ground):
    """Virtual work: with the contact forces applied as external forces, inverse dynamics ask for the same torques."""
    robot = load_robot("talos")
    feet = [standing(robot.foot_at_rest(side)) for side in Side]
    q = body.at_rest(BodyTarget(np.array([0.01, 0.03, robot.com_height]), *feet, heading=0.0))
    model, data = body.model, body.model.createData()
    found = body.dynamics(q, q, q, 0.005, np.zeros(2), on_ground)
    weight = np.array([0.0, 0.0, body.mass * 9.81])
    pin.framesForwardKinematics(model, data, q)
    frames = [model.getFrameId(("left_sole_link", "right_sole_link")[side]) for side in on_ground]
    if len(frames) == 1:
        point = data.oMf[frames[0]].translation
        forces = [np.concatenate([weight, np.cross([*found.true_cop, 0.0] - point, weight)])]
    else:
        y = [data.oMf[frame].translation[1] for frame in frames]
        share = (found.true_cop[1] - y[0]) / (y[1] - y[0])
        shares, points = (1 - share, share), [data.oMf[frame].translation for frame in frames]
        rest = np.cross([*found.true_cop, 0.0], weight) - sum(
            s * np.cross(p, weight) for s, p in zip(shares, points, strict=True)
        )
        forces = [s * np.concatenate([weight, rest]) for s in shares]
    external = [pin.Force.Zero() for _ in range(model.njoints)]
    for frame, force in zip(frames, forces, strict=True):
        joint = model.frames[frame].parentJoint
        at_sole = pin.SE3(np.eye(3), data.oMf[frame].translation)
        external[joint] = data.oMi[joint].actInv(at_sole.act(pin.Force(force)))
    torques = pin.rnea(model, data, q, np.zeros(model.nv), np.zeros(model.nv), external)
    assert np.allclose(torques[:6], 0.0, atol=1e-2)
    assert np.allclose(torques[6:], found.torques, atol=1e-2)


def test_no_joint_is_asked_for_more_than_its_effort_limit(recording):
    assert recording.metrics()["torque_use_p99"] < 1.0
