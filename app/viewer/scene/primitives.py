"""Shapes that the layers are drawn with: flat polygons, dots, lines and arrows, as arrays and as nodes of viser.

Nodes are made once and moved afterwards.
"""

from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import ArrayLike, NDArray

from app.drawing.palette import COP_RIM, Colour, linear, mixed
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore.values import Matrix, Vector

Points = NDArray[np.float32]
Faces = NDArray[np.uint32]


def raised(points: ArrayLike, height: float) -> Points:
    """Points of the plane, shape (V, 2), at a height [m]."""
    flat = np.asarray(points, dtype=np.float32).reshape(-1, 2)
    return np.column_stack([flat, np.full(len(flat), height, dtype=np.float32)])


def fan(nb_vertices: int, first: int = 0) -> Faces:
    """Triangles of a convex polygon whose vertices follow each other counter-clockwise from `first`."""
    inner = np.arange(1, nb_vertices - 1, dtype=np.uint32)
    return np.column_stack([np.zeros_like(inner), inner, inner + 1]) + np.uint32(first)


def outline(polygon: Points) -> Points:
    """Closed border of a polygon, shape (V, 3), as segments, shape (V, 2, 3)."""
    return np.stack([polygon, np.roll(polygon, -1, axis=0)], axis=1)


def path(points: Matrix, height: float) -> Points:
    """Path through points of the plane, shape (P, 2), at a height [m], as segments, shape (P - 1, 2, 3)."""
    corners = raised(np.round(points, 4), height)
    return np.stack([corners[:-1], corners[1:]], axis=1)


def counter_clockwise(polygon: ArrayLike) -> NDArray[np.float64]:
    """Vertices of a polygon, shape (V, 2), in the order in which its face looks up."""
    vertices = np.asarray(polygon, dtype=float)
    following = np.roll(vertices, -1, axis=0)
    twice_area = np.sum(vertices[:, 0] * following[:, 1] - vertices[:, 1] * following[:, 0])
    return vertices if twice_area > 0.0 else vertices[::-1]


def disc(radius: float, nb_corners: int = 40) -> tuple[Points, Faces]:
    """Disc around the origin of the plane, facing up."""
    angle = np.linspace(0.0, 2.0 * np.pi, nb_corners, endpoint=False)
    return raised(radius * np.column_stack([np.cos(angle), np.sin(angle)]), 0.0), fan(nb_corners)


def plate(polygon: ArrayLike, thickness: float) -> tuple[Points, Faces]:
    """Convex polygon, shape (V, 2), made thick upwards from the plane."""
    bottom = counter_clockwise(polygon)
    n = len(bottom)
    vertices = np.vstack([raised(bottom, 0.0), raised(bottom, thickness)])
    i = np.arange(n, dtype=np.uint32)
    j = np.roll(i, -1)
    sides = np.vstack([np.column_stack([i, j, j + n]), np.column_stack([i, j + n, i + n])])
    return vertices, np.vstack([fan(n)[:, ::-1], fan(n, first=n), sides]).astype(np.uint32)


DOT_PIXELS = 96  # along a side of a dot's picture
POLYGON_PIXELS = 64  # along a side of a polygon's picture
BORDER = 0.005  # [m] of its light border
RIM_SHARE = 0.12  # of a dot's radius that its white rim is wide


def dot_picture(colour: Colour, hole: float = 0.0) -> NDArray[np.uint8]:
    """Picture of a disc with a white rim, shape (DOT_PIXELS, DOT_PIXELS, 4), transparent around it and in its hole.

    Args:
        colour: of the disc.
        hole: radius of the hole in radii of the disc; it has a rim, too.
    """
    across = np.linspace(-1.0, 1.0, DOT_PIXELS)
    radius = np.hypot(*np.meshgrid(across, across))
    sharpness = DOT_PIXELS / 3.0  # edges are soft over a pixel or two

    def within(outer: float, inner: float) -> NDArray[np.float64]:
        is_out, is_in = (outer - radius) * sharpness, (radius - inner) * sharpness
        return np.clip(is_out + 0.5, 0.0, 1.0) * (np.clip(is_in + 0.5, 0.0, 1.0) if inner > 0.0 else 1.0)

    face = within(1.0 - RIM_SHARE, hole and hole + RIM_SHARE)[..., None]
    rgb = face * np.array(colour) + (1.0 - face) * np.array(COP_RIM)
    return np.dstack([rgb, 255.0 * within(0.98, hole)]).round().astype(np.uint8)


