"""Messages of Foxglove's well-known schemas, from its own package, for what is drawn of a walk.

https://docs.foxglove.dev/docs/sdk/schemas
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

from foxglove_schemas_protobuf.ArrowPrimitive_pb2 import ArrowPrimitive
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from walkcore.values import Matrix

WORLD = "world"


def timestamp(nanoseconds: int) -> Timestamp:
    """A time since 1970 [ns]."""
    return Timestamp(seconds=nanoseconds // 10**9, nanos=nanoseconds % 10**9)


def vector(place: Iterable[float]) -> Vector3:
    """A vector, shape (3,)."""
    x, y, z = map(float, place)
    return Vector3(x=x, y=y, z=z)


def upright(yaw: float) -> Quaternion:
    """A turn about the vertical [rad]."""
    return Quaternion(z=math.sin(yaw / 2), w=math.cos(yaw / 2))


def pose(place: Iterable[float], yaw: float = 0.0) -> Pose:
    """A place, shape (3,) [m], turned about the vertical by `yaw` [rad]."""
    return Pose(position=vector(place), orientation=upright(yaw))


def on_ground(place: Iterable[float], yaw: float = 0.0) -> Pose:
    """A place on the ground, shape (2,) [m], turned about the vertical by `yaw` [rad]."""
    return pose((*place, 0.0), yaw)


def colour(rgb: Sequence[int], opacity: float = 1.0) -> Color:
    """A colour of the palette."""
    r, g, b = (value / 255 for value in rgb)
    return Color(r=r, g=g, b=b, a=opacity)


def transform(now: Timestamp, child: str, place: Iterable[float], rotation: Quaternion) -> FrameTransform:
    """The place of a frame in the world.

    Args:
        now: time of the place.
        child: name of the frame.
        place: of its origin [m], shape (3,).
        rotation: of its axes.
    """
    return FrameTransform(
        timestamp=now, parent_frame_id=WORLD, child_frame_id=child, translation=vector(place), rotation=rotation
    )


def entity(now: Timestamp, name: str, **primitives: Any) -> SceneEntity:
    """A part of the scene, which replaces the one that had that name before; without primitives it removes it."""
    return SceneEntity(timestamp=now, frame_id=WORLD, id=name, **primitives)


def sphere(place: Iterable[float], diameter: float, rgb: Sequence[int]) -> SpherePrimitive:
    """A ball around a point, shape (3,) [m]."""
    return SpherePrimitive(pose=pose(place), size=vector([diameter] * 3), color=colour(rgb))


def arrow(place: Iterable[float], yaw: float, length: float, rgb: Sequence[int]) -> ArrowPrimitive:
    """A level arrow from a point, shape (3,) [m], in a direction [rad]."""
    return ArrowPrimitive(
        pose=pose(place, yaw),
        shaft_length=0.75 * length,
        shaft_diameter=0.03,
        head_length=0.25 * length,
        head_diameter=0.07,
        color=colour(rgb),
    )


def outline(corners: Matrix, height: float, rgb: Sequence[int]) -> LinePrimitive:
    """The outline of a convex polygon, shape (V, 2) and in order [m]."""
    return LinePrimitive(
        type=LinePrimitive.LINE_LOOP,
        pose=on_ground((0.0, 0.0)),
        thickness=2.0,
        scale_invariant=True,
        points=_points(corners, height),
        color=colour(rgb),
    )


def area(corners: Matrix, height: float, rgb: Sequence[int], opacity: float) -> TriangleListPrimitive:
    """The area of a convex polygon, shape (V, 2) and in order [m]."""
    fan = [corner for i in range(1, len(corners) - 1) for corner in (0, i, i + 1)]
    return TriangleListPrimitive(
        pose=on_ground((0.0, 0.0)), points=_points(corners, height), color=colour(rgb, opacity), indices=fan
    )


def _points(corners: Matrix, height: float) -> list[Point3]:
    return [Point3(x=x, y=y, z=height) for x, y in corners.tolist()]
