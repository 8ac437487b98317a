# pyright: basic, reportMissingImports=false
# (Pinocchio ships no types)
"""Faults and oddities of a URDF, each in one line that says what to do."""

from collections.abc import Iterator, Sequence

import numpy as np
import pinocchio as pin

from walkcore.errors import InvalidValueError, InverseKinematicsError
from walkcore.motion.swing_foot import standing
from walkcore.motion.whole_body import BodyTarget, WholeBody
from walkcore.mpc.stance import Side
from walkcore.robot import Robot
from walkcore.robot_import.measure import MeasuredRobot, mimic_joints
from walkcore.values import Matrix, Vector

SAME = 0.02  # share by which the mirror images of two inertias or masses may differ
NEAR = 1e-3  # [m] by which the mirror images of two places may differ
NO_MOMENT = 1e-12  # [kg m^2] of an inertia: rounding of the URDF's numbers leaves such a one of zero
MOST_TURN = 4.0 * np.pi  # [rad] between the limits of a joint of a leg
FEW = 4  # names in one line
ENOUGH = 0.8  # of a torque's limit that standing may take
MIRROR = np.diag([1.0, -1.0, 1.0])


def findings(measured: MeasuredRobot, robot: Robot) -> Iterator[str]:
    """The findings, the most serious first.

    Args:
        measured: the URDF.
        robot: the robot file made of it.

    Raises:
        InvalidValueError: if the robot cannot stand at its CoM height.
    """
    yield from _inertias(measured)
    yield from _mirror_images(measured)
    yield from _angles(measured)
    yield from _mimic_joints(measured)
    yield from _torques(robot)
    if measured.fixed_joints:
        names = _listed(measured.fixed_joints)
        yield f"held fast, as they have no torque or speed, turn without end or mimic others: {names}; see fixed_joints"


def _listed(names: Sequence[str]) -> str:
    """Some names, of which the first few stand for all."""
    return ", ".join(names[:FEW]) + (", ..." if len(names) > FEW else "")


def _inertias(measured: MeasuredRobot) -> Iterator[str]:
    model = measured.model
    moving = [joint for joint in range(1, model.njoints) if model.names[joint] not in measured.fixed_joints]
    without = [model.names[joint] for joint in moving if model.inertias[joint].mass <= 0.0]
    if without:
        yield f"no mass in what these joints move: {_listed(without)}; give it one in the URDF, or torques are wrong"
    negative, exceeding = list[str](), list[str]()
    for joint in moving:
        moments, name = np.linalg.eigvalsh(model.inertias[joint].inertia), model.names[joint]
        if name not in without and moments[0] <= NO_MOMENT:
            negative.append(f"{name} ({moments[0]:.2g} kg m^2)")
        elif moments[2] > (moments[0] + moments[1]) * (1.0 + SAME):
            exceeding.append(name)
    remedy = "contact physics refuses them: take those of the other side, or of the CAD model"
    if negative:
        yield f"inertias that are not positive in what these joints move: {_listed(negative)}; {remedy}"
    if exceeding:
        yield f"inertias that no body has, one moment above the sum of the others: {_listed(exceeding)}; {remedy}"


def _mirror_images(measured: MeasuredRobot) -> Iterator[str]:
    """Left joints and links against the right ones, in the axes of the robot."""
    model, data = measured.model, measured.model.createData()
    pin.forwardKinematics(model, data, measured.q)
    middle = np.mean([data.oMi[leg.foot].translation for leg in measured.legs], axis=0)
    left, right = measured.legs
    places, weights, inertias, levers = (list[str]() for _ in range(4))
    for a, b in zip(left.joints, right.joints, strict=False):
        place_a, place_b = (data.oMi[joint].translation - middle for joint in (a, b))
        names = f"{model.names[a]} and {model.names[b]}"
        if np.max(np.abs(place_a - MIRROR @ place_b)) > NEAR:
            places.append(names)
        (mass_a, lever_a, inertia_a), (mass_b, lever_b, inertia_b) = (_in_world(model, data, joint) for joint in (a, b))
        if abs(mass_a - mass_b) > SAME * max(mass_a, mass_b):
            weights.append(f"{names} weigh {mass_a:.3g} and {mass_b:.3g} kg")
        elif np.max(np.abs(inertia_a - MIRROR @ inertia_b @ MIRROR)) > SAME * np.max(np.abs(inertia_a)):
            inertias.append(names)
        elif np.max(np.abs(lever_a - MIRROR @ lever_b)) > NEAR:
            levers.append(names)
    if places:
        yield f"no mirror images, for which the gait takes them: {_listed(places)}; check the origins of these joints"
    if weights:
        yield f"left and right differ: what is moved by {_listed(weights)}; check the masses in the URDF"
    if inertias:
        yield f"inertias that are no mirror images: {_listed(inertias)}; one may have been copied from the other"
    if levers:
        yield f"CoM of links that are no mirror images: {_listed(levers)}; check the origins of their <inertial>"


def _angles(measured: MeasuredRobot) -> Iterator[str]:
    """Limits of the legs that only degrees would have."""
    model = measured.model
    joints = [model.joints[joint] for leg in measured.legs for joint in leg.joints]
    bounds = [(model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]) for joint in joints]
    names = [model.names[joint.id] for joint, (low, high) in zip(joints, bounds, strict=True) if high - low > MOST_TURN]
    if names:
        yield f"joints that turn more than once: {_listed(names)}; limits of a URDF are in radians, not in degrees"


def _in_world(model: pin.Model, data: pin.Data, joint: int) -> tuple[float, Vector, Matrix]:
    """Mass [kg], CoM from the joint [m] and inertia [kg m^2] of the links of a joint, along the world's axes."""
    R, inertia = data.oMi[joint].rotation, model.inertias[joint]
    return inertia.mass, R @ inertia.lever, R @ inertia.inertia @ R.T


def _mimic_joints(measured: MeasuredRobot) -> Iterator[str]:
    legs = [measured.model.names[joint] for leg in measured.legs for joint in leg.joints]
    mimics = [name for name in mimic_joints(measured.urdf) if name in legs]
    if mimics:
        yield f"leg joints that mimic others move on their own here: {_listed(mimics)}; no coupling is simulated"


def _torques(robot: Robot) -> Iterator[str]:
    """Torques of the robot at rest on both feet, against their limits.

    Raises:
        InvalidValueError: if it cannot stand at its CoM height.
    """
    assert robot.body is not None
    body = WholeBody(robot.body)
    feet = [standing(robot.foot_at_rest(side)) for side in Side]
    target = BodyTarget(np.array([0.0, 0.0, robot.com_height]), *feet, heading=0.0)
    try:
        q = body.at_rest(target)
    except InverseKinematicsError as error:
        limit = f"must be one at which it stands on flat soles: {error}; check the limits of the leg joints in the URDF"
        raise InvalidValueError("com_height", robot.com_height, limit) from error
    torques = np.abs(body.dynamics(q, q, q, robot.parameters.control_period, np.zeros(2), list(Side)).torques)
    for word, limits, number in (("torque", body.max_torques, "effort"), ("speed", body.max_speeds, "velocity")):
        without = [name for name, limit in zip(body.joint_names, limits, strict=True) if limit <= 0.0]
        if without:
            told = f"no {word}: {_listed(without)}"
            yield f"{told}; give them the {number} of the real robot in the URDF, or in replaced_limits"
    for name, torque, limit in zip(body.joint_names, torques, body.max_torques, strict=True):
        if torque > ENOUGH * limit > 0.0:
            yield f"{name} takes {torque:.1f} of {limit:.1f} N m to stand: check the limit, or raise com_height"
