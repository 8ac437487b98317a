"""Push by a drag that starts on the robot's body: it aims an impulse, and its end gives it.

A drag across the screen is a direction on the ground: right is right, up is away from the eye. Back at its beginning,
or after Escape, it gives nothing.
"""

import logging
from collections.abc import Iterable
from concurrent.futures import Future
from typing import Any

import numpy as np
import viser

from app.live.runner import NoResponseError, Runner
from app.viewer.scene.frame import Aim
from walkcore import Push, Snapshot, WalkError
from walkcore.values import Vector

logger = logging.getLogger(__name__)

IMPULSE_PER_METRE = 60.0  # [N s/m] of the drag, at the depth of the body
MIN_DRAG = 0.06  # [m] from the beginning of a drag, within which it gives nothing
MAX_DRAG = 10.0  # [m]; a client may send any
RESOLUTION = 0.5  # [N s]
MIN_LEVEL = 1e-3  # length on the ground of the camera's direction to the right
ROUNDING = 1e-12  # by which the strongest push may not exceed its limit


class DragPush:
    """The one drag that is shown; the latest client to start one has it. All methods belong to viser's event loop."""

    def __init__(self, server: viser.ViserServer, runner: Runner, body: Iterable[viser.MeshHandle]) -> None:
        """Let the body be dragged."""
        self._server, self._runner = server, runner
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
        """Push that is being aimed, if any."""
        return None if self._impulse is None else Aim(self._impulse, self._preview)

    async def drag(self, event: viser.SceneNodeDragEvent[Any]) -> None:
        """Follow a drag; its end pushes the robot."""
        if event.phase == "start":
            self.cancel()
            self._client = event.client_id
        if event.client_id != self._client:
            return  # cancelled, or another client has started a drag
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
        self._client = self._impulse = self._preview = None

    def _impulse_of(self, event: viser.SceneNodeDragEvent[Any]) -> Vector | None:
        """Impulse that a drag gives, world frame [N s], shape (2,); None where it is too short."""
        p_start_end = np.subtract(event.end_position, event.start_position)
        if not np.linalg.norm(p_start_end) < MAX_DRAG:
            return None
        drag = on_ground(p_start_end, np.asarray(event.client.camera.wxyz))
        length = float(np.hypot(*drag))
        if not length >= MIN_DRAG:  # nor where the camera's sideways is no direction on the ground
            return None
        strength = min(IMPULSE_PER_METRE * length, self._runner.robot.max_push)
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
