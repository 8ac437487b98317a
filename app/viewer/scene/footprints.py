"""The soles on the ground: where they stood, where they will, and what carries the robot now."""

from collections import deque
from itertools import pairwise, zip_longest
from typing import Any

import numpy as np
import viser
from scipy.spatial import ConvexHull

from app.drawing.outlines import support_polygon
from app.drawing.palette import LEFT_FOOT, MARGIN, REGION, RIGHT_FOOT, SUPPORT, Colour
from app.viewer.scene.shapes import counter_clockwise, fan, outline, raised
from app.viewer.transport.stream import Stream
from walkcore import Robot, Snapshot, WalkError
from walkcore.mpc.gait import Phase
from walkcore.mpc.regions import inset_vertices
from walkcore.mpc.stance import Footstep, Side, mirrored
from walkcore.values import Matrix, Vector, rotation

Place = tuple[float, float, float]  # x, y [m], yaw [rad]

PRINTS_PER_FOOT = 6
PLANNED_PER_FOOT = 4  # of a long horizon; of the default one there are two
FRESH_OPACITY = 0.8
PRINT_HEIGHT, REGION_HEIGHT, PLAN_HEIGHT, SUPPORT_HEIGHT, MARGIN_HEIGHT = 0.002, 0.003, 0.004, 0.005, 0.006  # [m]
GREYS = {Side.LEFT: LEFT_FOOT, Side.RIGHT: RIGHT_FOOT}


def sole_of(robot: Robot, side: Side) -> Matrix:
    """Outline of a sole in its own frame, counter-clockwise [m], shape (V, 2)."""
    return counter_clockwise(robot.sole if side is Side.LEFT else mirrored(robot.sole))


class PastFootprints:
    """The last soles set down by each foot: a fixed number of prints, each fainter than the one after it."""

    def __init__(self, server: viser.ViserServer, root: str, robot: Robot) -> None:
        """Make the nodes once, invisible."""
        self._places: dict[Side, deque[Place]] = {side: deque(maxlen=PRINTS_PER_FOOT) for side in Side}
        self._is_new = True
        self._names = {side: [f"{root}/{side.name.lower()}_{age}" for age in range(PRINTS_PER_FOOT)] for side in Side}
        for side, names in self._names.items():
            sole = sole_of(robot, side)
            for age, name in enumerate(names):
                server.scene.add_mesh_simple(
                    name,
                    raised(sole, PRINT_HEIGHT),
                    fan(len(sole)),
                    color=GREYS[side],
                    opacity=FRESH_OPACITY * (1.0 - age / PRINTS_PER_FOOT),
                    cast_shadow=False,
                    receive_shadow=False,
                    visible=False,
                )

    def update(self, stream: Stream, snapshot: Snapshot) -> None:
        """Add the soles that have come to the ground since the last frame."""
        for side, foot in snapshot.feet.items():
            if foot.height > 0.0:
                continue
            places, (x, y, yaw) = self._places[side], foot.pose.tolist()
            if not places or places[0] != (x, y, yaw):
                places.appendleft((x, y, yaw))
                self._is_new = True
        if not self._is_new:
            return
        self._is_new = False
        for side, places in self._places.items():
            for age, name in enumerate(self._names[side]):
                stream.visible(name, age < len(places))
            for name, (x, y, yaw) in zip(self._names[side], places, strict=False):
                stream.on_ground(name, (x, y), yaw)

    def forget(self) -> None:
        """Begin anew, after a reset of the robot."""
        self._is_new = True
        for places in self._places.values():
            places.clear()


class Patch:
    """A convex polygon on the ground, filled and outlined, in a frame that moves."""

    def __init__(
        self,
        server: viser.ViserServer,
        name: str,
        colour: Colour,
        height: float,
        *,
        opacity: float,
        thickness: float,
        polygon: Matrix | None = None,
    ) -> None:
        """Make the nodes once, invisible; a polygon that never changes may be given here."""
        self._name, self._height = name, height
        corners = raised(np.zeros((3, 2)) if polygon is None else polygon, 0.0)
        server.scene.add_frame(name, show_axes=False, visible=False)
        server.scene.add_mesh_simple(
            f"{name}/fill",
            corners,
            fan(len(corners)),
            color=colour,
            opacity=opacity,
            cast_shadow=False,
            receive_shadow=False,
        )
        server.scene.add_line_segments(
            f"{name}/outline", outline(corners), colors=colour, thickness=thickness, thickness_units="screen"
        )

    def place(self, stream: Stream, position: Vector, yaw: float) -> None:
        """Draw the polygon in a frame on the ground [m], [rad]."""
        stream.on_ground(self._name, position, yaw, self._height)
        stream.visible(self._name, True)

    def reshape(self, stream: Stream, polygon: Matrix) -> None:
        """Change the polygon, shape (V, 2), of that frame [m]."""
        corners = raised(np.round(counter_clockwise(polygon), 4), 0.0)
        stream.properties(f"{self._name}/fill", vertices=corners, faces=fan(len(corners)))
        stream.properties(f"{self._name}/outline", points=outline(corners))

    def hide(self, stream: Stream) -> None:
        """Draw nothing."""
        stream.visible(self._name, False)


