"""MCAP for Foxglove: every column of every tick, and a scene at the rate of a screen.

    /walk/row        all columns, each tick; NaN is null
    /walk/joints     foxglove.JointStates, each tick
    /tf              foxglove.FrameTransforms: links of the URDF, soles, CoM
    /walk/scene      foxglove.SceneUpdate: soles, footholds, support polygon, CoM, CoP, push
    /walk/com, /walk/cop, /walk/true_cop    foxglove.PoseInFrame
    /walk/footholds  foxglove.PosesInFrame

run.json is attached. Time is the recording's: it starts near zero, at 1970.
"""

import json
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports] (its wheel is found through a .pth file)
from foxglove_schemas_protobuf.ArrowPrimitive_pb2 import ArrowPrimitive
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointState_pb2 import JointState
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import register_schema

from app.drawing import palette
from app.formats import COUNTS, unit
from app.formats import foxglove as fg
from walkcore import Recording, Snapshot
from walkcore.motion.body_model import load_model
from walkcore.mpc.stance import Footstep, Side, sole_vertices
from walkcore.robot import BodyModel
from walkcore.scenario.replay import replayed

FRAME_PERIOD = 1 / 30  # [s] of the scene
LIBRARY = "walk"
GREYS = {Side.LEFT: palette.LEFT_FOOT, Side.RIGHT: palette.RIGHT_FOOT}
PUSH_LENGTH = 0.02  # [m per N s] of its arrow
PUSH_SHOWN = 0.5  # [s] for which the arrow of a push is seen
TOPICS: dict[str, type[Message]] = {
    "/tf": FrameTransforms,
    "/walk/scene": SceneUpdate,
    "/walk/footholds": PosesInFrame,
    "/walk/com": PoseInFrame,
    "/walk/cop": PoseInFrame,
}
TOPICS_OF_BODY: dict[str, type[Message]] = {"/walk/true_cop": PoseInFrame, "/walk/joints": JointStates}

Row = dict[str, int | float | None]


def write(recording: Recording, run_json: str, path: Path) -> None:
    """Write a recording and its run.json."""
    topics = TOPICS | ({} if recording.scenario.robot.body is None else TOPICS_OF_BODY)
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="", library=LIBRARY)
        row_schema = writer.register_schema("walk.Row", "jsonschema", _json(_row_schema(recording)))
        channels = {"/walk/row": writer.register_channel("/walk/row", "json", row_schema)}
        schemas = {kind: register_schema(writer, kind) for kind in dict.fromkeys(topics.values())}
        for topic, kind in topics.items():
            channels[topic] = writer.register_channel(topic, "protobuf", schemas[kind])
        for sequence, (at, topic, content) in enumerate(_messages(recording)):
            data = content.SerializeToString() if isinstance(content, Message) else _json(content)
            writer.add_message(channels[topic], at, data, at, sequence)
        writer.add_attachment(0, 0, "run.json", "application/json", run_json.encode())
        writer.finish()


def _row_schema(recording: Recording) -> dict[str, Any]:
    properties = {
        name: {"type": "integer" if name in COUNTS else ["number", "null"], "description": unit(name)}
        for name in recording.columns
    }
    return {"title": "walk.Row", "type": "object", "properties": properties}


def _messages(recording: Recording) -> Iterator[tuple[int, str, Message | Row]]:
    """Time [ns], topic and content of all messages, in the order of time."""
    every = max(1, round(FRAME_PERIOD / float(recording.parameters["control_period"])))
    frames = replayed(recording, every)
    body = recording.scenario.robot.body
    links = None if body is None else _Links(body)
    are_counts = [name in COUNTS for name in recording.columns]
    for k, numbers in enumerate(recording.rows):
        row: Row = {
            name: int(value) if is_count else value if math.isfinite(value) else None
            for name, value, is_count in zip(recording.columns, numbers.tolist(), are_counts, strict=True)
        }
        at = round(numbers[1] * 1e9)
        yield at, "/walk/row", row
        if links is not None:
            yield at, "/walk/joints", links.joint_states(fg.timestamp(at), row)
        if k % every == 0:
            for topic, message in _frame(fg.timestamp(at), next(frames), recording, links):
                yield at, topic, message


