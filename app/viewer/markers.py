"""Centre of mass, centres of pressure, their trails and preview, and arrows for what is asked and what pushes."""

from collections import deque

import numpy as np
import viser

from app.palette import COM, COP, COP_RIM, COP_TRAIL, GRID_CELL, PUSH, REFERENCE, TRUE_COP, Colour, linear
from app.viewer.shapes import disc, polyline, raised
from app.viewer.stream import Stream
from walkcore import Snapshot
from walkcore.pattern_generator import Plan
from walkcore.values import Vector, rotation

FRAMES_PER_LINE = 3  # lines are sent at a third of the rate: a client builds them anew
TRAIL_POINTS = 20  # two seconds
TRAIL_HEIGHT, PREVIEW_HEIGHT = 0.007, 0.008  # [m]
SECONDS_AHEAD = 1.5  # the reference arrow ends where the robot is asked to be after them
CHEST = 1.35  # height of the push arrow, in heights of the CoM
CLEARANCE = 0.42  # [m] from the CoM to the tip of the push arrow: beside the arm
PUSH_LENGTH, PUSH_LENGTH_PER_IMPULSE = 0.15, 0.01  # [m], [m per N s]
PUSH_SECONDS = 0.6  # that the arrow stays


class Dot:
    """A flat coloured disc with a white rim, on the ground."""

    def __init__(self, server: viser.ViserServer, name: str, colour: Colour, radius: float, height: float) -> None:
        """Make the nodes once."""
        self._name, self._height = name, height
        server.scene.add_frame(name, show_axes=False)
        for part, part_colour, part_radius, lift in (
            ("rim", COP_RIM, 1.35 * radius, 0.0),
            ("face", colour, radius, 0.001),
        ):
            vertices, faces = disc(part_radius)
            server.scene.add_mesh_simple(
                f"{name}/{part}",
                vertices,
                faces,
                color=part_colour,
                position=(0.0, 0.0, lift),
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )

    def update(self, stream: Stream, point: Vector | None) -> None:
        """Put the dot on a point of the ground, shape (2,); none hides it."""
        stream.visible(self._name, point is not None)
        if point is not None:
            stream.on_ground(self._name, point, height=self._height)


class Trail:
    """Where a point of the ground was during the last two seconds, fading; given relative to the CoM of now."""

    def __init__(self, server: viser.ViserServer, name: str, colour: Colour) -> None:
        """Make the node once."""
        self._name = name
        self._points: deque[Vector] = deque(maxlen=TRAIL_POINTS)
        fade = np.linspace(0.0, 1.0, TRAIL_POINTS)[:, None]
        colours = (fade * colour + (1.0 - fade) * GRID_CELL).astype(np.uint8)
        server.scene.add_line_segments(
            name,
            np.zeros((TRAIL_POINTS - 1, 2, 3)),
            colors=np.stack([colours[:-1], colours[1:]], axis=1),
            thickness=2.0,
            thickness_units="screen",
            visible=False,
        )

    def update(self, stream: Stream, point: Vector | None, com: Vector) -> None:
        """Lengthen the trail by a point, shape (2,)."""
        stream.visible(self._name, point is not None)
        if point is None:
            return
        self._points.extend([point] * (1 if self._points else TRAIL_POINTS))
        stream.properties(self._name, points=polyline(raised(np.array(self._points) - com, TRAIL_HEIGHT)))

    def forget(self) -> None:
        """Begin anew, after a reset of the robot."""
        self._points.clear()


