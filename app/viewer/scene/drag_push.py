"""Push by a drag that starts on the robot: of the ideal model it aims an impulse on the CoM, and its end gives it.

With contact physics a spring pulls at the point that was taken hold of, towards the cursor, while the drag is held.

A drag across the screen is a direction on the ground: right is right, up is away from the eye. Back at its beginning,
or after Escape, it gives nothing.
"""

import logging
from collections.abc import Iterable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import viser

from app.live.messages import NoResponseError
from app.live.runner import Runner
from app.viewer.scene.frame import Aim
from app.viewer.scene.link_points import LinkPoints
from app.viewer.scene.proportions import Proportions
from walkcore import Push, Snapshot, WalkError
from walkcore.values import Vector

logger = logging.getLogger(__name__)

# Lengths of a robot of size 1; see `Proportions`.
SPEED_PER_METRE = 0.665  # [m/s] that the impulse gives, per metre of the drag at the depth of the body
MIN_DRAG = 0.06  # [m] from the beginning of a drag, within which it gives nothing
MAX_DRAG = 10.0  # [m]; a client may send any
RESOLUTION = 0.5  # [N s]
MIN_LEVEL = 1e-3  # length on the ground of the camera's direction to the right
STIFFNESS = 0.136  # weights of the robot per metre, of the spring from the held point to the cursor
MAX_FORCE = 0.17  # weights of the robot, of the spring
PULL_PERIOD = 0.05  # [s] from one push of the spring to the next
MAX_PULL = 0.1  # [s] of simulated time that one push lasts
ROUNDING = 1e-12  # by which the strongest push may not exceed its limit


class DragPush:
    """The one drag that is shown; the latest client to start one has it. All methods belong to viser's event loop."""

    def __init__(
        self,
        server: viser.ViserServer,
        runner: Runner,
        body: Iterable[viser.MeshHandle],
        points: LinkPoints | None = None,
    ) -> None:
        """Let the body be dragged.

        Args:
            server: whose clients drag.
            runner: gets the pushes.
            body: meshes that can be dragged.
            points: of the links; None of a point mass, which has none.
        """
        self._points, self._hold = points, None
        self._server, self._runner = server, runner
        self._robot = Proportions.of(runner.robot)
        self._client: int | None = None
        self._impulse: Vector | None = None
        self._preview: Snapshot | None = None
        self._request: Future[Snapshot] | None = None
        for mesh in body:
            mesh.on_drag("left")(self.drag)
        command = server.gui.add_command("Let go of the robot", hotkey="escape")

        @command.on_trigger
        async def _(_: Any) -> None:
            self.cancel()

    @property
    def aim(self) -> Aim | None:
        """Push that is being aimed, or the force that is held, if any."""
        if self._hold is not None:
            return self._hold.aim
        return None if self._impulse is None else Aim(self._impulse, self._preview)

    async def drag(self, event: viser.SceneNodeDragEvent[Any]) -> None:
        """Follow a drag; its end pushes the ideal model, or lets go in physics."""
        if event.phase == "start":
            self.cancel()
            self._client = event.client_id
            self._hold = self._grab(event)
        if event.client_id != self._client:
            return  # cancelled, or another client has started a drag
        if self._hold is not None:
            self._hold.cursor, self._hold.camera = np.array(event.end_position), np.asarray(event.client.camera.wxyz)
            if event.phase == "end":
                self.cancel()
            return
        self._impulse = impulse = self._impulse_of(event)
        if event.phase != "end":
            return
        self.cancel()
        # viser ends a drag, too, when its browser disconnects.
        if impulse is not None and event.client_id in self._server.get_clients():
            try:
                self._runner.push(Push(impulse, frame="world"))
            except NoResponseError as error:  # all pages show that, too
                logger.warning("no push by a drag: %s", error)

    def cancel(self) -> None:
        """Forget the drag under way."""
        self._client = self._impulse = self._preview = self._hold = None

    def _grab(self, event: viser.SceneNodeDragEvent[Any]) -> "Hold | None":
        """The hold of a drag that starts, where a link of the real body can be held."""
        if self._points is None or self._runner.latest.snapshot.plant is None:
            return None
        start, node = np.array(event.start_position), event.target.name
        link, point = self._points.grabbed(node, start, self._runner.latest.snapshot)
        pulled_at = self._runner.latest.snapshot.t
        return Hold(link, point, start, np.asarray(event.client.camera.wxyz), pulled_at)

    def pull(self) -> None:
        """Push by the spring of a drag that is held; called each `PULL_PERIOD`.

        A push lasts as long as the simulated time since the one before: so the force is the same at any speed.
        """
        hold = self._hold
        if hold is None or self._points is None:
            return
        state = self._runner.latest
        if state.snapshot.plant is None or not state.running:
            hold.aim = None
            return
        duration, hold.pulled_at = min(state.snapshot.t - hold.pulled_at, MAX_PULL), state.snapshot.t
        if duration <= 0.0:
            return
        stretch = hold.cursor - self._points.in_scene(hold.link, hold.point, state.snapshot)
        force = spring_force(stretch, hold.camera, self._robot)
        if force is None:
            hold.aim = None
            return
        try:
            self._runner.push(Push(duration * force, duration, "world", hold.link, hold.point))
        except (WalkError, NoResponseError) as error:
            logger.warning("a held push is not taken: %s", error)
            return
        hold.impulse = hold.impulse + duration * force
        held = self._points.in_world(hold.link, hold.point, state.snapshot)
        hold.aim = Aim(hold.impulse, None, force, held)

    def _impulse_of(self, event: viser.SceneNodeDragEvent[Any]) -> Vector | None:
        """Impulse that a drag gives, world frame [N s], shape (2,); None where it is too short."""
        p_start_end = np.subtract(event.end_position, event.start_position)
        if not np.linalg.norm(p_start_end) < MAX_DRAG:
            return None
        drag = on_ground(p_start_end, np.asarray(event.client.camera.wxyz))
        length = float(np.hypot(*drag))
        if not length >= self._robot.size * MIN_DRAG:  # nor where the camera's sideways is no direction on the ground
            return None
        strength = min(
            self._robot.impulse_per_speed * SPEED_PER_METRE * length / self._robot.size, self._runner.robot.max_push
        )
        return (1.0 - ROUNDING) * np.floor(strength / RESOLUTION) * RESOLUTION * drag / length

    def request_preview(self) -> None:
        """Ask the control process for the effect of the aimed push, one request at a time."""
        if self._request is not None and self._request.done():
            finished, self._request = self._request, None
            self._receive(finished)
        if self._impulse is not None and self._request is None:
            self._request = self._runner.preview(Push(self._impulse, frame="world"))

    def _receive(self, finished: Future[Snapshot]) -> None:
        try:
            preview = finished.result()
        except NoResponseError:  # all pages show that, and this comes with every frame
            return
        except WalkError as error:
            logger.warning("no preview of a push: %s", error)
            return
        if self._impulse is not None:
            self._preview = preview