def _frame(now: Timestamp, s: Snapshot, recording: Recording, links: "_Links | None") -> Iterator[tuple[str, Message]]:
    """Messages about one frame, by their topics."""
    com = (*s.com.position, s.com_height)
    frames = [fg.transform(now, "com", com, fg.upright(s.heading))]
    for side, foot in s.feet.items():
        name = f"{side.name.lower()}_foot"
        frames.append(fg.transform(now, name, (*foot.position, foot.height), fg.upright(foot.yaw)))
    if links is not None and s.q is not None:
        frames += links.transforms(now, s.q)
    yield "/tf", FrameTransforms(transforms=frames)
    yield "/walk/scene", SceneUpdate(entities=list(_entities(now, s, recording)))
    places = [fg.on_ground(foot.position, foot.yaw) for foot in ([] if s.plan is None else s.plan.footholds)]
    yield "/walk/footholds", PosesInFrame(timestamp=now, frame_id=fg.WORLD, poses=places)
    yield "/walk/com", PoseInFrame(timestamp=now, frame_id=fg.WORLD, pose=fg.pose(com, s.heading))
    yield "/walk/cop", PoseInFrame(timestamp=now, frame_id=fg.WORLD, pose=fg.on_ground(s.cop))
    if s.true_cop is not None:
        yield "/walk/true_cop", PoseInFrame(timestamp=now, frame_id=fg.WORLD, pose=fg.on_ground(s.true_cop))


def _entities(now: Timestamp, s: Snapshot, recording: Recording) -> Iterator[SceneEntity]:
    sole = recording.scenario.robot.sole
    for side, foot in s.feet.items():
        corners, grey = sole_vertices(sole, Footstep(side, foot.position, foot.yaw)), GREYS[side]
        lines, triangles = [fg.outline(corners, foot.height, grey)], [fg.area(corners, foot.height, grey, 0.8)]
        yield fg.entity(now, f"{side.name.lower()}_sole", lines=lines, triangles=triangles)
    footholds = () if s.plan is None else s.plan.footholds
    for number in (0, 1):
        planned = footholds[number : number + 1]
        lines = [fg.outline(sole_vertices(sole, foot), 0.002, GREYS[foot.side]) for foot in planned]
        yield fg.entity(now, f"foothold_{number + 1}", lines=lines)
    support = s.stance.polygon
    lines, triangles = [fg.outline(support, 0.001, palette.SUPPORT)], [fg.area(support, 0.001, palette.SUPPORT, 0.3)]
    yield fg.entity(now, "support_polygon", lines=lines, triangles=triangles)
    yield fg.entity(now, "com", spheres=[fg.sphere((*s.com.position, s.com_height), 0.09, palette.COM)])
    yield fg.entity(now, "cop", spheres=[fg.sphere((*s.cop, 0.01), 0.04, palette.COP)])
    if s.true_cop is not None:
        yield fg.entity(now, "true_cop", spheres=[fg.sphere((*s.true_cop, 0.01), 0.03, palette.TRUE_COP)])
    yield fg.entity(now, "push", arrows=list(_push_arrow(s, float(recording.parameters["control_period"]))))


def _push_arrow(s: Snapshot, period: float) -> Iterator[ArrowPrimitive]:
    """The latest push, for a while: a frame would miss one that lasts a tick."""
    if s.last_push is None or (s.tick - s.last_push.tick) * period > PUSH_SHOWN + s.last_push.duration:
        return
    x, y = s.last_push.impulse
    strength = math.hypot(x, y)
    length, yaw = PUSH_LENGTH * strength, math.atan2(y, x)
    start = s.com.position - length * np.array([x, y]) / strength
    yield fg.arrow((*start, 1.2 * s.com_height), yaw, length, palette.PUSH)


class _Links:
    """Forward kinematics of a body."""

    def __init__(self, body: BodyModel) -> None:
        """Load the model."""
        self._model = load_model(body)
        self._data = self._model.createData()
        self._links = [(i, frame.name) for i, frame in enumerate(self._model.frames) if self._is_link(i)]
        self._joints = list(self._model.names[2:])

    def _is_link(self, frame: int) -> bool:
        return self._model.frames[frame].type == pin.FrameType.BODY

    def joint_states(self, now: Timestamp, row: Row) -> JointStates:
        """Angles of the joints in a row."""
        angles = (row[f"q_{7 + i}"] for i in range(len(self._joints)))
        joints = [JointState(name=name, position=q) for name, q in zip(self._joints, angles, strict=True)]
        return JointStates(timestamp=now, joints=joints)

    def transforms(self, now: Timestamp, q: np.ndarray) -> Iterable[FrameTransform]:
        """Places of the links, by their names in the URDF."""
        pin.framesForwardKinematics(self._model, self._data, q)
        for frame, name in self._links:
            x, y, z, qx, qy, qz, qw = pin.SE3ToXYZQUAT(self._data.oMf[frame]).tolist()
            yield fg.transform(now, name, (x, y, z), Quaternion(x=qx, y=qy, z=qz, w=qw))


def _json(content: Any) -> bytes:
    return json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
