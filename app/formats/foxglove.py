"""Messages by the well-known schemas of Foxglove, as JSON: names and fields are theirs.

https://docs.foxglove.dev/docs/sdk/schemas
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

from walkcore.values import Matrix

Json = dict[str, Any]
WORLD = "world"

NUMBER, TEXT = {"type": "number"}, {"type": "string"}


def _object(title: str = "", **properties: Json) -> Json:
    return {"type": "object", "properties": properties} | ({"title": title} if title else {})


def _list(items: Json) -> Json:
    return {"type": "array", "items": items}


_TIME = {
    "title": "time",
    "type": "object",
    "properties": {"sec": {"type": "integer", "minimum": 0}, "nsec": {"type": "integer", "minimum": 0}},
}
_DURATION = _TIME | {"title": "duration"}
_VECTOR = _object("foxglove.Vector3", x=NUMBER, y=NUMBER, z=NUMBER)
_POINT = _object("foxglove.Point3", x=NUMBER, y=NUMBER, z=NUMBER)
_QUATERNION = _object("foxglove.Quaternion", x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
_POSE = _object("foxglove.Pose", position=_VECTOR, orientation=_QUATERNION)
_COLOUR = _object("foxglove.Color", r=NUMBER, g=NUMBER, b=NUMBER, a=NUMBER)
_SPHERE = _object("foxglove.SpherePrimitive", pose=_POSE, size=_VECTOR, color=_COLOUR)
_ARROW = _object(
    "foxglove.ArrowPrimitive",
    pose=_POSE,
    shaft_length=NUMBER,
    shaft_diameter=NUMBER,
    head_length=NUMBER,
    head_diameter=NUMBER,
    color=_COLOUR,
)
_LINE = _object(
    "foxglove.LinePrimitive",
    type={"type": "integer"},
    pose=_POSE,
    thickness=NUMBER,
    scale_invariant={"type": "boolean"},
    points=_list(_POINT),
    color=_COLOUR,
    colors=_list(_COLOUR),
    indices=_list({"type": "integer"}),
)
_TRIANGLES = _object(
    "foxglove.TriangleListPrimitive",
    pose=_POSE,
    points=_list(_POINT),
    color=_COLOUR,
    colors=_list(_COLOUR),
    indices=_list({"type": "integer"}),
)
_ANYTHING = _list({"type": "object"})  # kinds of primitives that are not used here
_ENTITY = _object(
    "foxglove.SceneEntity",
    timestamp=_TIME,
    frame_id=TEXT,
    id=TEXT,
    lifetime=_DURATION,
    frame_locked={"type": "boolean"},
    metadata=_list(_object("foxglove.KeyValuePair", key=TEXT, value=TEXT)),
    arrows=_list(_ARROW),
    cubes=_ANYTHING,
    spheres=_list(_SPHERE),
    cylinders=_ANYTHING,
    lines=_list(_LINE),
    triangles=_list(_TRIANGLES),
    texts=_ANYTHING,
    models=_ANYTHING,
)
_DELETION = _object("foxglove.SceneEntityDeletion", timestamp=_TIME, type={"type": "integer"}, id=TEXT)
_TRANSFORM = _object(
    "foxglove.FrameTransform",
    timestamp=_TIME,
    parent_frame_id=TEXT,
    child_frame_id=TEXT,
    translation=_VECTOR,
    rotation=_QUATERNION,
)
_JOINT = _object("foxglove.JointState", name=TEXT, position=NUMBER)

SCHEMAS: dict[str, Json] = {
    schema["title"]: schema
    for schema in (
        _object("foxglove.PoseInFrame", timestamp=_TIME, frame_id=TEXT, pose=_POSE),
        _object("foxglove.PosesInFrame", timestamp=_TIME, frame_id=TEXT, poses=_list(_POSE)),
        _object("foxglove.FrameTransforms", transforms=_list(_TRANSFORM)),
        _object("foxglove.JointStates", timestamp=_TIME, joints=_list(_JOINT)),
        _object("foxglove.SceneUpdate", deletions=_list(_DELETION), entities=_list(_ENTITY)),
    )
}
"""JSON schemas by name."""


def time(nanoseconds: int) -> Json:
    """A moment."""
    return {"sec": nanoseconds // 10**9, "nsec": nanoseconds % 10**9}


def xyz(place: Iterable[float]) -> Json:
    """A vector or a point, shape (3,)."""
    return dict(zip("xyz", map(float, place), strict=True))


def pose(place: Iterable[float], yaw: float = 0.0) -> Json:
    """A place, shape (3,) [m], turned about the vertical by `yaw` [rad]."""
    return {"position": xyz(place), "orientation": upright(yaw)}


def on_ground(place: Iterable[float], yaw: float = 0.0) -> Json:
    """A place on the ground, shape (2,) [m], turned about the vertical by `yaw` [rad]."""
    return pose((*place, 0.0), yaw)


def upright(yaw: float) -> Json:
    """A quaternion about the vertical."""
    return {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}


def colour(rgb: Sequence[int], opacity: float = 1.0) -> Json:
    """A colour of the palette."""
    r, g, b = (value / 255 for value in rgb)
    return {"r": r, "g": g, "b": b, "a": opacity}


def transform(at: Json, child: str, translation: Json, rotation: Json) -> Json:
    """Where a frame is in the world."""
    return {
        "timestamp": at,
        "parent_frame_id": WORLD,
        "child_frame_id": child,
        "translation": translation,
        "rotation": rotation,
    }


def entity(at: Json, name: str, **primitives: list[Json]) -> Json:
    """Something in the scene, which replaces what had that name before; with no primitives it takes it away."""
    kinds = ("metadata", "arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    return {
        "timestamp": at,
        "frame_id": WORLD,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": False,
        **{kind: primitives.get(kind, []) for kind in kinds},
    }


def sphere(place: Iterable[float], diameter: float, rgb: Sequence[int]) -> Json:
    """A ball around a point, shape (3,) [m]."""
    return {"pose": pose(place), "size": xyz([diameter] * 3), "color": colour(rgb)}


def arrow(place: Iterable[float], yaw: float, length: float, rgb: Sequence[int]) -> Json:
    """A level arrow from a point, shape (3,) [m]."""
    shaft, head = 0.75 * length, 0.25 * length
    return {
        "pose": pose(place, yaw),
        "shaft_length": shaft,
        "shaft_diameter": 0.03,
        "head_length": head,
        "head_diameter": 0.07,
        "color": colour(rgb),
    }


def patch(corners: Matrix, height: float, rgb: Sequence[int], opacity: float) -> tuple[list[Json], list[Json]]:
    """A convex polygon, shape (V, 2) and in order, as an outline and as triangles: `lines` and `triangles`."""
    points = [xyz((*corner, height)) for corner in corners.tolist()]
    plain: Json = {"pose": on_ground((0.0, 0.0)), "points": points, "colors": []}
    outline = plain | {"type": 1, "thickness": 2.0, "scale_invariant": True, "color": colour(rgb), "indices": []}
    return [outline], [plain | {"color": colour(rgb, opacity), "indices": list(_fan(len(points)))}]


def _fan(nb_corners: int) -> Iterable[int]:
    for i in range(1, nb_corners - 1):
        yield from (0, i, i + 1)
