"""The soles on the ground: where they stood, where they will, and what carries the robot now."""

from collections import deque
from itertools import zip_longest

import numpy as np
import viser

from app.outlines import support_polygon
from app.palette import LEFT_FOOT, REFERENCE, RIGHT_FOOT, SUPPORT, Colour
from app.viewer.shapes import counter_clockwise, fan, outline, raised
from app.viewer.stream import Stream
from walkcore import Robot, Snapshot
from walkcore.gait import Footstep, Phase, Side
from walkcore.regions import mirrored
from walkcore.values import Matrix, rotation

Place = tuple[float, float, float]  # x, y [m], yaw [rad]

PRINTS_PER_FOOT = 6
PLANNED_PER_FOOT = 4  # of a long horizon; of the default one there are two
FRESH_OPACITY = 0.8
PRINT_HEIGHT, REGION_HEIGHT, PLAN_HEIGHT, SUPPORT_HEIGHT = 0.002, 0.003, 0.004, 0.005  # [m], so that none hides another
GREYS = {Side.LEFT: LEFT_FOOT, Side.RIGHT: RIGHT_FOOT}


class PastFootprints:
    """The last soles set down by each foot: a fixed number of prints, each fainter than the one after it."""

    def __init__(self, server: viser.ViserServer, root: str, robot: Robot) -> None:
        """Make the nodes once, invisible."""
        self._places: dict[Side, deque[Place]] = {side: deque(maxlen=PRINTS_PER_FOOT) for side in Side}
        self._names = {side: [f"{root}/{side.name.lower()}_{age}" for age in range(PRINTS_PER_FOOT)] for side in Side}
        for side, names in self._names.items():
            sole = counter_clockwise(robot.sole if side is Side.LEFT else mirrored(robot.sole))
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
            places = self._places[side]
            place = (*foot.position.tolist(), foot.yaw)
            if foot.height == 0.0 and (not places or places[0] != place):
                places.appendleft(place)
            for age, name in enumerate(self._names[side]):
                stream.visible(name, age < len(places))
            for name, (x, y, yaw) in zip(self._names[side], places, strict=False):
                stream.on_ground(name, (x, y), yaw)

    def forget(self) -> None:
        """Begin anew, after a reset of the robot."""
        for places in self._places.values():
            places.clear()


class Patch:
    """A convex polygon on the ground, filled and outlined, in a frame that moves."""

    def __init__(
        self, server: viser.ViserServer, name: str, colour: Colour, height: float, opacity: float, thickness: float
    ) -> None:
        """Make the nodes once; nothing is drawn before the first `update`."""
        self._name = name
        self._height = height
        triangle = np.zeros((3, 3), dtype=np.float32)
        server.scene.add_frame(name, show_axes=False, visible=False)
        server.scene.add_mesh_simple(
            f"{name}/fill",
            triangle,
            fan(3),
            color=colour,
            opacity=opacity,
            cast_shadow=False,
            receive_shadow=False,
        )
        server.scene.add_line_segments(
            f"{name}/outline", outline(triangle), colors=colour, thickness=thickness, thickness_units="screen"
        )

    def update(self, stream: Stream, frame: Footstep, polygon: Matrix) -> None:
        """Draw a polygon, shape (V, 2), of the frame of a foot [m]."""
        corners = raised(counter_clockwise(polygon), 0.0)
        stream.on_ground(self._name, frame.position, frame.yaw, self._height)
        stream.properties(f"{self._name}/fill", vertices=corners, faces=fan(len(corners)))
        stream.properties(f"{self._name}/outline", points=outline(corners))
        stream.visible(self._name, True)

    def hide(self, stream: Stream) -> None:
        """Draw nothing."""
        stream.visible(self._name, False)


class PlannedSoles:
    """The footholds that the plan holds, left and right told apart, and the region of the next one."""

    def __init__(self, server: viser.ViserServer, root: str, region: str, robot: Robot) -> None:
        """Make the nodes once."""
        self._robot = robot
        self._patches = {
            side: [
                Patch(server, f"{root}/{side.name.lower()}_{i}", colour, PLAN_HEIGHT, opacity=0.22, thickness=2.5)
                for i in range(PLANNED_PER_FOOT)
            ]
            for side, colour in GREYS.items()
        }
        self._region = Patch(server, f"{region}/next", REFERENCE, REGION_HEIGHT, opacity=0.08, thickness=1.5)

    def update(self, stream: Stream, snapshot: Snapshot) -> None:
        """Draw the footholds of the snapshot's plan."""
        footholds = snapshot.plan.footholds if snapshot.plan is not None else ()
        for side, patches in self._patches.items():
            sole = self._robot.sole if side is Side.LEFT else mirrored(self._robot.sole)
            feet = [foot for foot in footholds if foot.side is side]
            for patch, foot in zip_longest(patches, feet[: len(patches)]):
                patch.update(stream, foot, sole) if foot is not None else patch.hide(stream)
        if footholds:
            region = self._robot.foothold_region_at(footholds[0].yaw - snapshot.support.yaw, footholds[0].side)
            self._region.update(stream, snapshot.support, region)
        else:
            self._region.hide(stream)


class SupportPolygon:
    """The hull of the soles that carry the robot: a patch for each case, of which one is shown."""

    def __init__(self, server: viser.ViserServer, root: str, robot: Robot) -> None:
        """Make the nodes once."""
        self._robot = robot
        self._patches = {
            (side, is_single): Patch(
                server,
                f"{root}/{side.name.lower()}_{'sole' if is_single else 'hull'}",
                SUPPORT,
                SUPPORT_HEIGHT,
                opacity=0.3,
                thickness=2.5,
            )
            for side in Side
            for is_single in (True, False)
        }

    def update(self, stream: Stream, snapshot: Snapshot) -> None:
        """Draw the polygon of the snapshot's phase."""
        foot = snapshot.support
        corners = support_polygon(self._robot, snapshot) - foot.position
        shown = self._patches[foot.side, snapshot.phase is Phase.SINGLE_SUPPORT]
        for patch in self._patches.values():
            if patch is not shown:
                patch.hide(stream)
        # Rounded, so that one step's polygon is the next one's and need not be sent again.
        shown.update(stream, foot, np.round(corners @ rotation(foot.yaw), 4))
