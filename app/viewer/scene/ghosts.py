"""Translucent bodies beside the robot: the commanded configuration, the ideal twin, and the walk that was."""

from collections.abc import Callable
from dataclasses import dataclass

from app.drawing.palette import COMMANDED, PAST, TWIN, Colour
from app.viewer.scene.frame import LIGHT, Canvas, Frame
from app.viewer.scene.joints import joint_of
from app.viewer.scene.robot import add_joints
from app.viewer.scene.robot_mesh import shared_parts
from app.viewer.transport.scene_updates import SceneUpdates
from app.viewer.transport.viser_private import add_mesh
from walkcore.motion.body_model import load_model
from walkcore.values import Vector

OPACITY = 0.32


@dataclass(frozen=True, slots=True)
class GhostStyle:
    """Body that is drawn, and how."""

    configuration: Callable[[Frame], Vector | None]
    """Configuration in Pinocchio's order, shape (nq,); None where there is no such body."""
    colour: Colour
    place: tuple[float, float] = (0.0, 0.0)
    """From where it is to where it is drawn, x and y in the world frame [m]."""


def _commanded(frame: Frame) -> Vector | None:
    plant = frame.snapshot.plant
    return None if plant is None else plant.q_commanded


def _twin(frame: Frame) -> Vector | None:
    twin = frame.snapshot.twin
    return None if twin is None else twin.q


def _walk_that_was(frame: Frame) -> Vector | None:
    return None if frame.was is None else frame.was.q


COMMANDED_BODY = GhostStyle(_commanded, COMMANDED)
TWIN_BODY = GhostStyle(_twin, TWIN, place=(0.0, -1.0))
PAST_BODY = GhostStyle(_walk_that_was, PAST)


class GhostDrawing:
    """Body of one colour that can be seen through, in coarse meshes."""

    def __init__(self, style: GhostStyle, canvas: Canvas) -> None:
        """Make the nodes once, invisible."""
        self._style, self._root = style, f"{canvas.root}/body"
        self._joints = {}
        canvas.server.scene.add_frame(self._root, show_axes=False, visible=False, position=(*style.place, 0.0))
        if canvas.robot.body is None:
            return
        model = load_model(canvas.robot.body)
        parts = shared_parts(canvas.robot.body, LIGHT.face_ratio)
        nodes = add_joints(canvas.server, self._root, model, {part.joint for part in parts})
        self._joints = {name: joint_of(model, joint) for joint, name in nodes.items()}
        for index, part in enumerate(parts):
            add_mesh(
                canvas.server.scene,
                f"{nodes[part.joint]}/{index}",
                *part.quantised(),
                color=style.colour,
                opacity=OPACITY,
                side="front",
                cast_shadow=False,
                receive_shadow=False,
            )

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Put the links where the configuration says, or hide them."""
        q = self._style.configuration(frame)
        updates.visible(self._root, q is not None)
        if q is not None:
            numbers: list[float] = q.tolist()
            for node, joint in self._joints.items():
                joint.move(updates, node, numbers)
