# pyright: basic, reportMissingImports=false
# (Pinocchio ships no types)
"""The legs of a biped, found from the tree of its joints, and the posture in which its knees are bent."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares

from walkcore.errors import InvalidValueError
from walkcore.mpc.stance import Side
from walkcore.values import Vector

SAME_HEIGHT = 0.02  # [m] between the ends of two legs
LEAST_APART = 0.03  # [m] between the feet
NB_JOINTS = 6  # of a leg that can place its foot anywhere, with any orientation
KNEE_BEND = 0.7  # [rad]
HALF_SITTING = "half_sitting"
"""Usual name of the posture with bent knees in an SRDF."""
MOST_TILT = 0.02  # [rad] of a foot in a posture to walk from
LEAST_BEND = 0.2  # [rad] of its knees: straight ones leave no height for a step
FIRST_JOINT = 2  # in Pinocchio's model, after the universe and the floating base
PARALLEL = 0.98  # cosine of the angle between two axes that count as parallel


@dataclass(frozen=True, slots=True)
class Leg:
    """The chain of joints from the pelvis to one foot."""

    side: Side
    joints: tuple[int, ...]
    """Indices in Pinocchio's model, from the hip to the ankle."""

    @property
    def foot(self) -> int:
        """Joint that moves the foot."""
        return self.joints[-1]

    @property
    def knee(self) -> int:
        """Joint that moves the shin: the ankle has two."""
        return self.joints[-3]


def find_legs(model: pin.Model, feet: Sequence[str] = ()) -> tuple[Leg, Leg]:
    """The left and the right leg.

    Args:
        model: with a floating base, at rest with its feet on the ground in its neutral configuration.
        feet: links of the left and the right foot, if they are to be taken instead of the two lowest ends of the tree.

    Raises:
        InvalidValueError: if the tree has not two such legs.
    """
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    ends = _named_ends(model, feet) if feet else _lowest_ends(model, data)
    if len(ends) != 2:
        found, more = ", ".join(model.names[end] for end in ends[:4]), ", ..." if len(ends) > 4 else ""
        limit = "must be two: only bipeds walk here, with z up; where arms hang as low, name --left-foot, --right-foot"
        raise InvalidValueError("urdf: lowest ends", f"{len(ends)} ({found}{more})", limit)
    left, right = ends if feet else sorted(ends, key=lambda end: _side_order(model, data, end))
    legs = Leg(Side.LEFT, _chain(model, left, right)), Leg(Side.RIGHT, _chain(model, right, left))
    for leg in legs:
        if len(leg.joints) < NB_JOINTS:
            joints = f"{len(leg.joints)} joints ({', '.join(model.names[joint] for joint in leg.joints)})"
            limit = f"must have at least {NB_JOINTS}: with fewer, a foot cannot be put anywhere and lie flat there"
            raise InvalidValueError(f"{leg.side.name.lower()} leg", joints, limit)
        for joint in leg.joints:
            if model.joints[joint].nq != 1:
                limit = "must be a joint of one angle: make it revolute, with the limits of the real one"
                raise InvalidValueError(f"{leg.side.name.lower()} leg", model.names[joint], limit)
    return legs


def _side_order(model: pin.Model, data: pin.Data, end: int) -> tuple[int, float]:
    """Orders the ends of the legs from left to right: by their names where these tell the side, else by y."""
    by_name = (Side.LEFT, None, Side.RIGHT).index(_side_in(model.names[end]))
    return by_name, -float(data.oMi[end].translation[1])


def _side_in(name: str) -> Side | None:
    """The side that a name tells; None if neither, or both."""
    name = name.lower()
    is_right = "right" in name or name.startswith(("r_", "rleg")) or "_r_" in name or name.endswith("_r")
    is_left = "left" in name or name.startswith(("l_", "lleg")) or "_l_" in name or name.endswith("_l")
    return None if is_left is is_right else Side.RIGHT if is_right else Side.LEFT


def facing(model: pin.Model, legs: tuple[Leg, Leg]) -> float:
    """Yaw of the direction in which the robot faces, with its left leg to the left, in its neutral configuration [rad].

    Args:
        model: of the robot.
        legs: left and right.

    Raises:
        InvalidValueError: if the feet are not side by side.
    """
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    left, right = (data.oMi[leg.foot].translation for leg in legs)
    x, y, z = left - right
    if np.hypot(x, y) < abs(z) or np.hypot(x, y) < LEAST_APART:
        raise InvalidValueError("feet", [round(float(v), 3) for v in (x, y, z)], "must stand side by side [m]")
    return float(np.round(np.arctan2(-x, y) / (np.pi / 2)) * np.pi / 2)


def _named_ends(model: pin.Model, feet: Sequence[str]) -> list[int]:
    """Joints that move the links which are named as left and right foot."""
    for side, name in zip(Side, feet, strict=True):
        field = f"{side.name.lower()}_foot"
        if not model.existFrame(name):
            raise InvalidValueError(field, name, "must be a link of the URDF")
        if model.frames[model.getFrameId(name)].parentJoint < FIRST_JOINT:
            raise InvalidValueError(field, name, "must be moved by the joints of a leg: it is part of the base")
    ends = [model.frames[model.getFrameId(name)].parentJoint for name in feet]
    supports = [set(model.supports[end]) for end in ends]
    if supports[0] <= supports[1] or supports[1] <= supports[0]:
        limit = f"must have a leg of its own: joints that move it move the other foot, {feet[0]}, too"
        raise InvalidValueError("right_foot", feet[1], f"{limit}; name the last link of each leg")
    for side, name in zip(Side, feet, strict=True):
        if _side_in(name) is side.other:
            limit = f"must be on the robot's {side.name.lower()}, and its name says {side.other.name.lower()}"
            raise InvalidValueError(f"{side.name.lower()}_foot", name, f"{limit}: swap --left-foot and --right-foot")
    return ends