@dataclass(slots=True)
class Hold:
    """A point of a link that a drag holds."""

    link: str
    """Joint that moves the link."""
    point: Vector
    """Place on it, in the frame of that joint [m], shape (3,)."""
    cursor: Vector
    """Place of the cursor in the scene [m], shape (3,)."""
    camera: Vector
    """Orientation of the camera, a quaternion wxyz."""
    pulled_at: float
    """Simulated time of the last push [s]."""
    impulse: Vector = field(default_factory=lambda: np.zeros(2))
    """Impulse given so far, world frame [N s], shape (2,)."""
    aim: Aim | None = None
    """The force as it is drawn; None while there is none."""


def spring_force(stretch: Vector, camera: Vector, robot: Proportions) -> Vector | None:
    """Horizontal force of a spring, world frame [N], shape (2,); None where the drag is too short or endless.

    Args:
        stretch: from the held point to the cursor [m], shape (3,).
        camera: orientation of the camera, a quaternion wxyz.
        robot: that is pulled.
    """
    if not np.linalg.norm(stretch) < MAX_DRAG:
        return None
    drag = on_ground(stretch, camera)
    length = float(np.hypot(*drag))
    if not length >= robot.size * MIN_DRAG:
        return None
    return robot.weight * min(STIFFNESS * length / robot.size, MAX_FORCE) * drag / length


def on_ground(drag: Vector, wxyz: Vector) -> Vector:
    """Drag across the screen as one on the ground [m], shape (2,); NaN for a camera that lies on its side.

    Args:
        drag: parallel to the screen, world frame [m], shape (3,).
        wxyz: orientation of the camera, which looks along its z with y down.
    """
    w, x, y, z = wxyz
    right = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])
    down = np.array([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)])
    level = np.hypot(*right[:2])
    if level < MIN_LEVEL:
        return np.full(2, np.nan)
    sideways = right[:2] / level
    away = np.array([-sideways[1], sideways[0]])  # the camera does not roll
    return sideways * (drag @ right) - away * (drag @ down)
