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
from mcap.writer import CompressionType, Writer

from app.drawing import palette
from app.drawing.outlines import support_polygon
from app.formats import COUNTS, unit
from app.formats import foxglove as fg
from walkcore import Recording, Snapshot
from walkcore.mpc.stance import Footstep, Side, sole_vertices
from walkcore.robot import BodyModel
from walkcore.scenario.replay import replayed

FRAME_PERIOD = 1 / 30  # [s] of the scene
LIBRARY = "walk"
GREYS = {Side.LEFT: palette.LEFT_FOOT, Side.RIGHT: palette.RIGHT_FOOT}
PUSH_LENGTH = 0.02  # [m per N s] of its arrow

Message = tuple[int, str, fg.Json]  # [ns], topic, content


def write(recording: Recording, run_json: str, path: Path) -> None:
    """Write a recording and its run.json."""
    schemas = fg.SCHEMAS | {"walk.Row": _row_schema(recording)}
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="", library=LIBRARY)
        ids = {
            name: writer.register_schema(name, "jsonschema", _json(schema).encode()) for name, schema in schemas.items()
        }
        channels = {topic: writer.register_channel(topic, "json", ids[name]) for topic, name in _topics(recording)}
        for sequence, (at, topic, content) in enumerate(_messages(recording)):
            writer.add_message(channels[topic], at, _json(content).encode(), at, sequence)
        writer.add_attachment(0, 0, "run.json", "application/json", run_json.encode())
        writer.finish()


def _topics(recording: Recording) -> Iterator[tuple[str, str]]:
    """Each topic with the name of its schema."""
    yield "/walk/row", "walk.Row"
    yield "/tf", "foxglove.FrameTransforms"
    yield "/walk/scene", "foxglove.SceneUpdate"
    yield "/walk/footholds", "foxglove.PosesInFrame"
    yield "/walk/com", "foxglove.PoseInFrame"
    yield "/walk/cop", "foxglove.PoseInFrame"
    if recording.scenario.robot.body is not None:
        yield "/walk/true_cop", "foxglove.PoseInFrame"
        yield "/walk/joints", "foxglove.JointStates"


def _row_schema(recording: Recording) -> fg.Json:
    properties = {
        name: {"type": "integer" if name in COUNTS else ["number", "null"], "description": unit(name)}
        for name in recording.columns
    }
    return {"title": "walk.Row", "type": "object", "properties": properties}


def _messages(recording: Recording) -> Iterator[Message]:
    """All messages in the order of time."""
    every = max(1, round(FRAME_PERIOD / float(recording.parameters["control_period"])))
    frames = replayed(recording, every)
    body = recording.scenario.robot.body
    links = None if body is None else _Links(body)
    whole = [name in COUNTS for name in recording.columns]
    for k, numbers in enumerate(recording.rows):
        values = {
            name: int(value) if is_whole else value if math.isfinite(value) else None
            for name, value, is_whole in zip(recording.columns, numbers.tolist(), whole, strict=True)
        }
        at = round(numbers[1] * 1e9)
        yield at, "/walk/row", values
        if links is not None:
            yield at, "/walk/joints", links.joint_states(at, values)
        if k % every == 0:
            yield from _frame(at, next(frames), recording, links)


def _frame(at: int, s: Snapshot, recording: Recording, links: "_Links | None") -> Iterator[Message]:
    """What a screen shows of one tick."""
    now = fg.time(at)
    in_world = {"timestamp": now, "frame_id": fg.WORLD}
    com = (*s.com.position, s.com_height)
    frames = [fg.transform(now, "com", fg.xyz(com), fg.upright(s.heading))]
    for side, foot in s.feet.items():
        name = f"{side.name.lower()}_foot"
        frames.append(fg.transform(now, name, fg.xyz((*foot.position, foot.height)), fg.upright(foot.yaw)))
    if links is not None and s.q is not None:
        frames += links.transforms(now, s.q)
    yield at, "/tf", {"transforms": frames}
    yield at, "/walk/scene", {"deletions": [], "entities": list(_entities(now, s, recording))}
    footholds = () if s.plan is None else s.plan.footholds
    yield at, "/walk/footholds", in_world | {"poses": [fg.on_ground(f.position, f.yaw) for f in footholds]}
    yield at, "/walk/com", in_world | {"pose": fg.pose(com, s.heading)}
    yield at, "/walk/cop", in_world | {"pose": fg.on_ground(s.cop)}
    if s.true_cop is not None:
        yield at, "/walk/true_cop", in_world | {"pose": fg.on_ground(s.true_cop)}