def _lowest_ends(model: pin.Model, data: pin.Data) -> list[int]:
    ends = [joint for joint in range(FIRST_JOINT, model.njoints) if not len(model.children[joint])]
    if not ends:
        raise InvalidValueError("urdf", "no joint", "must have legs with joints that move")
    lowest = min(data.oMi[end].translation[2] for end in ends)
    return [end for end in ends if data.oMi[end].translation[2] < lowest + SAME_HEIGHT]


def _chain(model: pin.Model, end: int, other: int) -> tuple[int, ...]:
    """The joints that move this end and not the other: from the last branch of the tree on."""
    shared = set(model.supports[other])
    return tuple(joint for joint in model.supports[end] if joint not in shared)


def bent_posture(model: pin.Model, legs: tuple[Leg, Leg]) -> Vector:
    """The neutral configuration with bent knees, level feet, and the ankles below the hips, facing x, shape (nq,).

    Args:
        model: of the robot.
        legs: left and right.

    Raises:
        InvalidValueError: if a leg has no hip and ankle joint parallel to its knee, or a knee that does not bend.
    """
    q = np.clip(pin.neutral(model), model.lowerPositionLimit, model.upperPositionLimit)
    q[:7] = pin.SE3ToXYZQUAT(pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, -facing(model, legs)), np.zeros(3)))
    for leg in legs:
        q = _with_bent_leg(model, leg, q)
    return q


def named_posture(model: pin.Model, legs: tuple[Leg, Leg], srdf: Path, name: str) -> Vector:
    """A configuration of an SRDF, facing x, shape (nq,).

    Args:
        model: of the robot.
        legs: left and right.
        srdf: file.
        name: of the posture, such as half_sitting.

    Raises:
        InvalidValueError: if it is not there, or no posture to walk from, with level feet and bent knees.
    """
    try:
        pin.loadReferenceConfigurations(model, str(srdf), False)
    except (ValueError, RuntimeError) as error:
        raise InvalidValueError("srdf", str(srdf), f"cannot be read: {' '.join(str(error).split())}") from error
    if name not in model.referenceConfigurations:
        names = ", ".join(sorted(entry.key() for entry in model.referenceConfigurations)) or "none is there"
        raise InvalidValueError("posture", name, f"must be one of the SRDF: {names}")
    straight, q = pin.neutral(model), np.array(model.referenceConfigurations[name])
    straight[:7] = q[:7] = pin.SE3ToXYZQUAT(pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, -facing(model, legs)), np.zeros(3)))
    data, level = model.createData(), model.createData()
    pin.forwardKinematics(model, data, q)
    pin.forwardKinematics(model, level, straight)
    for leg in legs:
        side, turned = leg.side.name.lower(), data.oMi[leg.foot].rotation.T @ level.oMi[leg.foot].rotation
        tilt = float(np.linalg.norm(pin.log3(turned)))
        if tilt > MOST_TILT:
            raise InvalidValueError(
                "posture", name, f"must have level feet; the {side} one is tilted by {tilt:.2f} rad"
            )
        knee = model.joints[leg.knee].idx_q
        if abs(q[knee] - straight[knee]) < LEAST_BEND:
            raise InvalidValueError("posture", name, f"must have bent knees; the {side} one is straight")
    return q


def _with_bent_leg(model: pin.Model, leg: Leg, straight: Vector) -> Vector:
    q, data = straight.copy(), model.createData()
    pin.forwardKinematics(model, data, q)
    axes = {joint: _axis(model, data, joint) for joint in leg.joints}
    across = axes[leg.knee]
    hips = [joint for joint in leg.joints[:-3] if abs(axes[joint] @ across) > PARALLEL]
    ankles = [joint for joint in leg.joints[-2:] if abs(axes[joint] @ across) > PARALLEL]
    if not hips or not ankles:
        limit = "must be a knee, with a parallel joint in the hip and one in the ankle"
        raise InvalidValueError(f"{leg.side.name.lower()} leg", model.names[leg.knee], limit)
    hip, ankle = hips[-1], ankles[0]
    knee, *others = (model.joints[joint].idx_q for joint in (leg.knee, hip, ankle))
    low, high = model.lowerPositionLimit[knee], model.upperPositionLimit[knee]
    q[knee] = np.clip(KNEE_BEND if high > -low else -KNEE_BEND, low, high)
    if abs(q[knee]) < LEAST_BEND:
        limit = f"must bend by {LEAST_BEND} rad at least, to shorten the leg: its <limit> is {low:g} to {high:g}"
        raise InvalidValueError(f"{leg.side.name.lower()} knee", model.names[leg.knee], limit)
    level = np.array(data.oMi[leg.foot].rotation)

    def error(angles: Vector) -> Vector:
        """Distance of the ankle before the hip [m], and tilt of the foot [rad]."""
        q[others] = angles
        pin.forwardKinematics(model, data, q)
        ahead = data.oMi[leg.foot].translation[0] - data.oMi[hip].translation[0]
        return np.array([ahead, pin.log3(data.oMi[leg.foot].rotation @ level.T) @ across])

    error(least_squares(error, np.full(2, -q[knee] / 2)).x)
    return q


def _axis(model: pin.Model, data: pin.Data, joint: int) -> Vector:
    """Axis of a hinge in the world, shape (3,)."""
    kind = model.joints[joint]
    own = kind.createData()
    kind.calc(own, pin.neutral(model))
    return data.oMi[joint].rotation @ np.ravel(own.S)[3:]
