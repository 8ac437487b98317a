"""Draws snapshots: the robot, its soles on the ground, its balance, and the ground that scrolls below.

Everything lives under one frame that is moved by minus the robot's place on the ground.
So the camera follows the robot while the user's orbit of it stays free.
"""

from dataclasses import dataclass

import numpy as np
import viser

from app.viewer.body import draw_robot
from app.viewer.footprints import PastFootprints, PlannedSoles, SupportPolygon
from app.viewer.markers import Arrows, Balance
from app.viewer.palette import GRID_CELL, GRID_SECTION, GROUND
from app.viewer.push_watch import PushWatch
from app.viewer.stream import Stream
from walkcore import Robot, Snapshot

WORLD = "/w"
GRID_HEIGHT = 0.001  # [m]; at exactly zero the grid can vanish
GRID_SIZE, SECTION, CELL = 40.0, 1.0, 0.25  # [m]
FOLLOW_TIME = 0.6  # [s] in which the camera follows: slow enough not to sway with the robot
FARTHEST_BEHIND = 1.0  # [m]; beyond it the robot was reset, and the camera jumps

LAYERS = {
    "robot": "the robot itself",
    "footprints": "soles where they stood: left darker, right lighter",
    "support": "support polygon, in green",
    "plan": "planned soles, previewed CoM (red) and CoP (grey dashes)",
    "balance": "CoM (red), CoP of the model (black), CoP of the full body (orange)",
    "trails": "CoM and CoP of the last two seconds",
    "region": "where the next foot may land",
    "arrows": "velocity asked for (blue) and push (magenta)",
}
HIDDEN_AT_START = {"region"}


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
        self._stream = Stream(server)
        self._middle = np.full(2, np.inf)
        self._last_tick = 0
        self._pushes = PushWatch(robot.mass)
        _illuminate(server, look)
        server.scene.add_frame(WORLD, show_axes=False)
        _lay_ground(server)
        for layer in LAYERS:
            server.scene.add_frame(_node(layer), show_axes=False, visible=layer not in HIDDEN_AT_START)
        self._robot = draw_robot(server, _node("robot"), robot, look.face_ratio)
        self._past = PastFootprints(server, _node("footprints"), robot)
        self._planned = PlannedSoles(server, _node("plan"), _node("region"), robot)
        self._support = SupportPolygon(server, _node("support"), robot)
        self._balance = Balance(server, _node("balance"), _node("trails"), _node("plan"))
        self._arrows = Arrows(server, _node("arrows"))

    def show(self, layer: str, is_visible: bool) -> None:
        """Draw a layer, or hide it."""
        self._stream.visible(_node(layer), is_visible)

    def see_through(self, is_see_through: bool) -> None:
        """Let the centre of mass show through the robot, or not."""
        self._robot.see_through(self._stream, is_see_through)

    def draw(self, snapshot: Snapshot, elapsed: float) -> None:
        """Send what a snapshot changes.

        Args:
            snapshot: to be drawn.
            elapsed: real time since the last call [s].
        """
        if snapshot.tick < self._last_tick:
            self._past.forget()
            self._balance.forget()
        self._last_tick = snapshot.tick
        self._scroll(snapshot, elapsed)
        self._robot.update(self._stream, snapshot)
        self._past.update(self._stream, snapshot)
        self._planned.update(self._stream, snapshot)
        self._support.update(self._stream, snapshot)
        self._balance.update(self._stream, snapshot)
        self._arrows.update(self._stream, snapshot, self._pushes.impulse(snapshot), elapsed)
        self._stream.flush()

    def _scroll(self, snapshot: Snapshot, elapsed: float) -> None:
        """Keep the robot in the middle, and the grid below it: whole sections at a time, so that it never ends."""
        robot = snapshot.com.position
        if not np.hypot(*(robot - self._middle)) < FARTHEST_BEHIND:
            self._middle = np.array(robot)
        self._middle += (robot - self._middle) * (1.0 - np.exp(-elapsed / FOLLOW_TIME))
        self._stream.position(WORLD, (*-self._middle, 0.0))
        self._stream.position(f"{WORLD}/ground", (*np.round(self._middle / SECTION) * SECTION, GRID_HEIGHT))


def _node(layer: str) -> str:
    return f"{WORLD}/{layer}"


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
