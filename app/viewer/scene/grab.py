"""Pushing by hand: a drag that starts on the robot's body aims an impulse, and letting go gives it.

A drag across the screen is a direction on the ground: right is right, up is away from
the eye. Back at its beginning, or after Escape, it gives nothing.
"""

import logging
from collections.abc import Iterable
from concurrent.futures import Future
from typing import Any

import numpy as np
import viser

from app.live.runner import NoResponseError, Runner
from walkcore import Push, Snapshot, WalkError
from walkcore.values import Vector

logger = logging.getLogger(__name__)

STRENGTH = 60.0  # [N s] per metre dragged, at the depth of the body
NOTHING = 0.06  # [m] from the beginning of a drag within which it gives nothing
RESOLUTION = 0.5  # [N s]
ROUNDING = 1e-12  # by which the strongest push may not exceed its limit
LONGEST_DRAG = 10.0  # [m] that a client may tell


class Grab:
    """The one drag that is shown; the latest hand has it. All methods belong to viser's event loop."""

    def __init__(self, server: viser.ViserServer, runner: Runner, body: Iterable[viser.MeshHandle]) -> None:
        """Let the body be dragged."""
        self._server, self._runner = server, runner
        self._hand: int | None = None
        self.impulse: Vector | None = None
        """Of the push that is aimed, world frame [N s], shape (2,); None while nobody does."""
        self.answer: Snapshot | None = None
        """What the robot would do, as far as that is known."""
        self._asked: Future[Snapshot] | None = None
        for mesh in body:
            mesh.on_drag("left")(self._drag)
        self._add_escape()

    def _add_escape(self) -> None:
        command = self._server.gui.add_command("Let go of the robot", hotkey="escape")

        @command.on_trigger
        async def _(_: Any) -> None:
            self._let_go()

    async def _drag(self, event: viser.SceneNodeDragEvent[Any]) -> None:
        if event.phase == "start":
            self._let_go()
            self._hand = event.client_id
        if event.client_id != self._hand:
            return  # let go by Escape, or taken over by another hand
        self.impulse = self._impulse(event)
        if event.phase != "end":
            return
        impulse = self.impulse
        self._let_go()
        # viser ends a drag, too, when its browser is gone.
        if impulse is not None and event.client_id in self._server.get_clients():
            self._runner.push(Push(impulse, frame="world"))

    def _impulse(self, event: viser.SceneNodeDragEvent[Any]) -> Vector | None:
        """What a drag gives; None where it is too short."""
        way = np.subtract(event.end_position, event.start_position)
        if not np.linalg.norm(way) < LONGEST_DRAG:
            return None
        drag = on_ground(way, np.asarray(event.client.camera.wxyz))
        length = float(np.hypot(*drag))
        if length < NOTHING:
            return None
        strength = min(STRENGTH * length, self._runner.robot.max_push)
        return (1.0 - ROUNDING) * np.floor(strength / RESOLUTION) * RESOLUTION * drag / length

    def _let_go(self) -> None:
        self._hand = self.impulse = self.answer = None

    def ask(self) -> None:
        """Ask what the robot would do, one question at a time."""
        if self._asked is not None and self._asked.done():
            asked, self._asked = self._asked, None
            self._take(asked)
        if self.impulse is not None and self._asked is None:
            self._asked = self._runner.preview(Push(self.impulse, frame="world"))

    def _take(self, asked: Future[Snapshot]) -> None:
        try:
            answer = asked.result()
        except (WalkError, NoResponseError) as error:
            logger.warning("no preview of a push: %s", error)
            return
        if self.impulse is not None:
            self.answer = answer


def on_ground(way: Vector, wxyz: Vector) -> Vector:
    """A way across the screen as one on the ground, shape (2,) [m].

    Args:
        way: in the world, parallel to the screen [m], shape (3,).
        wxyz: of the camera, which looks along its z with y down.
    """
    w, x, y, z = wxyz
    right = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])
    down = np.array([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)])
    sideways = right[:2] / np.hypot(*right[:2])
    away = np.array([-sideways[1], sideways[0]])  # the camera does not roll
    return sideways * (way @ right) - away * (way @ down)
