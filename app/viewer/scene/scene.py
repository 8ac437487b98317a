"""Scene of one robot: its layers, and the ground that scrolls below.

Everything lives under one frame that is moved by minus the robot's place on the ground. So the camera follows the
robot while the user's orbit of it stays free.
"""

import math
from collections.abc import Sequence, Set

import numpy as np
import viser

from app.drawing.palette import GRID_CELL, GRID_SECTION, GROUND
from app.viewer.scene.frame import FRAMES_PER_LINE, Aim, Canvas, Drawing, Frame, History, RenderQuality
from app.viewer.scene.layers import LAYERS, SEE_THROUGH
from app.viewer.scene.points import body_com
from app.viewer.scene.proportions import Proportions
from app.viewer.scene.robot import TRANSLUCENT, BodyDrawing
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import Parameters, Robot, Snapshot
from walkcore.analysis.push_rose import PushRose
from walkcore.plant.world import PERFECT, World
from walkcore.values import Matrix, Vector

WORLD = "/w"
GROUND_NODE = f"{WORLD}/ground"
GRID_HEIGHT = 0.001  # [m]; at exactly zero the grid can vanish
GRID_SIZE, SECTION, CELL = 40.0, 1.0, 0.25  # [m]
FOLLOW_TIME = 0.6  # [s] in which the camera follows: slow enough not to sway with the robot
MAX_DISTANCE = 1.0  # [m] from the middle to the robot; beyond it the robot was reset, and the camera jumps
CAMERA_POSITION, CAMERA_TARGET = (-2.9, 1.2, 2.1), (0.2, 0.0, 0.7)  # [m], relative to a robot of size 1 on the ground
FIELD_OF_VIEW = 0.70  # [rad]
TALLNESS = 2.0  # heights of the CoM


