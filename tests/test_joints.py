"""Motion of the drawn joints, against Pinocchio's forward kinematics."""

import numpy as np
import pinocchio as pin
import pytest

from app.viewer.scene.joints import AnyJoint, FreeFlyer, Hinge, joint_of
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import load_robot
from walkcore.motion.body_model import load_model


def arm_on_a_slide():
    """A floating base with a joint of each kind that a URDF knows, at places that are turned."""
    model = pin.Model()
    last = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    rng = np.random.default_rng(1)
    for k, kind in enumerate(
        [
            pin.JointModelRX(),
            pin.JointModelPY(),
            pin.JointModelRevoluteUnaligned(np.array([0.6, 0.0, 0.8])),
            pin.JointModelRUBZ(),
            pin.JointModelPrismaticUnaligned(np.array([0.0, 0.6, 0.8])),
        ]
    ):
        place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
        last = model.addJoint(last, kind, place, f"j{k}")
    return model


MODELS = {
    "talos": lambda: load_model(load_robot("talos").body),
    "every kind": arm_on_a_slide,
}


@pytest.mark.parametrize("name", MODELS)
def test_joints_move_as_forward_kinematics_says(name):
    model = MODELS[name]()
    data, rng = model.createData(), np.random.default_rng(2)
    joints = {f"j{i}": joint_of(model, i) for i in range(1, model.njoints)}
    for _ in range(20):
        updates, q = SceneUpdates(), pin.integrate(model, pin.neutral(model), 2.0 * rng.normal(size=model.nv))
        pin.forwardKinematics(model, data, q)
        for node, joint in joints.items():
            joint.move(updates, node, q.tolist())
        sent = {(m["type"], m["name"]): m for m in updates.changes(0)}
        for i, (node, joint) in enumerate(joints.items(), start=1):
            w, x, y, z = sent["SetOrientationMessage", node]["wxyz"]
            np.testing.assert_allclose(
                pin.Quaternion(w, x, y, z).normalized().matrix(), data.liMi[i].rotation, atol=3e-5
            )
            still = model.jointPlacements[i].translation
            position = still if isinstance(joint, Hinge) else sent["SetPositionMessage", node]["position"]
            np.testing.assert_allclose(position, data.liMi[i].translation, atol=1e-5)


def test_kinds_are_told_apart():
    model = arm_on_a_slide()
    kinds = [type(joint_of(model, i)) for i in range(1, model.njoints)]
    assert kinds == [FreeFlyer, Hinge, AnyJoint, Hinge, AnyJoint, AnyJoint]
