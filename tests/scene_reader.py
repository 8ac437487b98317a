"""Readers of what the viewer sends: batches of bytes as a browser decodes them, and the latest value of each node."""

from typing import Any

import msgspec
import numpy as np
import zstandard

from app.viewer.transport.scene_updates import SceneUpdates

HEADER = 16  # bytes


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
