"""The points that tell the balance: dots on the ground, where each was, and where the model will have it."""

from collections import deque
from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray

from app.drawing.palette import CAPTURE, COM, COP, COP_RIM, COP_TRAIL, GRID_CELL, TRUE_COP, Colour
from app.viewer.scene.shapes import Points, disc, polyline, raised
from app.viewer.transport.stream import Stream
from walkcore import Snapshot
from walkcore.values import Matrix, Vector

FRAMES_PER_LINE = 3  # lines are sent at a third of the rate: a client builds them anew
TRAIL_POINTS = 20  # two seconds
TRAIL_HEIGHT, PREVIEW_HEIGHT = 0.007, 0.008  # [m]
BALL_RADIUS = 0.045  # [m]


@dataclass(frozen=True, slots=True)
class Style:
    """How a point is drawn."""

    colour: Colour
    line: Colour
    radius: float
    """[m]."""
    height: float
    """[m], so that none hides another."""


STYLES = {
    "com": Style(COM, COM, 0.016, 0.009),
    "cop": Style(COP, COP_TRAIL, 0.020, 0.011),
    "true_cop": Style(TRUE_COP, TRUE_COP, 0.015, 0.013),
    "capture_point": Style(CAPTURE, CAPTURE, 0.017, 0.015),
}


def points_of(snapshot: Snapshot, omega: float) -> dict[str, Vector | None]:
    """Where the points are on the ground [m], shape (2,).

    Args:
        snapshot: of a robot.
        omega: of its pendulum [1/s].
    """
    return {
        "com": snapshot.com.position,
        "cop": snapshot.cop,
        "true_cop": snapshot.true_cop,
        "capture_point": capture_point(snapshot, omega),
    }


def capture_point(snapshot: Snapshot, omega: float) -> Vector:
    """Where a foot would stop the robot [m], shape (2,)."""
    return snapshot.com.position + snapshot.com.velocity / omega


def previews_of(snapshot: Snapshot, omega: float) -> dict[str, Matrix]:
    """Where the plan has them, the present first, shape (N + 1, 2) [m]; none for what the model does not know."""
    plan, com = snapshot.plan, snapshot.com
    if plan is None:
        return {}
    steps = np.diff(plan.times, prepend=0.0)[:, None]
    accelerations = com.acceleration + np.vstack([np.zeros(2), np.cumsum(steps * plan.jerks, axis=0)])
    changes = steps * (accelerations[:-1] + steps * plan.jerks / 2)
    velocities = com.velocity + np.vstack([np.zeros(2), np.cumsum(changes, axis=0)])
    path = np.vstack([com.position, plan.com])
    return {"com": path, "cop": np.vstack([snapshot.cop, plan.cop]), "capture_point": path + velocities / omega}


class Marker:
    """One point: a flat coloured disc with a white rim, its trail, and its preview. Lines go with the CoM."""

    def __init__(self, server: viser.ViserServer, root: str, style: Style) -> None:
        """Make the nodes once, invisible."""
        self._dot, self._frame = f"{root}/dot", f"{root}/at_com"
        self._trail, self._preview = f"{self._frame}/trail", f"{self._frame}/preview"
        self._height = style.height
        self._past: deque[Vector] = deque(maxlen=TRAIL_POINTS)
        self._is_dashed = style.line is COP_TRAIL
        add_dot(server, self._dot, style)
        server.scene.add_frame(self._frame, show_axes=False)
        fade = np.linspace(0.0, 1.0, TRAIL_POINTS)[:, None]
        colours = (fade * style.line + (1.0 - fade) * GRID_CELL).astype(np.uint8)
        _add_line(server, self._trail, TRAIL_POINTS - 1, np.stack([colours[:-1], colours[1:]], axis=1), 2.0)
        _add_line(server, self._preview, 1, style.line, 2.5)

    def move(self, stream: Stream, point: Vector | None) -> None:
        """Put the dot on a point of the ground, shape (2,); none hides it."""
        stream.visible(self._dot, point is not None)
        if point is not None:
            stream.on_ground(self._dot, point, height=self._height)

    def go_with(self, stream: Stream, com: Vector) -> None:
        """Keep the lines at their place relative to the CoM, shape (2,)."""
        stream.on_ground(self._frame, com)

    def remember(self, point: Vector | None) -> None:
        """Lengthen the trail by a point, shape (2,)."""
        if point is not None:
            self._past.extend([point] * (1 if self._past else TRAIL_POINTS))

    def draw_lines(self, stream: Stream, com: Vector, preview: Matrix | None, *, has_trail: bool) -> None:
        """Draw where the point was and where it is going to be; either may be left out."""
        stream.visible(self._trail, has_trail and bool(self._past))
        if has_trail and self._past:
            stream.properties(self._trail, points=_line(np.array(self._past) - com, TRAIL_HEIGHT))
        stream.visible(self._preview, preview is not None)
        if preview is not None:
            line = _line(preview - com, PREVIEW_HEIGHT)
            stream.properties(self._preview, points=line[::2] if self._is_dashed else line)

    def forget(self) -> None:
        """Begin anew, after a reset of the robot."""
        self._past.clear()