class Scene:
    """Nodes of one robot's scene, made once and moved afterwards."""

    def __init__(self, server: viser.ViserServer, robot: Robot, quality: RenderQuality) -> None:
        """Make every node, and place the camera.

        Args:
            server: gets the nodes.
            robot: to be drawn.
            quality: amount of detail.
        """
        self.updates = SceneUpdates()
        self.draggable: list[viser.MeshHandle] = []
        """Meshes by which the robot can be pushed."""
        self.links: dict[str, str] = {}
        """Joint that moves each of them, by the path of its node; without those of a point mass."""
        self.shown: Set[str] = {name for name, layer in LAYERS.items() if layer.is_on}
        """Names of the layers that are drawn."""
        self._switched = {name: [f"{WORLD}/{name}"] for name in LAYERS}
        self._translucent: dict[str, None] = {}
        self.drawings: dict[str, Drawing] = {}
        """Drawing of each layer that has one."""
        self._history = History()
        self._nb_frames = 0
        self._middle = (math.inf, math.inf)
        self._slope = 0.0
        _illuminate(server, quality)
        server.scene.add_frame(WORLD, show_axes=False)
        _add_ground(server)
        for name, layer in LAYERS.items():
            root = f"{WORLD}/{name}"
            server.scene.add_frame(root, show_axes=False, visible=layer.is_on)
            if layer.draw is not None:
                canvas = Canvas(
                    server,
                    root,
                    robot,
                    quality,
                    self.draggable,
                    self.links,
                    self.shown,
                    self._switched,
                    self._translucent,
                )
                self.drawings[name] = layer.draw(canvas)
        body = self.drawings["robot"]
        self.height = body.height if isinstance(body, BodyDrawing) else TALLNESS * robot.com_height
        """Height of the robot as it is drawn; of a point mass, as a body would be [m]."""
        camera = server.initial_camera
        size = Proportions.of(robot).size
        camera.position, camera.look_at = size * np.array(CAMERA_POSITION), size * np.array(CAMERA_TARGET)
        camera.fov = FIELD_OF_VIEW

    @property
    def origin(self) -> Vector:
        """Place of the world's origin in the scene [m], shape (3,)."""
        return -self.rotation @ [*self._middle, 0.0]

    @property
    def rotation(self) -> Matrix:
        """Rotation of the world in the scene, whose z is up: ground that rises along x is tilted, shape (3, 3)."""
        c, s = math.cos(self._slope), math.sin(self._slope)
        return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])

    def show(self, layer: str, is_visible: bool) -> None:
        """Show a layer to all who are sent `updates`, or hide it; a hidden layer is not sent."""
        self.shown = self.shown | {layer} if is_visible else self.shown - {layer}
        self.switch(self.updates, layer, is_visible)

    def switch(self, updates: SceneUpdates, layer: str, is_visible: bool) -> None:
        """Show a layer that is drawn, or hide it, to those who are sent some updates."""
        for node in self._switched[layer]:
            updates.visible(node, is_visible)
        if layer == SEE_THROUGH:
            opacity = TRANSLUCENT if is_visible else None
            for mesh in self._translucent:
                updates.properties(mesh, opacity=opacity, cast_shadow=not is_visible)

    def show_all_of(self, shown: Set[str]) -> None:
        """Show these layers, and hide the others."""
        for layer in LAYERS:
            self.show(layer, layer in shown)

    def remember(self, before: Sequence[Snapshot], parameters: Parameters) -> None:
        """Take these snapshots, in the order of time, for the past of the next one that is drawn."""
        self._history.clear()
        for snapshot in before:
            self._history.add(snapshot, parameters, is_on_trail=True)

    def draw(
        self,
        snapshot: Snapshot,
        parameters: Parameters,
        elapsed: float,
        aim: Aim | None = None,
        world: World = PERFECT,
        was: Snapshot | None = None,
        push_rose: PushRose | None = None,
    ) -> None:
        """Collect what a snapshot changes in `updates`.

        Args:
            snapshot: to be drawn.
            parameters: that it was computed with.
            elapsed: real time since the last call [s].
            aim: push that somebody is aiming.
            world: that the robot walks in.
            was: the walk that was at this tick, where this one went on from one of its ticks.
            push_rose: how hard a push from each side the robot would survive.
        """
        self._nb_frames += 1
        has_lines = self._nb_frames % FRAMES_PER_LINE == 0
        self._history.add(snapshot, parameters, is_on_trail=has_lines)
        self._slope = world.slope
        self._scroll(snapshot, elapsed)
        frame = Frame(snapshot, parameters, elapsed, self.shown, self._history, has_lines, aim, world, push_rose, was)
        for name, drawing in self.drawings.items():
            if name in self.shown:
                drawing.update(self.updates, frame)

    def _scroll(self, snapshot: Snapshot, elapsed: float) -> None:
        """Keep the robot in the middle, and the grid below it: by whole sections, so that it never ends."""
        robot, (x, y) = body_com(snapshot).tolist(), self._middle
        if not math.dist(robot, (x, y)) < MAX_DISTANCE:
            x, y = robot
        share = 1.0 - math.exp(-elapsed / FOLLOW_TIME)
        x, y = self._middle = (x + share * (robot[0] - x), y + share * (robot[1] - y))
        self.updates.position(WORLD, self.origin)
        self.updates.orientation(WORLD, (math.cos(self._slope / 2), 0.0, -math.sin(self._slope / 2), 0.0))
        self.updates.position(GROUND_NODE, (SECTION * round(x / SECTION), SECTION * round(y / SECTION), GRID_HEIGHT))


def _add_ground(server: viser.ViserServer) -> None:
    server.scene.add_grid(
        GROUND_NODE,
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


def _illuminate(server: viser.ViserServer, quality: RenderQuality) -> None:
    """Add a soft studio that ships with viser, and a sun over the left shoulder of a viewer behind the robot."""
    server.scene.configure_environment_map("studio", environment_intensity=0.7)
    server.scene.configure_default_lights(enabled=False)
    add_key_light(server.scene, quality.has_shadows)
    server.scene.add_light_directional("/light/fill", position=(2.0, -3.0, 2.0), intensity=0.6, cast_shadow=False)


def add_key_light(scene: viser.SceneApi, has_shadows: bool) -> None:
    """Add the sun; added for one client, it replaces the one of all."""
    scene.add_light_directional("/light/key", position=(-2.0, 3.0, 4.5), intensity=1.5, cast_shadow=has_shadows)
