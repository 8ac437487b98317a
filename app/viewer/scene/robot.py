"""Robot itself: its meshes where forward kinematics puts them, or a point mass on two legs."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import trimesh
import viser

from app.drawing.palette import COM, FALLEN, LEFT_FOOT, Colour, mixed
from app.viewer.scene.footprints import GREYS, sole_outline
from app.viewer.scene.frame import Canvas, Drawing, Frame
from app.viewer.scene.joints import joint_of
from app.viewer.scene.primitives import plate
from app.viewer.scene.robot_mesh import drawn_height, shared_parts
from app.viewer.transport.scene_updates import SceneUpdates
from app.viewer.transport.viser_private import add_mesh
from walkcore.motion.body_model import load_model
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Side
from walkcore.robot import BodyModel

TRANSLUCENT = 0.3  # opacity
FALLEN_SHARE = 0.6  # of the colour of a fallen robot
LYING = 1.5  # [rad] of a body that lies
FIRST_TILT = 0.15  # [rad] from which a fall begins
THICKNESS = 0.16  # [m] from the edge of the support to what lies on the ground
MAX_FALL_STEP = 0.05  # [s] of a frame
FOOT_THICKNESS = 0.03  # [m] of the plates that stand for feet


def robot_drawing(canvas: Canvas) -> Drawing:
    """Drawing that fits the robot of a canvas."""
    body = canvas.robot.body
    return PointMassDrawing(canvas) if body is None else BodyDrawing(canvas, body)


class BodyDrawing:
    """Visual meshes of a whole body."""

    def __init__(self, canvas: Canvas, body: BodyModel) -> None:
        """Load and send the meshes once."""
        model = load_model(body)
        self._colours: dict[str, Colour] = {}
        self._has_fallen: bool | None = None
        self._topple = Topple(canvas.root)
        parts = shared_parts(body, canvas.quality.face_ratio)
        self.height = drawn_height(parts, model, model.referenceConfigurations["posture"])
        """From the lowest point to the highest one in its posture [m]."""
        nodes = add_joints(canvas.server, canvas.root, model, {part.joint for part in parts})
        self._joints = {name: joint_of(model, joint) for joint, name in nodes.items()}
        for index, part in enumerate(parts):
            name = f"{nodes[part.joint]}/{index}"
            self._colours[name] = part.colour
            mesh = add_mesh(
                canvas.server.scene,
                name,
                *part.quantised(),
                color=part.colour,
                opacity=None,
                side="double",  # shells of one layer, seen from inside where they are open
                cast_shadow=True,
                receive_shadow=False,
            )
            canvas.draggable.append(mesh)
            canvas.translucent[name] = None
            canvas.links[name] = model.names[part.joint]

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Put every link where forward kinematics says, in the colours of its state."""
        snapshot = frame.snapshot
        if snapshot.q is not None:
            q: list[float] = snapshot.q.tolist()
            for node, joint in self._joints.items():
                joint.move(updates, node, q)
        self._topple.update(updates, frame)
        has_fallen = snapshot.status is Status.FALLEN
        if has_fallen is not self._has_fallen:
            self._has_fallen = has_fallen
            for name, colour in self._colours.items():
                updates.properties(name, color=mixed(colour, FALLEN, FALLEN_SHARE * has_fallen))


def add_joints(server: viser.ViserServer, root: str, model: Any, drawn: set[int]) -> dict[int, str]:
    """Make a frame for each joint that moves something drawn, within that of its parent joint.

    So a revolute joint only turns, and its place in the parent's frame need not be sent.

    Args:
        server: gets the frames.
        root: path of the node that carries them.
        model: of Pinocchio.
        drawn: indices of the joints.

    Returns:
        The path of each frame, by the index of its joint.
    """
    parents = list(model.parents)
    chains = {joint for last in drawn for joint in _ancestry(parents, last)}
    names = {0: root}
    for joint in sorted(chains):  # parents come first in Pinocchio
        names[joint] = f"{names[parents[joint]]}/j{joint}"
        server.scene.add_frame(names[joint], show_axes=False, position=tuple(model.jointPlacements[joint].translation))
    return {joint: names[joint] for joint in sorted(chains)}


