"""How viser's clients read a batch of messages: lengths, zstd of msgpack, arrays.

8 bytes   length of the msgpack
8 bytes   length of its compression
N bytes   the compression; an array in it is replaced by its index and its type
then each array as it is in memory, from a multiple of 8 bytes on
"""

import time
from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np
import zstandard
from viser.infra._infra import _append_aligned_buffers

from app.viewer.transport.stream import Message

HEADER = 16  # bytes


class Encoder:
    """Encodes batches, each for any number of clients."""

    def __init__(self) -> None:
        """Prepare what batches have in common."""
        self._msgpack = msgspec.msgpack.Encoder()
        self._zstd = zstandard.ZstdCompressor(level=-1)  # the size of 1, at two thirds of its time

    def encode(self, messages: Sequence[Message]) -> bytes:
        """The bytes of one websocket message."""
        arrays: list[memoryview] = []
        batch = {
            "messages": [_without_arrays(message, arrays) for message in messages],
            "timestampSec": time.perf_counter(),  # the clock of viser's own batches, by which a client paces them
            "binaryBufferLengths": [array.nbytes for array in arrays],
        }
        content = self._msgpack.encode(batch)
        compressed = self._zstd.compress(content)
        parts: list[bytes | memoryview] = [
            len(content).to_bytes(8, "little"),
            len(compressed).to_bytes(8, "little"),
            compressed,
        ]
        _append_aligned_buffers(parts, arrays, HEADER + len(compressed))
        return b"".join(parts)


def _without_arrays(message: Message, arrays: list[memoryview]) -> Message:
    """The message with the arrays of its updates moved out of it."""
    if "updates" not in message:
        return message
    return message | {"updates": {key: _moved(value, arrays) for key, value in message["updates"].items()}}


def _moved(value: Any, arrays: list[memoryview]) -> Any:
    if isinstance(value, tuple):
        return [_moved(item, arrays) for item in value]
    if not isinstance(value, np.ndarray):
        return value
    arrays.append(np.ascontiguousarray(value).data)
    return {"__binary_index": len(arrays) - 1, "dtype": value.dtype.str}
