"""What the scene shows now: the latest value of everything that moves, and when each last changed.

viser keeps every message for the clients to come, numbers it, and encodes it anew for each
client. At thirty frames a second that costs more than the drawing, and a client that joins
after hours of it stalls the others. So viser gets what is made once, and what changes goes
by another way: nothing is kept but the latest values, and a client is sent those that
changed since it was last sent any (`app.viewer.transport.audience`). One that is too slow, or new, gets more of them.

A client applies a pose at once, but builds a node anew for a property, which a slow one
shows late. So whatever moves is moved by its pose, and its shape is given where it moves.
"""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

Message = dict[str, Any]
"""As viser's clients read it: `type` is the name of a class in `viser._messages`."""

DIGITS = 5  # decimals of poses: a hundredth of a millimetre; what moves less is not sent


class Stream:
    """The latest values, numbered by the frame that changed them."""

    def __init__(self) -> None:
        """Begin with nothing to tell."""
        self.frame = 0
        """Of the values being collected; `next_frame` ends it."""
        self._values: dict[tuple[str, str, str], Any] = {}
        self._changed: dict[tuple[str, str, str], int] = {}
        self._fresh: dict[tuple[str, str, str], None] = {}

    def position(self, name: str, position: Iterable[float]) -> None:
        """Where a node is in its parent's frame [m], shape (3,)."""
        x, y, z = position
        value = (round(float(x), DIGITS), round(float(y), DIGITS), round(float(z), DIGITS))
        self._set(("SetPositionMessage", name, "position"), value)

    def orientation(self, name: str, wxyz: Iterable[float]) -> None:
        """How a node is turned in its parent's frame."""
        w, x, y, z = wxyz
        value = (round(w, DIGITS), round(x, DIGITS), round(y, DIGITS), round(z, DIGITS))
        self._set(("SetOrientationMessage", name, "wxyz"), value)

    def on_ground(self, name: str, position: Iterable[float], yaw: float | None = None, height: float = 0.0) -> None:
        """Where a node stands on the ground [m], shape (2,), and its yaw [rad] if it ever turns."""
        x, y = position
        self.position(name, (x, y, height))
        if yaw is not None:
            self.orientation(name, (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))

    def visible(self, name: str, is_visible: bool) -> None:
        """Whether a node and its children are drawn."""
        self._set(("SetSceneNodeVisibilityMessage", name, "visible"), is_visible)

    def properties(self, name: str, **values: Any) -> None:
        """Properties of a node by their names in viser; arrays in the types that viser sends."""
        for key, value in values.items():
            self._set(("SceneNodeUpdateMessage", name, key), value)

    def control(self, uuid: str, **values: Any) -> None:
        """Properties of a control of the panel."""
        for key, value in values.items():
            self._set(("GuiUpdateMessage", uuid, key), value)

    def _set(self, key: tuple[str, str, str], value: Any) -> None:
        if key in self._values and _is_same(self._values[key], value):
            return
        self._values[key] = value
        self._changed[key] = self.frame
        self._fresh[key] = None

    def next_frame(self) -> None:
        """End the frame: what is set from now on belongs to the next one."""
        self.frame += 1
        self._fresh = {}

    def changes(self, since: int) -> list[Message]:
        """Messages that bring a client up to date that has seen all frames before `since`."""
        fresh = self._fresh if since == self.frame else [key for key, at in self._changed.items() if at >= since]
        messages: list[Message] = []
        updates: dict[tuple[str, str], Message] = {}
        for key in fresh:
            kind, name, what = key
            if kind == "SceneNodeUpdateMessage" or kind == "GuiUpdateMessage":
                if (kind, name) not in updates:
                    updates[kind, name] = {}
                    messages.append(_update(kind, name, updates[kind, name]))
                updates[kind, name][what] = self._values[key]
            else:
                messages.append({"type": kind, "name": name, what: self._values[key], "owner": ""})
        return messages


def _update(kind: str, name: str, values: Message) -> Message:
    if kind == "GuiUpdateMessage":
        return {"type": kind, "uuid": name, "updates": values}
    return {"type": kind, "name": name, "updates": values, "owner": ""}


def _is_same(one: Any, other: Any) -> bool:
    if isinstance(other, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(other, tuple) and other and isinstance(other[0], np.ndarray):
        return all(map(np.array_equal, one, other))
    return one == other