class Balance:
    """CoM with its ground projection, CoP of the model, true CoP, their trails, and the preview of the first two."""

    def __init__(self, server: viser.ViserServer, points: str, trails: str, plan: str) -> None:
        """Make the nodes once, below three layers, each with a frame that goes with the CoM."""
        self._frames = [f"{layer}/com" for layer in (points, trails, plan)]
        for frame in self._frames:
            server.scene.add_frame(frame, show_axes=False)
        at_com, trails_at_com, plan_at_com = self._frames
        self._ball, self._plumb = f"{at_com}/ball", f"{at_com}/plumb"
        server.scene.add_icosphere(self._ball, radius=0.045, color=COM, cast_shadow=False)
        server.scene.add_line_segments(
            self._plumb, np.zeros((1, 2, 3)), colors=COM, thickness=1.5, thickness_units="screen"
        )
        self._dots = {
            "com": Dot(server, f"{points}/com_ground", COM, radius=0.016, height=0.009),
            "cop": Dot(server, f"{points}/cop", COP, radius=0.020, height=0.011),
            "true_cop": Dot(server, f"{points}/true_cop", TRUE_COP, radius=0.015, height=0.013),
        }
        self._trails = {
            "com": Trail(server, f"{trails_at_com}/com", COM),
            "cop": Trail(server, f"{trails_at_com}/cop", COP_TRAIL),
            "true_cop": Trail(server, f"{trails_at_com}/true_cop", TRUE_COP),
        }
        self._previews = {"com": f"{plan_at_com}/com", "cop": f"{plan_at_com}/cop"}
        for key, colour in (("com", COM), ("cop", COP_TRAIL)):
            server.scene.add_line_segments(
                self._previews[key], np.zeros((1, 2, 3)), colors=colour, thickness=2.5, thickness_units="screen"
            )
        self._frame_count = 0

    def update(self, stream: Stream, snapshot: Snapshot) -> None:
        """Draw the points of a snapshot and what its plan previews of them."""
        points = {"com": snapshot.com.position, "cop": snapshot.cop, "true_cop": snapshot.true_cop}
        for frame in self._frames:
            stream.on_ground(frame, snapshot.com.position)
        top = (0.0, 0.0, snapshot.com_height)
        stream.position(self._ball, top)
        stream.properties(self._plumb, points=np.array([[top, (0.0, 0.0, 0.0)]], dtype=np.float32))
        for key, dot in self._dots.items():
            dot.update(stream, points[key])
        for preview in self._previews.values():
            stream.visible(preview, snapshot.plan is not None)
        self._frame_count += 1
        if self._frame_count % FRAMES_PER_LINE == 0:
            for key, trail in self._trails.items():
                trail.update(stream, points[key], snapshot.com.position)
            if snapshot.plan is not None:
                self._preview(stream, snapshot, snapshot.plan)

    def _preview(self, stream: Stream, snapshot: Snapshot, plan: Plan) -> None:
        com = snapshot.com.position
        path = polyline(raised(np.vstack([com, plan.com]) - com, PREVIEW_HEIGHT))
        stream.properties(self._previews["com"], points=path)
        dashes = polyline(raised(np.vstack([snapshot.cop, plan.cop]) - com, PREVIEW_HEIGHT))
        stream.properties(self._previews["cop"], points=dashes[::2])

    def forget(self) -> None:
        """Begin anew, after a reset of the robot."""
        for trail in self._trails.values():
            trail.forget()


class Arrows:
    """The velocity asked for, from the robot along the ground, and the last push, at the height of the chest."""

    def __init__(self, server: viser.ViserServer, root: str) -> None:
        """Make the nodes once."""
        self._frame = f"{root}/com"
        self._reference, self._push = f"{self._frame}/reference", f"{self._frame}/push"
        self._push_seconds_left = 0.0
        server.scene.add_frame(self._frame, show_axes=False)
        start = np.array([[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]])
        for name, colour, radius in ((self._reference, REFERENCE, 0.012), (self._push, PUSH, 0.022)):
            server.scene.add_arrows(
                name,
                start,
                linear(colour),
                shaft_radius=radius,
                head_radius=2.8 * radius,
                head_length=6.0 * radius,
                visible=False,
            )

    def update(self, stream: Stream, snapshot: Snapshot, impulse: Vector | None, elapsed: float) -> None:
        """Draw both.

        Args:
            stream: takes the changes.
            snapshot: to be drawn.
            impulse: of a push since the last frame, world frame [N s], shape (2,).
            elapsed: since the last frame [s].
        """
        stream.on_ground(self._frame, snapshot.com.position)
        reference = snapshot.reference
        ahead = SECONDS_AHEAD * rotation(snapshot.heading) @ (reference.vx, reference.vy)
        is_asked = bool(np.hypot(*ahead) > 0.03)
        stream.visible(self._reference, is_asked)
        if is_asked:
            tail = 0.25 * ahead / np.hypot(*ahead)
            stream.properties(self._reference, points=raised([tail, tail + ahead], 0.02)[None])

        self._push_seconds_left -= elapsed
        if impulse is not None:
            self._push_seconds_left = PUSH_SECONDS
            tip = -0.22 * impulse / np.hypot(*impulse)  # outside the robot, which it pushes
            stream.properties(
                self._push, points=raised([tip - PUSH_LENGTH * impulse, tip], CHEST * snapshot.com_height)[None]
            )
        stream.visible(self._push, self._push_seconds_left > 0.0)
