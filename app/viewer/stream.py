"""What changes in the scene from one drawn frame to the next, as messages to viser's clients.

Queued directly: an assignment to a viser handle costs several times as much. Nodes are
made once; afterwards only poses, visibility and properties of them are sent, and of
those only what differs from what was sent before.

A client applies a pose at once, but builds a node anew for a property, which a slow one
shows late. So whatever moves is moved by its pose, and its shape is given where it moves.
"""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import viser
from viser import _messages


class Stream:
    """Collects the messages of one frame, then sends them at once."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Send to all clients of a server."""
        self._server = server
        self._sent: dict[tuple[str, str], Any] = {}
        self._messages: list[_messages.Message] = []

    def position(self, name: str, position: Iterable[float]) -> None:
        """Where a node is in its parent's frame [m], shape (3,)."""
        x, y, z = position
        value = (float(x), float(y), float(z))
        if self._is_new(name, "position", value):
            self._messages.append(_messages.SetPositionMessage(name, value))

    def orientation(self, name: str, wxyz: tuple[float, ...]) -> None:
        """How a node is turned in its parent's frame."""
        if self._is_new(name, "orientation", wxyz):
            self._messages.append(_messages.SetOrientationMessage(name, wxyz))  # pyright: ignore[reportArgumentType]

    def on_ground(self, name: str, position: Iterable[float], yaw: float = 0.0, height: float = 0.0) -> None:
        """Where a node stands on the ground [m], shape (2,), and its yaw [rad]."""
        x, y = position
        self.position(name, (x, y, height))
        self.orientation(name, (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))

    def visible(self, name: str, is_visible: bool) -> None:
        """Whether a node and its children are drawn."""
        if self._is_new(name, "visible", is_visible):
            self._messages.append(_messages.SetSceneNodeVisibilityMessage(name, is_visible))

    def properties(self, name: str, **values: Any) -> None:
        """Properties of a node by their names in viser; arrays in the types that viser sends."""
        changed = {key: value for key, value in values.items() if self._is_new(name, key, value)}
        if changed:
            self._messages.append(_messages.SceneNodeUpdateMessage(name, changed))

    def _is_new(self, name: str, what: str, value: Any) -> bool:
        key = (name, what)
        if key in self._sent:
            sent = self._sent[key]
            if np.array_equal(sent, value) if isinstance(value, np.ndarray) else sent == value:
                return False
        self._sent[key] = value
        return True

    def flush(self) -> None:
        """Send what was collected."""
        messages, self._messages = self._messages, []
        with self._server.atomic():  # nothing at all is sent while this is open
            for message in messages:
                self._server.scene._queue_scene_message(message)
        self._server.flush()
