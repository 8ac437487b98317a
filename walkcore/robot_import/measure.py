# pyright: basic, reportMissingImports=false
# (Pinocchio ships no types)
"""The quantities of a robot file, measured on a URDF; what cannot be measured follows from its size.

Speeds go with the square root of the CoM's height (Froude number), lengths with the height, impulses with mass times
speed, all from the values of the default robot, whose regions and limits were found by simulation.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from walkcore.errors import InvalidValueError
from walkcore.robot_file import load_robot
from walkcore.robot_import.legs import HALF_SITTING, Leg, bent_posture, find_legs, named_posture
from walkcore.robot_import.soles import Sole, check_toes, common_outline, foot_geometry, sole_of
from walkcore.robot_import.urdf_checks import check_urdf
from walkcore.values import Matrix, Vector

LOWERED = 0.965  # of the CoM's height in the posture: on the longest step the knees are still bent
INNER, OUTER, AHEAD, CORNER = 0.95, 0.46, 0.36, 0.22
"""Foothold region before a study: least y per stance width; y, x and x of its outer corners per CoM height."""
MARGIN = 0.25  # of the width of a sole
MOST_MARGIN = 0.03  # [m]
TIPPING = 0.3  # of that margin: what the CoP keeps in physics
MOST_TIPPING_MARGIN = 0.015  # [m]
DIGITS = 4


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredRobot:
    """A URDF whose legs, soles and posture are known."""

    urdf: Path
    packages: Path
    model: pin.Model
    """With every joint of the URDF, and a floating base."""
    legs: tuple[Leg, Leg]
    q: Vector
    """Posture with bent knees, facing x, shape (nq,)."""
    soles: tuple[Sole, Sole]
    outline: Matrix
    """Corners of the left sole about the origin of the foot's joint, along x and y of the world, shape (V, 2) [m]."""
    torso: str
    """Link that is held upright."""
    fixed_joints: tuple[str, ...]
    """Joints without torque or speed, or that mimic others, such as those of fingers."""
    srdf: Path | None = None
    """SRDF that has the posture; None where the knees were bent here."""
    posture: str = ""
    """Name of the posture in the SRDF."""

    @property
    def mass(self) -> float:
        """Mass of all links [kg]."""
        return float(pin.computeTotalMass(self.model))

    @property
    def com_over_foot(self) -> Vector:
        """From the middle between the feet's joints to the CoM, in the posture [m], shape (3,)."""
        data = self.model.createData()
        com = pin.centerOfMass(self.model, data, self.q)
        return np.array(com - np.mean([data.oMi[leg.foot].translation for leg in self.legs], axis=0))

    @property
    def feet_apart(self) -> float:
        """Distance between the feet's joints in the posture, sideways [m]."""
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, self.q)
        left, right = (data.oMi[leg.foot].translation for leg in self.legs)
        return float(left[1] - right[1])


def measure(
    urdf: Path,
    packages: Path,
    feet: Sequence[str] = (),
    torso: str = "",
    srdf: Path | None = None,
    posture: str = HALF_SITTING,
) -> MeasuredRobot:
    """Find the legs, soles and posture of a biped.

    Args:
        urdf: file.
        packages: folder in which its `package://` addresses start.
        feet: links of the left and the right foot; by default the two lowest ends of the tree.
        torso: link to be held upright; by default the heaviest that no leg moves.
        srdf: file with the posture; None bends the knees.
        posture: its name there.

    Raises:
        InvalidValueError: if it is no biped that could walk, with what is missing.
    """
    check_urdf(urdf)
    try:
        model = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
    except (ValueError, RuntimeError) as error:
        raise InvalidValueError("urdf", str(urdf), f"cannot be read: {' '.join(str(error).split())}") from error
    legs = find_legs(model, feet)
    q = bent_posture(model, legs) if srdf is None else named_posture(model, legs, srdf, posture)
    shapes = foot_geometry(model, urdf, packages, legs)
    left, right = (sole_of(model, shapes, leg, q) for leg in legs)
    check_toes(left, right)
    measured = MeasuredRobot(
        urdf=urdf,
        packages=packages,
        model=model,
        legs=legs,
        q=q,
        soles=(left, right),
        outline=common_outline(left, right),
        torso=_checked_torso(model, legs, torso) if torso else _torso(model, legs),
        fixed_joints=_joints_to_hold(model, legs, urdf),
        srdf=srdf,
        posture="" if srdf is None else posture,
    )
    above = float(measured.com_over_foot[2] - left.height)
    if above <= 0.0:
        limit = "must be above the soles [m]: the z axis of the robot's base must point up"
        raise InvalidValueError("height of the CoM", round(above, 3), limit)
    return measured


def _checked_torso(model: pin.Model, legs: tuple[Leg, Leg], torso: str) -> str:
    """The link that is named, if it is one that no leg moves."""
    if not model.existFrame(torso):
        raise InvalidValueError("torso", torso, "must be a link of the URDF")
    joint = model.frames[model.getFrameId(torso)].parentJoint
    for leg in legs:
        if set(leg.joints) & set(model.supports[joint]):
            limit = f"must be a link that no leg moves: it hangs on the {leg.side.name.lower()} one"
            raise InvalidValueError("torso", torso, limit)
    return torso


def _torso(model: pin.Model, legs: tuple[Leg, Leg]) -> str:
    """The link with the most mass that no leg moves."""
    of_legs = {joint for leg in legs for joint in leg.joints}
    joints = [joint for joint in range(1, model.njoints) if joint not in of_legs]
    heaviest = max(joints, key=lambda joint: model.inertias[joint].mass)
    links = [f.name for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint == heaviest]
    return links[0]


