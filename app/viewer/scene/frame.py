"""Input of the layers: the canvas on which each makes its nodes, and the frame that each draws."""

import math
from collections import deque
from collections.abc import Set
from dataclasses import dataclass
from typing import Protocol

import viser

from app.viewer.scene.proportions import Proportions
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import Parameters, Robot, Snapshot
from walkcore.analysis.push_rose import PushRose
from walkcore.mpc.gait import Phase
from walkcore.mpc.stance import Side
from walkcore.plant.world import PERFECT, World
from walkcore.pushes import GivenPush
from walkcore.values import Vector

Pose = tuple[float, float, float]  # x, y [m], yaw [rad]
ROUNDING = 1e-6  # [s] between equal durations

PRINTS_PER_FOOT = 6
TRAIL_POINTS = 20  # two seconds
FRAMES_PER_LINE = 3  # lines are sent at a third of the rate: a client rebuilds them


@dataclass(frozen=True, slots=True)
class RenderQuality:
    """Amount of detail that a client has to render."""

    face_ratio: float = 0.3
    """Fraction of the faces of the robot's meshes."""
    has_shadows: bool = True


LIGHT = RenderQuality(face_ratio=0.1, has_shadows=False)
"""Quality for machines that render in software."""


@dataclass(frozen=True, slots=True)
class Canvas:
    """Place for the nodes of one layer."""

    server: viser.ViserServer
    root: str
    """Path of the node that is hidden with the layer; its frame is the world's."""
    robot: Robot
    quality: RenderQuality
    draggable: list[viser.MeshHandle]
    """Meshes of all layers that can be dragged to push the robot; a drawing adds its own."""
    links: dict[str, str]
    """Joint that moves each such mesh, by the path of its node; a drawing adds its own."""
    shown: Set[str]
    """Names of the layers that are shown at the start."""
    switched: dict[str, list[str]]
    """Paths of the nodes that a layer shows or hides, by its name; a drawing adds those that lie in other layers."""
    translucent: dict[str, None]
    """Paths of the meshes that the layer "see_through" lets the centre of mass show through; a drawing adds its own."""

    @property
    def proportions(self) -> Proportions:
        """Size and mass of the robot, which what is drawn follows."""
        return Proportions.of(self.robot)


@dataclass(frozen=True, slots=True)
class Footprint:
    """Place where a sole stood."""

    pose: Pose
    is_of_shortened_step: bool
    """Whether the step that led there took less than the usual time."""


def is_shortened(duration: float, parameters: Parameters) -> bool:
    """Whether a step takes less than the usual time.

    Args:
        duration: of the step [s].
        parameters: in force.
    """
    return duration < parameters.step_duration - ROUNDING


class History:
    """Past of the walk that a snapshot does not hold; it is kept for hidden layers, too."""

    def __init__(self) -> None:
        """Start with no past."""
        self.footprints: dict[Side, deque[Footprint]] = {side: deque(maxlen=PRINTS_PER_FOOT) for side in Side}
        """Last places where each sole stood, the latest first."""
        self.nb_changes = 0
        """Number of changes of the footprints so far."""
        self.trail: deque[Snapshot] = deque(maxlen=TRAIL_POINTS)
        """Snapshots of the last two seconds, the latest last; always as many."""
        self.new_push: GivenPush | None = None
        """Push since the snapshot before."""
        self._last_tick: float = math.inf
        self._was_shortened = False

    def clear(self) -> None:
        """Forget the past."""
        self._last_tick = math.inf
        self.trail.clear()
        for places in self.footprints.values():
            places.clear()
        self.nb_changes += 1

    def add(self, snapshot: Snapshot, parameters: Parameters, *, is_on_trail: bool) -> None:
        """Add a drawn snapshot; one from before the last, after a reset of the robot, starts a new past."""
        if snapshot.tick < self._last_tick:
            self.clear()
        push = snapshot.last_push
        self.new_push = push if push is not None and push.tick > self._last_tick else None
        self._last_tick = snapshot.tick
        for side, foot in snapshot.feet.items():
            x, y, yaw = foot.pose.tolist()
            places = self.footprints[side]
            if foot.height == 0.0 and (not places or places[0].pose != (x, y, yaw)):
                places.appendleft(Footprint((x, y, yaw), self._was_shortened))
                self.nb_changes += 1
        is_in_air = snapshot.phase is Phase.SINGLE_SUPPORT
        self._was_shortened = is_in_air and is_shortened(snapshot.step_duration, parameters)
        if is_on_trail:
            self.trail.extend([snapshot] * (1 if self.trail else TRAIL_POINTS))


@dataclass(frozen=True, slots=True)
class Aim:
    """Push that somebody is aiming."""

    impulse: Vector
    """World frame [N s], shape (2,)."""
    preview: Snapshot | None
    """First snapshot after the push, as soon as it is known."""
    force: Vector | None = None
    """Force that acts now, world frame [N], shape (2,); None of a push that only comes."""
    point: Vector | None = None
    """Place that is held, world frame [m], shape (3,); None of a push on the CoM."""


@dataclass(frozen=True, slots=True)
class Frame:
    """State of the robot to be drawn."""

    snapshot: Snapshot
    parameters: Parameters
    """Parameters that the snapshot was computed with."""
    elapsed: float
    """Real time since the frame before [s]."""
    shown: Set[str]
    """Names of the layers that are shown."""
    history: History
    has_lines: bool
    """Whether lines are sent in this frame."""
    aim: Aim | None = None
    world: World = PERFECT
    """World that the robot walks in."""
    push_rose: PushRose | None = None
    """How hard a push from each side the robot would survive, where somebody asked for that."""
    was: Snapshot | None = None
    """The walk that was, where this one went on from one of its ticks."""


class Drawing(Protocol):
    """Drawing of one layer, made once on a canvas."""

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw a frame; called for every frame in which the layer is shown.

        Nodes move at every frame, through `updates` only; shapes change where `frame.has_lines`, ten times a second.
        """
        ...