class Balance:
    """CoM, CoP of the model, true CoP, capture point."""

    def __init__(self, server: viser.ViserServer, roots: dict[str, str]) -> None:
        """Make the nodes once, each point below the root of its layer."""
        self._markers = {name: Marker(server, roots[name], style) for name, style in STYLES.items()}
        self._com = f"{roots['com']}/mass"
        self._ball, self._plumb = f"{self._com}/ball", f"{self._com}/plumb"
        server.scene.add_frame(self._com, show_axes=False)
        server.scene.add_icosphere(self._ball, radius=BALL_RADIUS, color=COM, cast_shadow=False)
        _add_line(server, self._plumb, 1, COM, 1.5, visible=True)
        self._com_height = np.nan
        self._frame = 0

    def update(self, stream: Stream, snapshot: Snapshot, omega: float, shown: set[str]) -> None:
        """Draw the points of a snapshot that are shown, and of these trails and previews if those are."""
        points, com = points_of(snapshot, omega), snapshot.com.position
        if "com" in shown:
            stream.on_ground(self._com, com)
            self._hang(stream, round(snapshot.com_height, 3))
        for name, marker in self._markers.items():
            if name in shown:
                marker.move(stream, points[name])
                if shown & {"trails", "preview"}:
                    marker.go_with(stream, com)
        self._frame += 1
        if self._frame % FRAMES_PER_LINE == 0:
            self._draw_lines(stream, snapshot, points, omega, shown)

    def _hang(self, stream: Stream, height: float) -> None:
        """The ball at a height [m], and the line from it to the ground."""
        if height == self._com_height:
            return
        self._com_height = height
        top = (0.0, 0.0, height)
        stream.position(self._ball, top)
        stream.properties(self._plumb, points=np.array([[top, (0.0, 0.0, 0.0)]], dtype=np.float32))

    def _draw_lines(
        self, stream: Stream, snapshot: Snapshot, points: dict[str, Vector | None], omega: float, shown: set[str]
    ) -> None:
        previews = previews_of(snapshot, omega) if "preview" in shown else {}
        for name, marker in self._markers.items():
            marker.remember(points[name])
            if name in shown:
                marker.draw_lines(stream, snapshot.com.position, previews.get(name), has_trail="trails" in shown)

    def forget(self) -> None:
        """Begin anew, after a reset of the robot."""
        for marker in self._markers.values():
            marker.forget()


def _line(points: Matrix, height: float) -> Points:
    return polyline(raised(np.round(points, 4), height))


def add_dot(server: viser.ViserServer, name: str, style: Style) -> None:
    """Make the nodes of a flat disc with a white rim, invisible."""
    server.scene.add_frame(name, show_axes=False, visible=False)
    _add_disc(server, f"{name}/rim", COP_RIM, 1.35 * style.radius, 0.0)
    _add_disc(server, f"{name}/face", style.colour, style.radius, 0.001)


def _add_disc(server: viser.ViserServer, name: str, colour: Colour, radius: float, lift: float) -> None:
    server.scene.add_mesh_simple(
        name,
        *disc(radius),
        color=colour,
        position=(0.0, 0.0, lift),
        side="double",
        cast_shadow=False,
        receive_shadow=False,
    )


def _add_line(
    server: viser.ViserServer,
    name: str,
    nb_segments: int,
    colours: Colour | NDArray[np.uint8],
    thickness: float,
    visible: bool = False,
) -> None:
    server.scene.add_line_segments(
        name,
        np.zeros((nb_segments, 2, 3)),
        colors=colours,
        thickness=thickness,
        thickness_units="screen",
        visible=visible,
    )