def add_dot(server: viser.ViserServer, name: str, colour: Colour, radius: float, hole: float = 0.0) -> None:
    """Make a flat disc, or a ring, with a white rim, invisible.

    It is a picture: pictures are not lit, so the dot has the colour of the legend on any ground. The page draws it over
    the feet, which it lies below.

    Args:
        server: gets the nodes.
        name: path of the frame to move.
        colour: of the disc.
        radius: [m].
        hole: radius of the hole in radii of the disc.
    """
    server.scene.add_frame(name, show_axes=False, visible=False)
    size = 2.0 * radius
    server.scene.add_image(
        f"{name}/face", dot_picture(colour, hole), size, size, format="png", cast_shadow=False, receive_shadow=False
    )


def add_flat_picture(
    server: viser.ViserServer, name: str, polygon: Matrix, colour: Colour, opacity: float, height: float
) -> None:
    """Make a filled polygon on the ground as a picture, which is not lit, with a light border for a dark ground.

    Args:
        server: gets the node.
        name: path of the node.
        polygon: convex, counter-clockwise [m], shape (V, 2).
        colour: of all of it.
        opacity: in [0, 1].
        height: above the ground [m].
    """
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    # A picture's rows go along y, its columns along x.
    x, y = (np.linspace(low[axis], high[axis], POLYGON_PIXELS) for axis in range(2))
    points = np.dstack(np.meshgrid(x, y))
    edges = np.roll(polygon, -1, axis=0) - polygon
    to_points = points[:, :, None] - polygon
    crossed = edges[:, 0] * to_points[..., 1] - edges[:, 1] * to_points[..., 0]
    depth_inside = np.min(crossed / np.hypot(*edges.T), axis=2)  # [m] from the nearest edge
    alpha = np.where(depth_inside >= -1e-9, round(255.0 * opacity), 0)
    rgb = np.where(depth_inside[..., None] < BORDER, mixed(colour, COP_RIM, 0.6), colour)
    picture = np.dstack([rgb, alpha]).astype(np.uint8)
    width, depth = (high - low).tolist()
    middle = (*((low + high) / 2.0).tolist(), height)
    server.scene.add_image(
        name, picture, width, depth, format="png", position=middle, cast_shadow=False, receive_shadow=False
    )


def add_lines(
    server: viser.ViserServer,
    name: str,
    colours: Colour | NDArray[np.uint8],
    thickness: float,
    *,
    nb_segments: int = 1,
    visible: bool = False,
) -> None:
    """Make line segments of a thickness in pixels of the screen."""
    server.scene.add_line_segments(
        name,
        np.zeros((nb_segments, 2, 3)),
        colors=colours,
        thickness=thickness,
        thickness_units="screen",
        visible=visible,
    )


def add_arrow(server: viser.ViserServer, name: str, colour: Colour, radius: float) -> None:
    """Make an arrow, invisible."""
    server.scene.add_arrows(
        name,
        np.array([[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]]),
        linear(colour),
        shaft_radius=radius,
        head_radius=2.8 * radius,
        head_length=6.0 * radius,
        visible=False,
    )


@dataclass(frozen=True, slots=True)
class PolygonStyle:
    """Style of a polygon on the ground."""

    colour: Colour
    height: float
    """Above the ground [m]."""
    opacity: float
    """Opacity of the face."""
    thickness: float
    """Thickness of the border in pixels."""


class GroundPolygon:
    """Convex polygon on the ground, filled and outlined, in a frame that moves."""

    def __init__(
        self, server: viser.ViserServer, name: str, style: PolygonStyle, polygon: Matrix | None = None
    ) -> None:
        """Make the nodes once, invisible; `polygon` [m], shape (V, 2), is for one that never changes."""
        self._name, self._height = name, style.height
        corners, colour = raised(np.zeros((3, 2)) if polygon is None else polygon, 0.0), style.colour
        server.scene.add_frame(name, show_axes=False, visible=False)
        server.scene.add_mesh_simple(
            f"{name}/fill",
            corners,
            fan(len(corners)),
            color=colour,
            opacity=style.opacity,
            cast_shadow=False,
            receive_shadow=False,
        )
        server.scene.add_line_segments(
            f"{name}/outline", outline(corners), colors=colour, thickness=style.thickness, thickness_units="screen"
        )

    def place(self, updates: SceneUpdates, position: Vector, yaw: float) -> None:
        """Draw the polygon with its frame at a place on the ground [m], [rad]."""
        updates.on_ground(self._name, position, yaw, self._height)
        updates.visible(self._name, True)

    def reshape(self, updates: SceneUpdates, polygon: Matrix) -> None:
        """Change the corners of the polygon in its frame [m], shape (V, 2)."""
        corners = raised(np.round(counter_clockwise(polygon), 4), 0.0)
        updates.properties(f"{self._name}/fill", vertices=corners, faces=fan(len(corners)))
        updates.properties(f"{self._name}/outline", points=outline(corners))

    def hide(self, updates: SceneUpdates) -> None:
        """Hide the polygon."""
        updates.visible(self._name, False)
