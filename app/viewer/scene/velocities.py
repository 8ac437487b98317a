"""Velocities as arrows on the ground: the reference and that of the CoM, from the robot to where each leads."""

import numpy as np

from app.drawing.palette import COM, REFERENCE, Colour
from app.viewer.scene.frame import Canvas, Frame
from app.viewer.scene.primitives import add_arrow, raised
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import Reference
from walkcore.values import Vector

SECONDS_AHEAD = 1.5  # an arrow ends where its velocity leads in this time
START = 0.25  # [m] from the CoM to the start of an arrow, of a robot of size 1
MIN_SPEED = 0.02  # [m/s] that is drawn


class VelocityArrow:
    """Arrow on the ground in a frame that moves with the CoM."""

    def __init__(self, canvas: Canvas, colour: Colour, radius: float, height: float) -> None:
        """Make the nodes once, invisible; radius of the shaft for a robot of size 1 and height above the ground [m]."""
        self._size = canvas.proportions.size
        self._frame, self._arrow, self._height = f"{canvas.root}/at_com", f"{canvas.root}/at_com/arrow", height
        canvas.server.scene.add_frame(self._frame, show_axes=False)
        add_arrow(canvas.server, self._arrow, colour, self._size * radius)

    def place(self, updates: SceneUpdates, com: Vector, yaw: float | None = None) -> None:
        """Move the frame to the CoM [m], shape (2,), turned by a yaw [rad]."""
        updates.on_ground(self._frame, com, yaw)

    def reshape(self, updates: SceneUpdates, velocity: Vector) -> None:
        """Draw a velocity in the frame [m/s], shape (2,)."""
        speed = float(np.hypot(*velocity))
        updates.visible(self._arrow, speed > MIN_SPEED)
        if speed > MIN_SPEED:
            tail = self._size * START * velocity / speed
            points = raised([tail, tail + SECONDS_AHEAD * velocity], self._height)
            updates.properties(self._arrow, points=points[None])


class ReferenceDrawing:
    """Reference velocity; its arrow turns with the robot."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the arrow once."""
        self._arrow = VelocityArrow(canvas, REFERENCE, 0.012, 0.02)
        self._drawn: Reference | None = None

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the reference of the snapshot."""
        snapshot, reference = frame.snapshot, frame.snapshot.reference
        self._arrow.place(updates, snapshot.com.position, snapshot.heading)
        if reference != self._drawn:
            self._drawn = reference
            self._arrow.reshape(updates, np.array([reference.vx, reference.vy]))


class CoMVelocityDrawing:
    """Velocity of the CoM."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the arrow once."""
        self._arrow = VelocityArrow(canvas, COM, 0.010, 0.03)

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the velocity of the snapshot."""
        com = frame.snapshot.com
        self._arrow.place(updates, com.position)
        if frame.has_lines:
            self._arrow.reshape(updates, np.round(com.velocity, 3))
