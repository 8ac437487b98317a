"""The robot itself: its meshes where Pinocchio's forward kinematics puts them, or a point mass on two legs."""

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports] (its wheel is found through a .pth file)
import trimesh
import viser
from viser import _messages

from app.drawing.palette import COM, FALLEN, LEFT_FOOT, RIGHT_FOOT, Colour, mixed
from app.viewer.scene.joints import joint_of
from app.viewer.scene.robot_mesh import BodyPart, body_parts
from app.viewer.scene.shapes import plate
from app.viewer.transport.stream import Stream
from walkcore import Robot, Snapshot
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Side, mirrored
from walkcore.robot import BodyModel

SEE_THROUGH = 0.3  # opacity
FEET = 0.45  # opacity: the centres of pressure lie below them
FALLEN_SHARE = 0.6  # of the colour of a fallen robot
FOOT_THICKNESS = 0.03  # [m] of the plates that stand for feet


class RobotDrawing(Protocol):
    """Whatever draws the robot of a snapshot."""

    meshes: list[viser.MeshHandle]
    """What a hand can take hold of."""

    def update(self, stream: Stream, snapshot: Snapshot) -> None:
        """Put the robot where the snapshot says."""
        ...

    def see_through(self, stream: Stream, is_see_through: bool) -> None:
        """Let the centre of mass show through the robot, or not."""
        ...


def draw_robot(server: viser.ViserServer, root: str, robot: Robot, face_ratio: float) -> RobotDrawing:
    """The drawing that fits a robot, below the node `root`."""
    if robot.body is None:
        return PointMassDrawing(server, root, robot)
    return BodyDrawing(server, root, robot.body, face_ratio)


class BodyDrawing:
    """The visual meshes of a whole body."""

    def __init__(self, server: viser.ViserServer, root: str, body: BodyModel, face_ratio: float) -> None:
        """Load and send the meshes once."""
        model = pin.buildModelFromUrdf(str(body.urdf), pin.JointModelFreeFlyer())
        self._parts: dict[str, Colour] = {}
        self._opacity: dict[str, float | None] = {}
        feet = {model.frames[model.getFrameId(body.sole(side))].parentJoint for side in Side}
        self._has_fallen = False
        parts = body_parts(body, model, face_ratio)
        joints = _add_joints(server, root, model, {part.joint for part in parts})
        self._joints = {name: joint_of(model, joint) for joint, name in joints.items()}
        self.meshes: list[viser.MeshHandle] = []
        for index, part in enumerate(parts):
            name = f"{joints[part.joint]}/{index}"
            self._parts[name], self._opacity[name] = part.colour, FEET if part.joint in feet else None
            self.meshes.append(_add_part(server, name, part, self._opacity[name]))

    def update(self, stream: Stream, snapshot: Snapshot) -> None:
        """Put every link where forward kinematics says."""
        if snapshot.q is None:
            return
        q: list[float] = snapshot.q.tolist()
        for node, joint in self._joints.items():
            joint.move(stream, node, q)
        has_fallen = snapshot.status is Status.FALLEN
        if has_fallen is not self._has_fallen:
            self._has_fallen = has_fallen
            for name, colour in self._parts.items():
                stream.properties(name, color=mixed(colour, FALLEN, FALLEN_SHARE * has_fallen))

    def see_through(self, stream: Stream, is_see_through: bool) -> None:
        """Make the meshes translucent, or solid again."""
        for name, solid in self._opacity.items():
            stream.properties(name, opacity=SEE_THROUGH if is_see_through else solid, cast_shadow=not is_see_through)


def _add_joints(server: viser.ViserServer, root: str, model: Any, seen: set[int]) -> dict[int, str]:
    """A frame for each joint that moves something to be seen, within that of its parent joint.

    So a revolute joint only turns, and its place in the parent's frame need not be sent.
    """
    parents = list(model.parents)
    chains = {joint for last in seen for joint in _ancestry(parents, last)}
    names = {0: root}
    for joint in sorted(chains):  # parents come first in Pinocchio
        names[joint] = f"{names[parents[joint]]}/j{joint}"
        server.scene.add_frame(names[joint], show_axes=False, position=tuple(model.jointPlacements[joint].translation))
    return {joint: names[joint] for joint in sorted(chains)}


def _add_part(server: viser.ViserServer, name: str, part: BodyPart, opacity: float | None) -> viser.MeshHandle:
    """Add a part as `add_mesh_simple` does, but in whole numbers: half the bytes."""
    vertices, faces, step = part.quantised()
    message = _messages.MeshMessage(
        name,
        _messages.MeshProps(
            vertices=vertices,  # pyright: ignore[reportArgumentType]  # any type of three.js does
            faces=faces,  # pyright: ignore[reportArgumentType]
            color=part.colour,
            wireframe=False,
            opacity=opacity,
            flat_shading=False,
            side="double",  # shells of one layer, seen from inside where they are open
            material="standard",
            scale=step,
            cast_shadow=True,
            receive_shadow=False,
        ),
    )
    return viser.MeshHandle._make(server.scene, message, name, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), True)


def _ancestry(parents: Sequence[int], joint: int) -> Iterator[int]:
    """A joint and those that carry it, without the world."""
    while joint:
        yield joint
        joint = parents[joint]


class PointMassDrawing:
    """A robot without a body, as in the paper's figures: a mass, two legs, two soles."""

    def __init__(self, server: viser.ViserServer, root: str, robot: Robot) -> None:
        """Make the nodes once."""
        self._mass, self._legs = f"{root}/mass", f"{root}/legs"
        self._feet = {side: f"{root}/{side.name.lower()}_foot" for side in Side}
        ball = trimesh.creation.icosphere(subdivisions=3, radius=0.09)
        self.meshes = [server.scene.add_mesh_simple(self._mass, ball.vertices, ball.faces, color=COM)]
        server.scene.add_line_segments(self._legs, np.zeros((2, 2, 3)), colors=LEFT_FOOT, thickness=0.03)
        for side, colour in ((Side.LEFT, LEFT_FOOT), (Side.RIGHT, RIGHT_FOOT)):
            sole = robot.sole if side is Side.LEFT else mirrored(robot.sole)
            server.scene.add_mesh_simple(self._feet[side], *plate(sole, FOOT_THICKNESS), color=colour)

    def update(self, stream: Stream, snapshot: Snapshot) -> None:
        """Put mass, legs and soles in place."""
        com = np.array([*snapshot.com.position, snapshot.com_height])
        stream.position(self._mass, com)
        legs = []
        for side, foot in snapshot.feet.items():
            sole = np.array([*foot.position, foot.height])
            legs.append((com, sole + [0.0, 0.0, FOOT_THICKNESS]))
            stream.on_ground(self._feet[side], foot.position, foot.yaw, foot.height)
        stream.properties(self._legs, points=np.array(legs, dtype=np.float32))
        stream.properties(self._mass, color=FALLEN if snapshot.status is Status.FALLEN else COM)

    def see_through(self, stream: Stream, is_see_through: bool) -> None:
        """Nothing hides the mass of this robot."""
