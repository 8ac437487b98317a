"""Strips across the ground, where the world of a plant has any: those around the robot."""

import numpy as np

from app.drawing.palette import STRIP
from app.viewer.scene.frame import Canvas, Frame
from app.viewer.scene.points import body_com
from app.viewer.scene.primitives import Faces, Points, plate
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore.plant.world import STRIP_SPACING, STRIP_WIDTH

AHEAD = 12  # strips drawn to either side of the robot: the ground fades at 9 m
LENGTH = 24.0  # [m] that is drawn of each


class StripsDrawing:
    """One mesh of all strips near the robot, which is made anew when the robot has come half a metre further."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the node once, invisible."""
        self._node = f"{canvas.root}/mesh"
        vertices, faces = strips(0, 0, STRIP_WIDTH)
        canvas.server.scene.add_mesh_simple(
            self._node, vertices, faces, color=STRIP, flat_shading=True, side="double", visible=False, cast_shadow=False
        )
        self._drawn: tuple[int, int, float] | None = None

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the strips near the robot, or hide them."""
        height = frame.world.strip_height
        updates.visible(self._node, height > 0.0)
        if height == 0.0:
            return
        x, y = (body_com(frame.snapshot) / (STRIP_SPACING, LENGTH / 4)).round().astype(int).tolist()
        if self._drawn == (x, y, height):
            return
        self._drawn = (x, y, height)
        updates.on_ground(self._node, (0.0, y * LENGTH / 4))
        vertices, faces = strips(x - AHEAD, x + AHEAD, height)
        updates.properties(self._node, vertices=vertices, faces=faces)


def strips(first: int, last: int, height: float) -> tuple[Points, Faces]:
    """The strips with some numbers, which count from the world's origin, where there is none.

    Args:
        first: number of the first one.
        last: number of the last one.
        height: of each [m].
    """
    half = np.array([STRIP_WIDTH, LENGTH]) / 2
    outline = half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    numbers = [number for number in range(first, last + 1) if number != 0] or [1]
    plates = [plate(outline + [STRIP_SPACING * number, 0.0], height) for number in numbers]
    nb_vertices = len(plates[0][0])
    faces = [faces + np.uint32(nb_vertices * k) for k, (_, faces) in enumerate(plates)]
    return np.vstack([vertices for vertices, _ in plates]), np.vstack(faces)
