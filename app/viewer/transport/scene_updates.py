"""Latest value of everything that changes in the scene, and the frame that changed it.

viser keeps every message for the clients to come, numbers it, and encodes it anew for each client. At thirty frames
a second that costs more than the drawing, and a client that joins after hours of it stalls the others. So viser gets
what is made once, and changes go another way: only the latest values are kept, and a client is sent those that changed
since it was last sent any (`broadcaster`). A client that is too slow, or new, gets more of them at once.

A client applies a pose at once, but rebuilds a node when a property changes, which a slow one shows late. So whatever
moves is moved by its pose, and its shape is given in the frame that moves.
"""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import viser

from app.viewer.transport.viser_private import (
    CONTROL_PROPERTIES,
    NODE_PROPERTIES,
    ORIENTATION,
    POSITION,
    VISIBILITY,
    control_id,
)

Message = dict[str, Any]
"""Message as viser's clients read it: `type` is the name of a class in `viser._messages`."""

DIGITS = 5  # decimals of poses: a hundredth of a millimetre; a smaller motion is not sent


class SceneUpdates:
    """Latest values, numbered by the frame that changed them."""

    def __init__(self) -> None:
        """Start with no changes."""
        self.frame = 0
        """Number of the frame whose values are being collected."""
        self._values: dict[tuple[str, str, str], Any] = {}
        self._changed: dict[tuple[str, str, str], int] = {}
        self._fresh: dict[tuple[str, str, str], None] = {}

    def position(self, name: str, position: Iterable[float]) -> None:
        """Set the position of a node in its parent's frame [m], shape (3,)."""
        x, y, z = position
        value = (round(float(x), DIGITS), round(float(y), DIGITS), round(float(z), DIGITS))
        self._set((POSITION, name, "position"), value)

    def orientation(self, name: str, wxyz: Iterable[float]) -> None:
        """Set the orientation of a node in its parent's frame, a quaternion wxyz."""
        w, x, y, z = wxyz
        value = (round(w, DIGITS), round(x, DIGITS), round(y, DIGITS), round(z, DIGITS))
        self._set((ORIENTATION, name, "wxyz"), value)

    def on_ground(self, name: str, position: Iterable[float], yaw: float | None = None, height: float = 0.0) -> None:
        """Place a node on the ground.

        Args:
            name: path of the node.
            position: in its parent's frame [m], shape (2,).
            yaw: [rad]; None for a node that never turns.
            height: above the ground [m].
        """
        x, y = position
        self.position(name, (x, y, height))
        if yaw is not None:
            self.orientation(name, (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))

    def visible(self, name: str, is_visible: bool) -> None:
        """Draw a node and its children, or hide them."""
        self._set((VISIBILITY, name, "visible"), is_visible)

    def properties(self, name: str, **values: Any) -> None:
        """Set properties of a node by their names in viser, arrays in the types that viser sends."""
        for key, value in values.items():
            self._set((NODE_PROPERTIES, name, key), value)

    def control(
        self, control: viser.GuiUplotHandle | viser.GuiHtmlHandle | viser.GuiCheckboxHandle, **values: Any
    ) -> None:
        """Set properties of a control of the panel."""
        for key, value in values.items():
            self._set((CONTROL_PROPERTIES, control_id(control), key), value)

    def _set(self, key: tuple[str, str, str], value: Any) -> None:
        if key in self._values and _is_same(self._values[key], value):
            return
        self._values[key] = value
        self._changed[key] = self.frame
        self._fresh[key] = None

    def next_frame(self) -> None:
        """End the frame: later values belong to the next one."""
        self.frame += 1
        self._fresh = {}

    def changes(self, since: int) -> list[Message]:
        """Messages that bring a client up to date that has seen all frames before `since`."""
        fresh = self._fresh if since == self.frame else [key for key, at in self._changed.items() if at >= since]
        messages: list[Message] = []
        updates: dict[tuple[str, str], Message] = {}
        for key in fresh:
            kind, name, field = key
            if kind == NODE_PROPERTIES or kind == CONTROL_PROPERTIES:
                if (kind, name) not in updates:
                    updates[kind, name] = {}
                    messages.append(_update(kind, name, updates[kind, name]))
                updates[kind, name][field] = self._values[key]
            else:
                messages.append({"type": kind, "name": name, field: self._values[key], "owner": ""})
        return messages


def _update(kind: str, name: str, values: Message) -> Message:
    if kind == CONTROL_PROPERTIES:
        return {"type": kind, "uuid": name, "updates": values}
    return {"type": kind, "name": name, "updates": values, "owner": ""}


def _is_same(one: Any, other: Any) -> bool:
    if isinstance(other, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(other, tuple) and other and isinstance(other[0], np.ndarray):
        return all(map(np.array_equal, one, other))
    return one == other