def _ancestry(parents: Sequence[int], joint: int) -> Iterator[int]:
    """Yield a joint and those that carry it, without the world."""
    while joint:
        yield joint
        joint = parents[joint]


class Topple:
    """Fall of a body that no physics lets fall: rigid, about the edge of its support, as a pendulum from its foot.

    It shows that the robot lies; how a real one would fall is for contact physics.
    """

    def __init__(self, root: str) -> None:
        """Let the node fall that carries the body; its frame is the world's."""
        self._root, self._angle, self._rate = root, FIRST_TILT, 0.0  # so that the first frame puts it upright

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Let the body of a robot that has fallen go on falling, and put any other one upright."""
        snapshot = frame.snapshot
        if snapshot.status is not Status.FALLEN or snapshot.plant is not None:
            if self._angle:
                self._angle = self._rate = 0.0
                updates.position(self._root, (0.0, 0.0, 0.0))
                updates.orientation(self._root, (1.0, 0.0, 0.0, 0.0))
            return
        omega = snapshot.pendulum.omega
        elapsed = min(frame.elapsed, MAX_FALL_STEP)
        self._rate += elapsed * omega**2 * math.sin(max(self._angle, FIRST_TILT))
        self._angle = min(self._angle + elapsed * self._rate, LYING)
        corners, com = snapshot.stance.polygon, snapshot.com.position
        middle = corners.mean(axis=0)
        way = com - middle
        length = float(np.hypot(*way))
        x, y = (way / length).tolist() if length > 1e-3 else (math.cos(snapshot.heading), math.sin(snapshot.heading))
        edge = middle + max((corners - middle) @ (x, y)) * np.array([x, y])
        # p -> edge + R (p - edge), with R about z cross the way; raised by what of the body lies beyond the edge
        sin, cos = math.sin(self._angle), math.cos(self._angle)
        along = float(edge @ (x, y))
        height = along * sin + THICKNESS * sin
        shift = along * (1.0 - cos)
        updates.position(self._root, (shift * x, shift * y, height))
        half = self._angle / 2
        updates.orientation(self._root, (math.cos(half), -y * math.sin(half), x * math.sin(half), 0.0))


class PointMassDrawing:
    """Robot without a body, as in the paper's figures: a mass, two legs, two soles."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the nodes once."""
        self._mass, self._legs = f"{canvas.root}/mass", f"{canvas.root}/legs"
        self._feet = {side: f"{canvas.root}/{side.name.lower()}_foot" for side in Side}
        scene, ball = canvas.server.scene, trimesh.creation.icosphere(subdivisions=3, radius=0.09)
        canvas.draggable.append(scene.add_mesh_simple(self._mass, ball.vertices, ball.faces, color=COM))
        scene.add_line_segments(self._legs, np.zeros((2, 2, 3)), colors=LEFT_FOOT, thickness=0.03)
        for side, name in self._feet.items():
            scene.add_mesh_simple(name, *plate(sole_outline(canvas.robot, side), FOOT_THICKNESS), color=GREYS[side])

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Put mass, legs and soles in place."""
        snapshot = frame.snapshot
        com = np.array([*snapshot.com.position, snapshot.com_height])
        updates.position(self._mass, com)
        legs = []
        for side, foot in snapshot.feet.items():
            sole = np.array([*foot.position, foot.height])
            legs.append((com, sole + [0.0, 0.0, FOOT_THICKNESS]))
            updates.on_ground(self._feet[side], foot.position, foot.yaw, foot.height)
        updates.properties(self._legs, points=np.array(legs, dtype=np.float32))
        updates.properties(self._mass, color=FALLEN if snapshot.status is Status.FALLEN else COM)