class PlannedSoles:
    """The footholds that the plan holds, left and right told apart."""

    def __init__(
        self, server: viser.ViserServer, root: str, robot: Robot, colours: dict[Side, Colour] = GREYS, **look: Any
    ) -> None:
        """Make the nodes once."""
        look = {"height": PLAN_HEIGHT, "opacity": 0.22, "thickness": 2.5} | look
        self._patches = {
            side: [
                Patch(server, f"{root}/{side.name.lower()}_{i}", colour, polygon=sole_of(robot, side), **look)
                for i in range(PLANNED_PER_FOOT)
            ]
            for side, colour in colours.items()
        }

    def update(self, stream: Stream, snapshot: Snapshot) -> None:
        """Draw the footholds of the snapshot's plan."""
        self.draw(stream, snapshot.plan.footholds if snapshot.plan is not None else ())

    def draw(self, stream: Stream, footholds: tuple[Footstep, ...]) -> None:
        """Draw footholds, or none."""
        for side, patches in self._patches.items():
            feet = [foot for foot in footholds if foot.side is side]
            for patch, foot in zip_longest(patches, feet[: len(patches)]):
                patch.place(stream, foot.position, foot.yaw) if foot is not None else patch.hide(stream)


class FootholdRegions:
    """Where each foothold of the plan may lie, given the one before it."""

    def __init__(self, server: viser.ViserServer, root: str, robot: Robot) -> None:
        """Make the nodes once."""
        self._robot = robot
        self._patches = [
            Patch(server, f"{root}/{i}", REGION, REGION_HEIGHT, opacity=0.10, thickness=1.5)
            for i in range(2 * PLANNED_PER_FOOT)
        ]

    def update(self, stream: Stream, snapshot: Snapshot) -> None:
        """Draw the regions of the snapshot's plan."""
        footholds = snapshot.plan.footholds if snapshot.plan is not None else ()
        for patch, pair in zip_longest(self._patches, pairwise((snapshot.support, *footholds))):
            if patch is None:
                return
            if pair is None:
                patch.hide(stream)
                continue
            before, foothold = pair
            patch.reshape(stream, self._robot.foothold_region_at(foothold.yaw - before.yaw, foothold.side))
            patch.place(stream, before.position, before.yaw)


class SupportPolygon:
    """The hull of the soles that carry the robot, and what the margin leaves of it for the CoP."""

    def __init__(self, server: viser.ViserServer, root: str, margin_root: str, robot: Robot) -> None:
        """Make the nodes once: a patch for each case, of which one is shown."""
        self._robot = robot
        cases = [(side, is_single) for side in Side for is_single in (True, False)]
        self._patches = {
            case: Patch(server, f"{root}/{_case(*case)}", SUPPORT, SUPPORT_HEIGHT, opacity=0.3, thickness=2.5)
            for case in cases
        }
        self._margins = {
            case: Patch(server, f"{margin_root}/{_case(*case)}", MARGIN, MARGIN_HEIGHT, opacity=0.12, thickness=2.0)
            for case in cases
        }
        self._drawn: tuple[Any, ...] = ()

    def update(self, stream: Stream, snapshot: Snapshot, margin: float | None) -> None:
        """Draw the polygons of the snapshot's phase.

        Args:
            stream: takes the changes.
            snapshot: to be drawn.
            margin: of the CoP from the edges [m]; None where nobody looks at what it leaves.
        """
        foot = snapshot.support
        # They change only with what stands on the ground.
        grounded = [(side, f.pose.tolist()) for side, f in snapshot.feet.items() if f.height == 0.0]
        now = (snapshot.phase, foot.side, grounded, margin)
        if now == self._drawn:
            return
        self._drawn = now
        corners = (support_polygon(self._robot, snapshot) - foot.position) @ rotation(foot.yaw)
        case = (foot.side, snapshot.phase is Phase.SINGLE_SUPPORT)
        _show_one(stream, self._patches, case, foot, corners)
        if margin is not None:
            _show_one(stream, self._margins, case, foot, _inner(corners, margin))


def _case(side: Side, is_single: bool) -> str:
    return f"{side.name.lower()}_{'sole' if is_single else 'hull'}"


def _show_one(
    stream: Stream, patches: dict[tuple[Side, bool], Patch], case: tuple[Side, bool], foot: Footstep, polygon: Matrix
) -> None:
    """Of the patches, show the one of a case with a polygon of a foot's frame, if that is not empty."""
    for patch in patches.values():
        patch.hide(stream)
    if len(polygon):
        patches[case].reshape(stream, polygon)
        patches[case].place(stream, foot.position, foot.yaw)


def _inner(corners: Matrix, margin: float) -> Matrix:
    """What a margin leaves of a polygon, both of shape (V, 2), in order; nothing where it is too wide."""
    try:
        inner = inset_vertices(corners, margin)
    except WalkError:
        return np.zeros((0, 2))
    return inner[ConvexHull(inner).vertices]
