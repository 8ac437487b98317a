"""Broadcaster of the scene's changes: each browser is sent what changed since it was last sent something.

A batch of messages is encoded once for all clients that have seen the same, so that a frame costs hardly more for many
clients than for one. A client whose connection is still full is left out, and catches up with the latest values when
there is room: nothing is queued behind a slow reader.

The bytes of a batch, as viser's clients read them:

    8 bytes   length of the msgpack
    8 bytes   length of its compression
    N bytes   zstd of the msgpack; an array in it is replaced by its index and its type
    then each array as it is in memory, from a multiple of 8 bytes on
"""

import socket
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import msgspec
import numpy as np
import viser
import zstandard
from websockets.asyncio.server import ServerConnection, broadcast

from app.viewer.transport.scene_updates import Message, SceneUpdates
from app.viewer.transport.viser_private import connections, has_whole_scene

SEND_BUFFER = 16 * 1024  # bytes of a connection that the system holds: newer values cannot overtake them
NOTHING_SENT = -1
NOBODY: Mapping[int, SceneUpdates] = MappingProxyType({})
ALIGNMENT = 8  # bytes


class Broadcaster:
    """Sender of scene updates to all clients. All methods belong to viser's event loop."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Serve the clients of a viser server."""
        self._server = server
        self._encoder = Encoder()
        self.last_sent: dict[int, int] = {}
        """Number of the latest frame that each client was sent, by its id."""
        self._sources: dict[int, SceneUpdates] = {}
        """Updates that each client was sent last, by its id."""
        self._own: dict[int, tuple[SceneUpdates, int]] = {}
        """Updates of its own that each client was sent last, and the number of their frame, by its id."""

    @property
    def nb_clients(self) -> int:
        """Number of clients that are connected."""
        return len(connections(self._server))

    @property
    def clients(self) -> Collection[int]:
        """Ids of the clients that are connected."""
        return connections(self._server)

    def send(
        self,
        updates: SceneUpdates,
        others: Mapping[int, SceneUpdates] = NOBODY,
        own: Callable[[int], SceneUpdates] | None = None,
    ) -> None:
        """Bring every client with room for it up to date, and end the frame.

        Args:
            updates: of the scene that all share.
            others: of the scenes of clients that are shown something else, by their ids.
            own: gives what only one client is sent, or those of one page, by its id: it comes after the others.
        """
        late: dict[int, tuple[SceneUpdates, int]] = {}
        batches: dict[tuple[int, int], tuple[SceneUpdates, list[ServerConnection]]] = {}
        for client, connection in self._ready():
            source = others.get(client, updates)
            is_same = self._sources.get(client) is source
            since = self.last_sent.get(client, NOTHING_SENT) + 1 if is_same else 0
            batches.setdefault((id(source), since), (source, []))[1].append(connection)
            self._sources[client], self.last_sent[client] = source, source.frame
            if own is not None:
                mine = own(client)
                before, frame = self._own.get(client, (None, NOTHING_SENT))
                late[client] = mine, frame + 1 if is_same and before is mine else 0
                self._own[client] = mine, mine.frame
        for (_, since), (source, receivers) in batches.items():
            messages = source.changes(since)
            if messages:
                broadcast(receivers, self._encoder.encode(messages))
        present = connections(self._server)
        for client, (mine, since) in late.items():
            if messages := mine.changes(since):
                broadcast([present[client]], self._encoder.encode(messages))
        sources = (updates, *others.values(), *(mine for mine, _ in late.values()))
        for source in {id(each): each for each in sources}.values():
            source.next_frame()

    def _ready(self) -> Iterator[tuple[int, ServerConnection]]:
        """Clients that have received all that viser sends at the start, and whose connection is empty."""
        present = connections(self._server)
        self.last_sent = {client: frame for client, frame in self.last_sent.items() if client in present}
        self._sources = {client: source for client, source in self._sources.items() if client in present}
        self._own = {client: sent for client, sent in self._own.items() if client in present}
        for client, connection in present.items():
            if connection.transport.is_closing() or connection.transport.get_write_buffer_size():
                continue
            if client not in self.last_sent:
                if not has_whole_scene(self._server, client):
                    continue
                end: socket.socket = connection.transport.get_extra_info("socket")
                end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
            yield client, connection


class Encoder:
    """Encoder of batches, each for any number of clients."""

    def __init__(self) -> None:
        """Prepare what batches have in common."""
        self._msgpack = msgspec.msgpack.Encoder()
        self._zstd = zstandard.ZstdCompressor(level=-1)  # the size of level 1, at two thirds of its time

    def encode(self, messages: Sequence[Message]) -> bytes:
        """Bytes of one websocket message."""
        arrays: list[memoryview] = []
        batch = {
            "messages": [_without_arrays(message, arrays) for message in messages],
            "timestampSec": time.perf_counter(),  # the clock of viser's own batches, by which a client paces them
            "binaryBufferLengths": [array.nbytes for array in arrays],
        }
        content = self._msgpack.encode(batch)
        compressed = self._zstd.compress(content)
        encoded = bytearray(len(content).to_bytes(8, "little") + len(compressed).to_bytes(8, "little") + compressed)
        for array in arrays:
            encoded += bytes(-len(encoded) % ALIGNMENT)
            encoded += array
        return bytes(encoded)


def _without_arrays(message: Message, arrays: list[memoryview]) -> Message:
    """Message with the arrays of its updates moved out of it."""
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
