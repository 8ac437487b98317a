"""Draws snapshots: the robot, its soles on the ground, its balance, and the ground that scrolls below.

Everything lives under one frame that is moved by minus the robot's place on the ground.
So the camera follows the robot while the user's orbit of it stays free.
"""

import math
from dataclasses import dataclass

import viser

from app.drawing.palette import GRID_CELL, GRID_SECTION, GROUND
from app.viewer.scene.arrows import PushArrow, VelocityArrows
from app.viewer.scene.body import draw_robot
from app.viewer.scene.constraints import ActiveConstraints
from app.viewer.scene.footprints import FootholdRegions, PastFootprints, PlannedSoles, SupportPolygon
from app.viewer.scene.layers import LAYERS
from app.viewer.scene.markers import Balance
from app.viewer.scene.push_preview import PushPreview
from app.viewer.scene.push_watch import PushWatch
from app.viewer.transport.stream import Stream
from walkcore import Parameters, Robot, Snapshot
from walkcore.values import Vector

WORLD = "/w"
GRID_HEIGHT = 0.001  # [m]; at exactly zero the grid can vanish
GRID_SIZE, SECTION, CELL = 40.0, 1.0, 0.25  # [m]
FOLLOW_TIME = 0.6  # [s] in which the camera follows: slow enough not to sway with the robot
FARTHEST_BEHIND = 1.0  # [m]; beyond it the robot was reset, and the camera jumps


@dataclass(frozen=True, slots=True)
class Look:
    """How much a client has to render."""

    face_ratio: float = 0.3
    """Fraction of the faces of the robot's meshes."""
    has_shadows: bool = True


LIGHT = Look(face_ratio=0.1, has_shadows=False)
"""For machines that render in software."""


class Scene:
    """The nodes of one robot's scene, made once and moved afterwards."""

    def __init__(self, server: viser.ViserServer, robot: Robot, look: Look) -> None:
        """Make every node."""
        self.stream = Stream()
        self._shown = {name for name, layer in LAYERS.items() if layer.is_on}
        self._middle = (math.inf, math.inf)
        self._last_tick = 0
        self._pushes = PushWatch(robot.mass)
        _illuminate(server, look)
        server.scene.add_frame(WORLD, show_axes=False)
        _lay_ground(server)
        roots = {name: f"{WORLD}/{name}" for name in LAYERS}
        for name, layer in LAYERS.items():
            server.scene.add_frame(roots[name], show_axes=False, visible=layer.is_on)
        self._robot = draw_robot(server, roots["robot"], robot, look.face_ratio)
        self._past = PastFootprints(server, roots["footprints"], robot)
        self._planned = PlannedSoles(server, roots["plan"], robot)
        self._regions = FootholdRegions(server, roots["regions"], robot)
        self._support = SupportPolygon(server, roots["support"], roots["margin"], robot)
        self._balance = Balance(server, roots)
        self._velocities = VelocityArrows(server, roots)
        self._push = PushArrow(server, roots["push"])
        self._aimed = PushPreview(server, roots["push"], robot)
        self._active = ActiveConstraints(server, roots["active"], robot)

    @property
    def body(self) -> list[viser.MeshHandle]:
        """What a hand can take hold of."""
        return self._robot.meshes

    def aim(self, snapshot: Snapshot, parameters: Parameters, impulse: Vector | None, answer: Snapshot | None) -> None:
        """Draw a push that somebody is about to give, and what the robot would do; see `PushPreview.update`."""
        self._aimed.update(self.stream, snapshot, parameters, impulse, answer)

    def show(self, layer: str, is_visible: bool) -> None:
        """Draw a layer, or hide it; what is hidden is not sent."""
        (self._shown.add if is_visible else self._shown.discard)(layer)
        self.stream.visible(f"{WORLD}/{layer}", is_visible)

    def see_through(self, is_see_through: bool) -> None:
        """Let the centre of mass show through the robot, or not."""
        self._robot.see_through(self.stream, is_see_through)

    def draw(self, snapshot: Snapshot, parameters: Parameters, elapsed: float) -> None:
        """Put into the stream what a snapshot changes.

        Args:
            snapshot: to be drawn.
            parameters: with which it came about.
            elapsed: real time since the last call [s].
        """
        if snapshot.tick < self._last_tick:
            self._past.forget()
            self._balance.forget()
        self._last_tick = snapshot.tick
        stream, shown = self.stream, self._shown
        self._scroll(snapshot, elapsed)
        if "robot" in shown:
            self._robot.update(stream, snapshot)
        self._past.update(stream, snapshot)  # while it is hidden, too: what has been cannot be told later
        if "plan" in shown:
            self._planned.update(stream, snapshot)
        if "regions" in shown:
            self._regions.update(stream, snapshot)
        if shown & {"support", "margin"}:
            self._support.update(stream, snapshot, parameters.cop_margin if "margin" in shown else None)
        self._balance.update(stream, snapshot, math.sqrt(parameters.gravity / snapshot.com_height), shown)
        self._velocities.update(stream, snapshot, shown)
        self._push.update(stream, snapshot, self._pushes.impulse(snapshot), elapsed)
        if "active" in shown:
            self._active.update(stream, snapshot, parameters)

    def _scroll(self, snapshot: Snapshot, elapsed: float) -> None:
        """Keep the robot in the middle, and the grid below it: whole sections at a time, so that it never ends."""
        robot, (x, y) = snapshot.com.position.tolist(), self._middle
        if not math.dist(robot, (x, y)) < FARTHEST_BEHIND:
            x, y = robot
        share = 1.0 - math.exp(-elapsed / FOLLOW_TIME)
        x, y = self._middle = (x + share * (robot[0] - x), y + share * (robot[1] - y))
        self.stream.position(WORLD, (-x, -y, 0.0))
        self.stream.position(
            f"{WORLD}/ground", (SECTION * round(x / SECTION), SECTION * round(y / SECTION), GRID_HEIGHT)
        )


def _lay_ground(server: viser.ViserServer) -> None:
    server.scene.add_grid(
        f"{WORLD}/ground",
        width=GRID_SIZE,
        height=GRID_SIZE,
        position=(0.0, 0.0, GRID_HEIGHT),
        cell_size=CELL,
        cell_color=GRID_CELL,
        cell_thickness=0.6,
        section_size=SECTION,
        section_color=GRID_SECTION,
        section_thickness=1.0,
        fade_from="origin",  # where the robot is, whatever the camera does
        fade_distance=9.0,
        fade_strength=1.6,
        shadow_opacity=0.35,
        plane_color=GROUND,
        plane_opacity=0.22,
    )


def _illuminate(server: viser.ViserServer, look: Look) -> None:
    """A soft studio that ships with viser, and a sun over the left shoulder of whoever stands behind the robot."""
    server.scene.configure_environment_map("studio", environment_intensity=0.7)
    server.scene.configure_default_lights(enabled=False)
    add_key_light(server.scene, look.has_shadows)
    server.scene.add_light_directional("/light/fill", position=(2.0, -3.0, 2.0), intensity=0.6, cast_shadow=False)


def add_key_light(scene: viser.SceneApi, has_shadows: bool) -> None:
    """The sun; added for one client, it takes the place of the one for all."""
    scene.add_light_directional("/light/key", position=(-2.0, 3.0, 4.5), intensity=1.5, cast_shadow=has_shadows)
