"""Readers of what the viewer sends: a client of its websocket, batches as a browser decodes them, latest values."""

import time
from collections.abc import Iterable
from typing import Any

import msgspec
import numpy as np
import viser
import zstandard
from conftest import PATIENCE
from websockets.sync.client import connect

from app.viewer.transport.scene_updates import SceneUpdates

HEADER = 16  # bytes
PROTOCOL: Any = f"viser-v{viser.__version__}"
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [-2.4, 1.7, 1],
    "fov": 0.7,
    "near": 0.01,
    "far": 1000,
    "image_height": 800,
    "image_width": 1280,
    "look_at": [0, 0, 0.8],
    "up_direction": [0.0, 0.0, 1.0],
}


def decoded(batch: bytes) -> list[dict[str, Any]]:
    """Messages of a batch, with their arrays."""
    size = int.from_bytes(batch[8:HEADER], "little")
    content = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(batch[HEADER : HEADER + size]))
    arrays, at = [], HEADER + size
    for length in content["binaryBufferLengths"]:
        at += -at % 8
        arrays.append(batch[at : at + length])
        at += length
    assert at == len(batch)

    def restored(value: Any) -> Any:
        if isinstance(value, dict) and "__binary_index" in value:
            return np.frombuffer(arrays[value["__binary_index"]], np.dtype(value["dtype"]))
        if isinstance(value, dict):
            return {key: restored(item) for key, item in value.items()}
        return [restored(item) for item in value] if isinstance(value, list) else value

    return [restored(message) for message in content["messages"]]


def latest(updates: SceneUpdates, field: str) -> dict[str, Any]:
    """Latest value of a pose, of the visibility or of a property, by the names of the nodes that were given any."""
    messages = (message | message.get("updates", {}) for message in updates.changes(0) if "name" in message)
    return {message["name"]: message[field] for message in messages if field in message}


class SceneSocket:
    """Client of a scene's websocket, as a browser is one."""

    def __init__(self, address: str, **options: Any) -> None:
        self._socket = connect(address, subprotocols=[PROTOCOL], compression=None, max_size=None, **options)

    def __enter__(self) -> "SceneSocket":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def send(self, message: Any) -> None:
        self._socket.send(message if isinstance(message, str | bytes) else msgspec.msgpack.encode(message))

    def read(self, timeout: float = PATIENCE) -> list[dict[str, Any]]:
        """Messages of the next batch."""
        batch: Any = self._socket.recv(timeout)
        return decoded(batch)

    def beginning(self) -> list[dict[str, Any]]:
        """Messages by which the scene is made, once viser counts this as a client."""
        self.send(CAMERA)
        messages: list[dict[str, Any]] = []
        while not any(message["type"] == "ReplayDoneMessage" for message in messages):
            messages += self.read()
        return messages

    def first(self, kind: str) -> dict[str, Any]:
        """The first message of a kind from now on."""
        give_up = time.monotonic() + PATIENCE
        while time.monotonic() < give_up:
            for message in self.read():
                if message["type"] == kind:
                    return message
        raise AssertionError(f"no {kind} came")


def controls(messages: Iterable[dict[str, Any]]) -> dict[str, str]:
    """Ids of the panel's controls, by their labels."""
    return {message["props"]["label"]: message["uuid"] for message in messages if "label" in message.get("props", {})}