def mimic_joints(urdf: Path) -> list[str]:
    """Names of the joints of a URDF that are to mimic others."""
    joints = ElementTree.parse(urdf).getroot().iter("joint")
    return [joint.get("name", "") for joint in joints if joint.find("mimic") is not None]


def _joints_to_hold(model: pin.Model, legs: tuple[Leg, Leg], urdf: Path) -> tuple[str, ...]:
    """Joints outside of the legs that have no torque or no speed, or more than one number, or mimic others."""
    of_legs, mimics = {joint for leg in legs for joint in leg.joints}, mimic_joints(urdf)
    names: list[str] = []
    for joint in range(2, model.njoints):
        kind = model.joints[joint]
        first = kind.idx_v
        cannot = kind.nv != 1 or kind.nq != 1 or model.effortLimit[first] == 0.0 or model.velocityLimit[first] == 0.0
        if (cannot or model.names[joint] in mimics) and joint not in of_legs:
            names.append(model.names[joint])
    return tuple(names)


def robot_mapping(robot: MeasuredRobot, name: str, folder: Path) -> dict[str, Any]:
    """The plain values of a robot file.

    Args:
        robot: that was measured.
        name: of the robot.
        folder: of the file: paths in it start there.
    """
    model = load_robot()
    x, _, above = robot.com_over_foot
    height = LOWERED * float(above - robot.soles[0].height)
    size = height / model.com_height
    speed, width = math.sqrt(size), round(robot.feet_apart, 3)
    ahead = float(np.clip(x, *np.sort(robot.outline[:, 0])[[0, -1]] * 0.5))
    outline = np.round(robot.outline - [ahead, 0.0], DIGITS)
    margin = min(MOST_MARGIN, MARGIN * float(np.ptp(outline, axis=0).min()))
    region = [[-AHEAD, INNER], [-CORNER, OUTER], [CORNER, OUTER], [AHEAD, INNER]]
    vertices = [[px * height, py * (width if py == INNER else height)] for px, py in region]
    duration = round(model.parameters.step_duration * speed, 1)
    return {
        "name": name,
        "mass": round(robot.mass, 6),
        "com_height": round(height, 3),
        "stance_width": width,
        "sole": outline.tolist(),
        "foothold_regions": [{"yaw": [-0.09, 0.45], "region": _rounded(vertices)}],
        "max_foot_speed": _rounded(model.max_foot_speed * speed, 2),
        "max_foot_yaw_rate": model.max_foot_yaw_rate,
        "max_com_distance": round(model.max_com_distance * size, 3),
        "max_reference": {
            key: _rounded(np.array(limits) * (speed if key != "yaw_rate" else 1.0), 2)
            for key, limits in model.max_reference.items()
        },
        "max_push": round(model.max_push * speed * robot.mass / model.mass, 1),
        "tipping_margin": round(min(MOST_TIPPING_MARGIN, TIPPING * margin), 3),
        "gait": {
            "step_duration": duration,
            "initial_double_support_duration": duration,
            "cop_margin": round(margin, 3),
            "swing_height": round(model.parameters.swing_height * size, 3),
        },
        "body": _body_mapping(robot, ahead, folder),
    }


def _body_mapping(robot: MeasuredRobot, ahead: float, folder: Path) -> dict[str, Any]:
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, robot.q)
    base = data.oMf[model.getFrameId(robot.torso)].rotation
    body: dict[str, Any] = {
        "urdf": _relative(robot.urdf, folder),
        "package_folder": _relative(robot.packages, folder),
    }
    if robot.srdf is not None:
        body |= {"srdf": _relative(robot.srdf, folder), "posture": robot.posture}
    else:
        body["posture_angles"] = {
            model.names[joint]: round(float(robot.q[model.joints[joint].idx_q]), DIGITS)
            for joint in range(2, model.njoints)
            if model.joints[joint].nq == 1 and abs(robot.q[model.joints[joint].idx_q]) > 1e-6
        }
    for leg, sole in zip(robot.legs, robot.soles, strict=True):
        position = sole.rotation @ [ahead, 0.0, sole.height]
        frame = {"link": _link_of(model, leg.foot), "position": _rounded(position)}
        body[f"{leg.side.name.lower()}_sole"] = frame | _turned(sole.rotation)
    turned = _turned(base.T)
    body["torso"] = {"link": robot.torso} | turned if turned else robot.torso
    return body | ({"fixed_joints": list(robot.fixed_joints)} if robot.fixed_joints else {})


def _link_of(model: pin.Model, joint: int) -> str:
    """The link whose frame is that of a joint."""
    frames = (f for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint == joint)
    return next(f.name for f in frames if f.placement.isIdentity())


def _turned(rotation: Matrix) -> dict[str, Any]:
    rpy = _rounded(pin.rpy.matrixToRpy(rotation))
    return {"rpy": rpy} if any(rpy) else {}


def _relative(path: Path, folder: Path) -> str:
    """A path as seen from a folder, where it lies inside of it; else the whole path."""
    path, folder = path.resolve(), folder.resolve()
    return str(path.relative_to(folder)) if path.is_relative_to(folder) else str(path)


def _rounded(values: Any, digits: int = DIGITS) -> Any:
    return (np.round(np.asarray(values, dtype=float), digits) + 0.0).tolist()
