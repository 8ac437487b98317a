"""Velocities as arrows on the ground, asked for and actual, and the last push at the height of the chest."""

import numpy as np
import viser

from app.drawing.palette import COM, PUSH, REFERENCE, Colour, linear
from app.viewer.scene.shapes import Points, raised
from app.viewer.transport.stream import Stream
from walkcore import Snapshot
from walkcore.values import Vector

SECONDS_AHEAD = 1.5  # a velocity's arrow ends where it leads to in them
TAIL = 0.25  # [m] from the CoM to the beginning of the arrow
SLOWEST = 0.02  # [m/s] that is drawn
HEIGHT = {"reference": 0.02, "velocity": 0.03}  # [m]
CHEST = 1.35  # height of the push arrow, in heights of the CoM
CLEARANCE = 0.22  # [m] from the CoM to the tip of the push arrow: outside the robot, which it pushes
PUSH_LENGTH, PUSH_LENGTH_PER_IMPULSE = 0.15, 0.01  # [m], [m per N s]
PUSH_SECONDS = 0.6  # that the arrow stays
FRAMES_PER_VELOCITY = 3


def push_points(impulse: Vector, height: float) -> Points:
    """Tail and tip of the arrow of a push [N s], shape (2,), that ends at the robot; relative to the CoM on the ground.

    Shape (1, 2, 3) [m].
    """
    return pull_points(-impulse, height)[:, ::-1]


def pull_points(impulse: Vector, height: float) -> Points:
    """The same, beginning at the robot: as a hand draws it."""
    strength = float(np.hypot(*impulse))
    direction = impulse / strength
    tail = CLEARANCE * direction
    tip = tail + (PUSH_LENGTH + PUSH_LENGTH_PER_IMPULSE * strength) * direction
    return raised(np.round([tail, tip], 3), height)[None]


def add_arrow(server: viser.ViserServer, name: str, colour: Colour, radius: float) -> None:
    """Make the node of an arrow, invisible."""
    server.scene.add_arrows(
        name,
        np.array([[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]]),
        linear(colour),
        shaft_radius=radius,
        head_radius=2.8 * radius,
        head_length=6.0 * radius,
        visible=False,
    )


class VelocityArrows:
    """The velocity asked for and the actual one, from the robot along the ground."""

    def __init__(self, server: viser.ViserServer, roots: dict[str, str]) -> None:
        """Make the nodes once, each below the root of its layer."""
        self._frames = {name: f"{roots[name]}/at_com" for name in HEIGHT}
        for name, colour, radius in (("reference", REFERENCE, 0.012), ("velocity", COM, 0.010)):
            server.scene.add_frame(self._frames[name], show_axes=False)
            add_arrow(server, f"{self._frames[name]}/arrow", colour, radius)
        self._asked: tuple[float, float] | None = None
        self._frame = 0

    def update(self, stream: Stream, snapshot: Snapshot, shown: set[str]) -> None:
        """Draw those that are shown."""
        com = snapshot.com
        if "reference" in shown:
            asked = (snapshot.reference.vx, snapshot.reference.vy)
            stream.on_ground(self._frames["reference"], com.position, snapshot.heading)
            if asked != self._asked:
                self._asked = asked
                self._draw(stream, "reference", np.array(asked))
        if "velocity" in shown:
            stream.on_ground(self._frames["velocity"], com.position)
            self._frame += 1
            if self._frame % FRAMES_PER_VELOCITY == 0:
                self._draw(stream, "velocity", np.round(com.velocity, 3))

    def _draw(self, stream: Stream, name: str, velocity: Vector) -> None:
        speed = float(np.hypot(*velocity))
        arrow = f"{self._frames[name]}/arrow"
        stream.visible(arrow, speed > SLOWEST)
        if speed > SLOWEST:
            tail = TAIL * velocity / speed
            stream.properties(arrow, points=raised([tail, tail + SECONDS_AHEAD * velocity], HEIGHT[name])[None])


class PushArrow:
    """The last push, for as long as an eye needs."""

    def __init__(self, server: viser.ViserServer, root: str) -> None:
        """Make the nodes once."""
        self._frame, self._arrow = f"{root}/at_com", f"{root}/at_com/last"
        self._seconds_left = 0.0
        server.scene.add_frame(self._frame, show_axes=False)
        add_arrow(server, self._arrow, PUSH, 0.022)

    def update(self, stream: Stream, snapshot: Snapshot, impulse: Vector | None, elapsed: float) -> None:
        """Draw the push while it is fresh.

        Args:
            stream: takes the changes.
            snapshot: to be drawn.
            impulse: of a push since the last frame, world frame [N s], shape (2,).
            elapsed: since the last frame [s].
        """
        self._seconds_left = max(0.0, self._seconds_left - elapsed)
        if impulse is not None:
            self._seconds_left = PUSH_SECONDS
            stream.properties(self._arrow, points=push_points(impulse, CHEST * snapshot.com_height))
        if self._seconds_left > 0.0:
            stream.on_ground(self._frame, snapshot.com.position)
        stream.visible(self._arrow, self._seconds_left > 0.0)
