# pyright: basic, reportMissingImports=false
# (Pinocchio ships no types)
"""Pinocchio's model of a body: of the joints that move, with a floating base and the sole frames.

Made from the URDF in memory; no file is changed or copied. Whoever needs the kinematics takes this model, so that all
count the same joints.
"""

from functools import cache

import numpy as np
import pinocchio as pin

from walkcore.errors import InvalidValueError
from walkcore.robot import BodyModel, FixedFrame
from walkcore.values import Vector

TURNED = 0.5  # [rad] from which the base of a posture faces elsewhere
FREE_FLYER = 7  # numbers of the floating base in a configuration


def load_model(body: BodyModel) -> pin.Model:
    """The model, whose `referenceConfigurations["posture"]` is the posture of the body.

    Args:
        body: of a robot.

    Raises:
        InvalidValueError: if the URDF cannot be read, or a joint or frame that the body names is not in it.
    """
    try:
        model = pin.buildModelFromUrdf(str(body.urdf), pin.JointModelFreeFlyer())
    except (ValueError, RuntimeError) as error:
        raise InvalidValueError("robot.body.urdf", str(body.urdf), f"cannot be read: {error}") from error
    _replace_limits(body, model)
    posture = _posture(body, model)
    fixed = [_joint(model, name, "fixed_joints") for name in body.fixed_joints]
    if fixed:
        reduced = pin.buildReducedModel(model, fixed, posture)
        moving = [name for name in list(model.names)[2:] if reduced.existJointName(name)]
        kept = [model.joints[model.getJointId(name)] for name in moving]
        angles = [posture[joint.idx_q : joint.idx_q + joint.nq] for joint in kept]
        model, posture = reduced, np.concatenate([posture[:FREE_FLYER], *angles])
    frames = {"left_sole": body.left_sole_frame, "right_sole": body.right_sole_frame, "torso": body.torso_frame}
    for field, frame in frames.items():
        _add_frame(model, frame, field)
    model.referenceConfigurations["posture"] = _facing_forward(model, body, posture)
    return model


@cache
def configuration_size(body: BodyModel) -> int:
    """nq: numbers in a configuration of that body."""
    return int(load_model(body).nq)


def _replace_limits(body: BodyModel, model: pin.Model) -> None:
    for limits in body.replaced_limits:
        first = model.joints[_joint(model, limits.joint, "replaced_limits")].idx_v
        if limits.velocity is not None:
            model.velocityLimit[first] = limits.velocity
        if limits.effort is not None:
            model.effortLimit[first] = limits.effort


def _posture(body: BodyModel, model: pin.Model) -> Vector:
    posture = pin.neutral(model)
    if body.srdf is not None:
        pin.loadReferenceConfigurations(model, str(body.srdf), False)
        if body.posture not in model.referenceConfigurations:
            names = ", ".join(sorted(entry.key() for entry in model.referenceConfigurations))
            raise InvalidValueError("robot.body.posture", body.posture, f"must be one of the SRDF: {names}")
        posture = np.array(model.referenceConfigurations[body.posture])
    for name, angle in body.posture_angles:
        joint = model.joints[_joint(model, name, "posture_angles")]
        if joint.nq != 1:
            raise InvalidValueError("robot.body.posture_angles", name, "must be a joint of one angle")
        posture[joint.idx_q] = angle
    return posture


def _facing_forward(model: pin.Model, body: BodyModel, posture: Vector) -> Vector:
    """The posture with its base turned until the torso stands upright and faces x: some bases face backward."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, posture)
    torso = data.oMf[model.getFrameId(body.torso)].rotation
    if np.linalg.norm(pin.log3(torso)) < TURNED:
        return posture
    base = pin.Quaternion(torso.T @ data.oMi[1].rotation)
    return np.concatenate([posture[:3], base.coeffs(), posture[FREE_FLYER:]])


def _joint(model: pin.Model, name: str, field: str) -> int:
    if not model.existJointName(name):
        raise InvalidValueError(f"robot.body.{field}", name, "must be a joint of the URDF")
    return model.getJointId(name)


def _frame(model: pin.Model, name: str, field: str) -> int:
    if not model.existFrame(name):
        raise InvalidValueError(f"robot.body.{field}", name, "must be a frame of the URDF")
    return model.getFrameId(name)


def _add_frame(model: pin.Model, frame: FixedFrame, field: str) -> None:
    link = model.frames[_frame(model, frame.link, field)]
    if frame.link == frame.name:
        return
    placement = link.placement * pin.SE3(pin.rpy.rpyToMatrix(*frame.rpy), np.array(frame.position))
    model.addFrame(pin.Frame(frame.name, link.parentJoint, placement, pin.FrameType.OP_FRAME))