def _entities(now: fg.Json, s: Snapshot, recording: Recording) -> Iterator[fg.Json]:
    sole = np.array(recording.parameters["sole"]["polygon"])
    for side, foot in s.feet.items():
        corners = sole_vertices(sole, Footstep(side, foot.position, foot.yaw))
        lines, triangles = fg.patch(corners, foot.height, GREYS[side], 0.8)
        yield fg.entity(now, f"{side.name.lower()}_sole", lines=lines, triangles=triangles)
    footholds = () if s.plan is None else s.plan.footholds
    for number in (0, 1):
        outline = [
            fg.patch(sole_vertices(sole, foot), 0.002, GREYS[foot.side], 0.2)[0][0]
            for foot in footholds[number : number + 1]
        ]
        yield fg.entity(now, f"foothold_{number + 1}", lines=outline)
    lines, triangles = fg.patch(support_polygon(recording.scenario.robot, s), 0.001, palette.SUPPORT, 0.3)
    yield fg.entity(now, "support_polygon", lines=lines, triangles=triangles)
    yield fg.entity(now, "com", spheres=[fg.sphere((*s.com.position, s.com_height), 0.09, palette.COM)])
    yield fg.entity(now, "cop", spheres=[fg.sphere((*s.cop, 0.01), 0.04, palette.COP)])
    if s.true_cop is not None:
        yield fg.entity(now, "true_cop", spheres=[fg.sphere((*s.true_cop, 0.01), 0.03, palette.TRUE_COP)])
    yield fg.entity(now, "push", arrows=list(_push_arrow(s, recording)))


def _push_arrow(s: Snapshot, recording: Recording) -> Iterator[fg.Json]:
    """The push of the last half second, if there was one: a frame would miss one that lasts a tick."""
    period = float(recording.parameters["control_period"])
    k = s.tick - int(recording.rows[0, 0])
    recent = slice(max(0, k - round(0.5 / period)), k + 1)
    x, y = float(recording["push_x"][recent].sum()), float(recording["push_y"][recent].sum())
    strength = math.hypot(x, y)
    if strength > 0.0:
        length, yaw = PUSH_LENGTH * strength, math.atan2(y, x)
        start = s.com.position - length * np.array([x, y]) / strength
        yield fg.arrow((*start, 1.2 * s.com_height), yaw, length, palette.PUSH)


class _Links:
    """Forward kinematics of a body."""

    def __init__(self, body: BodyModel) -> None:
        """Load the model."""
        self._model = pin.buildModelFromUrdf(str(body.urdf), pin.JointModelFreeFlyer())
        self._data = self._model.createData()
        self._links = [(i, frame.name) for i, frame in enumerate(self._model.frames) if self._is_link(i)]
        self._joints = list(self._model.names[2:])

    def _is_link(self, frame: int) -> bool:
        return self._model.frames[frame].type == pin.FrameType.BODY

    def joint_states(self, at: int, row: dict[str, Any]) -> fg.Json:
        """Angles of a row."""
        angles = (row[f"q_{7 + i}"] for i in range(len(self._joints)))
        joints = [{"name": name, "position": q} for name, q in zip(self._joints, angles, strict=True)]
        return {"timestamp": fg.time(at), "joints": joints}

    def transforms(self, now: fg.Json, q: np.ndarray) -> Iterable[fg.Json]:
        """Where the links are, by their names in the URDF."""
        pin.framesForwardKinematics(self._model, self._data, q)
        for frame, name in self._links:
            x, y, z, qx, qy, qz, qw = pin.SE3ToXYZQUAT(self._data.oMf[frame]).tolist()
            yield fg.transform(now, name, fg.xyz((x, y, z)), {"x": qx, "y": qy, "z": qz, "w": qw})


def _json(content: fg.Json) -> str:
    return json.dumps(content, separators=(",", ":"), allow_nan=False)
