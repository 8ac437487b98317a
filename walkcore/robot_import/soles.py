# pyright: basic, reportMissingImports=false
# (Pinocchio and Coal ship no types)
"""The soles of a biped, from the shapes of its feet."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError
from shapely.geometry import Polygon

from walkcore.errors import InvalidValueError
from walkcore.motion.shapes import urdf_shapes
from walkcore.robot_import.legs import Leg
from walkcore.values import Matrix, Vector

FLAT = 0.004  # [m] above the lowest point of a foot that still belongs to its sole
ROUNDING = 0.005  # [m] by which an outline with fewer corners may differ
LEAST_LENGTH, LEAST_WIDTH = 0.04, 0.02  # [m] of a sole: a smaller one is a point
MOST_LENGTH = 1.0  # [m]: a longer one is in other units
LEAST_AHEAD = 0.05  # of its length, of the middle of a sole from the ankle: less tells no direction


@dataclass(frozen=True, slots=True, eq=False)
class Sole:
    """The flat part under one foot."""

    rotation: Matrix
    """R_joint_sole: axes of the sole, x forward and z up, in the frame of the foot's joint, shape (3, 3)."""
    height: float
    """Height of the sole in the axes of the sole, from the origin of the foot's joint [m]: negative."""
    outline: Matrix
    """Corners in these axes, counter-clockwise, seen from the same origin [m], shape (V, 2)."""


def sole_of(model: pin.Model, geometry: pin.GeometryModel, leg: Leg, q: Vector) -> Sole:
    """The sole of a leg, in a configuration where it stands on level ground.

    Args:
        model: of the robot.
        geometry: of `foot_geometry`.
        leg: with the foot.
        q: shape (nq,).

    Raises:
        InvalidValueError: if the foot has no shape, or no flat part to stand on.
    """
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    R = np.array(data.oMi[leg.foot].rotation).T  # the world's axes in the frame of the joint
    shapes = [shape for shape in geometry.geometryObjects if shape.parentJoint == leg.foot]
    name = f"{leg.side.name.lower()} foot"
    if not shapes:
        limit = "must have a shape that moves with its last joint: give its link a <collision> in the URDF"
        raise InvalidValueError(name, model.names[leg.foot], limit)
    points = np.vstack([shape_points(shape) for shape in shapes]) @ R
    lowest = float(points[:, 2].min())
    outline = _hull(points[points[:, 2] < lowest + FLAT, :2])
    length, width = (0.0, 0.0) if outline is None else np.ptp(outline, axis=0)
    if max(length, width) > MOST_LENGTH:
        limit = f'must be at most {MOST_LENGTH} m: a URDF is in metres, a mesh in mm needs scale="0.001 0.001 0.001"'
        raise InvalidValueError(name, f"{length:.3g} m long and {width:.3g} m wide", limit)
    if outline is None or length < LEAST_LENGTH or width < LEAST_WIDTH:
        raise InvalidValueError(name, f"{length:.3f} m long and {width:.3f} m wide where it is lowest",
                                f"must be flat over at least {LEAST_LENGTH} by {LEAST_WIDTH} m: "
                                "on a point there is no CoP to choose")  # fmt: skip
    return Sole(R, lowest, outline)


def check_toes(left: Sole, right: Sole) -> None:
    """Refuse soles that reach farther behind the ankles than before them: then left and right are swapped.

    Args:
        left: as the robot faces with that foot to its left.
        right: the other one.

    Raises:
        InvalidValueError: if both do, beyond what a symmetric foot may.
    """
    lows, highs = np.transpose([(np.min(sole.outline[:, 0]), np.max(sole.outline[:, 0])) for sole in (left, right)])
    if np.all(highs + lows < -2.0 * LEAST_AHEAD * (highs - lows)):
        limit = (
            "must reach farther ahead than behind [m]: left and right are swapped; name the feet the other way round"
        )
        raise InvalidValueError("soles, from the ankles", f"{-lows[0]:.3f} behind, {highs[0]:.3f} ahead", limit)


def common_outline(left: Sole, right: Sole) -> Matrix:
    """Corners of what both soles have, as that of the left one, with few corners, shape (V, 2) [m]."""
    both = Polygon(left.outline).intersection(Polygon(right.outline * [1.0, -1.0])).buffer(0.0)
    if both.is_empty or not isinstance(both, Polygon):
        raise InvalidValueError("soles", "left and right", "must overlap when one is mirrored")
    simple = both.simplify(ROUNDING).intersection(both)
    fewest = simple if isinstance(simple, Polygon) else both
    corners = np.array(fewest.exterior.coords)[:-1]
    return corners[ConvexHull(corners).vertices]


def foot_geometry(model: pin.Model, urdf: Path, packages: Path, legs: Iterable[Leg]) -> pin.GeometryModel:
    """The collision shapes of a URDF, or the visual ones if its feet have no others.

    Args:
        model: of the URDF.
        urdf: its file.
        packages: folder in which its `package://` addresses start.
        legs: whose feet must have shapes.

    Raises:
        InvalidValueError: if a mesh is missing.
    """
    kinds = (pin.GeometryType.COLLISION, pin.GeometryType.VISUAL)
    try:
        shapes = [urdf_shapes(model, urdf, packages, kind) for kind in kinds]
    except (ValueError, RuntimeError) as error:
        missing = re.search(r"Could not load resource (\S+)|(package://\S+|\S+) could not be found", str(error))
        what = next(filter(None, missing.groups())) if missing else " ".join(str(error).split())
        raise InvalidValueError("urdf", urdf.name, f"a mesh cannot be read: {what}; {_remedy(what)}") from error
    collision, visual = shapes
    moved = {shape.parentJoint for shape in collision.geometryObjects}
    return collision if all(leg.foot in moved for leg in legs) else visual


def _remedy(address: str) -> str:
    """Advice about the address of a mesh that cannot be read."""
    scheme, mark, path = address.partition("://")
    package, _, _ = path.partition("/")
    if mark and scheme in ("package", "model") and package:
        return f"--packages names the folder that has {package} in it"
    return "put the file there, or name it right in the URDF"


def shape_points(shape: pin.GeometryObject) -> Matrix:
    """Points of a shape that may touch the ground, in the frame of its joint, shape (P, 3) [m]."""
    geometry, placement = shape.geometry, shape.placement
    if isinstance(geometry, coal.BVHModelBase):
        vertices = np.array(geometry.vertices()) * np.ravel(shape.meshScale)
    elif isinstance(geometry, coal.Box):
        half = np.array(geometry.halfSide)
        vertices = half * np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    elif isinstance(geometry, coal.Sphere):  # of the way down, only the lowest point
        centre = placement.translation
        return np.array([centre - placement.rotation @ [0.0, 0.0, geometry.radius]])
    else:  # a cylinder or a capsule
        geometry.computeLocalAABB()
        low, high = np.array(geometry.aabb_local.min_), np.array(geometry.aabb_local.max_)
        vertices = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    return vertices @ placement.rotation.T + placement.translation


def _hull(points: Matrix) -> Matrix | None:
    try:
        return points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        return None
