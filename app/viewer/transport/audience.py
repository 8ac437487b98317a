"""The browsers that look: each is sent what changed since it was last sent something.

A batch is encoded once for all who are in step, so that a frame costs hardly more for
many clients than for one. One whose connection is still full is left out, and catches up
with the latest values when there is room: nothing is queued behind a slow reader.
"""

import socket
from collections.abc import Iterator

import viser
from websockets.asyncio.server import ServerConnection, broadcast

from app.viewer.transport.stream import Stream
from app.viewer.transport.wire import Encoder

SEND_BUFFER = 16 * 1024  # bytes of a connection that are out of our hands: what is in there cannot be overtaken
NOT_YET = -1


class Audience:
    """All of its methods belong to the event loop of viser."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Look after the clients of a server."""
        self._server = server._websock_server
        self._encoder = Encoder()
        self._seen: dict[int, int] = {}

    def __len__(self) -> int:
        """How many are connected."""
        return len(self._server._live_connections)

    def send(self, stream: Stream) -> None:
        """Bring those up to date who have room for it, and end the frame."""
        batches: dict[int, list[ServerConnection]] = {}
        for client, connection in self._ready():
            seen = self._seen.get(client, NOT_YET)
            batches.setdefault(seen + 1, []).append(connection)
            self._seen[client] = stream.frame
        for since, connections in batches.items():
            messages = stream.changes(since)
            if messages:
                broadcast(connections, self._encoder.encode(messages))
        stream.next_frame()

    def _ready(self) -> Iterator[tuple[int, ServerConnection]]:
        """Those who have all that viser sends at the beginning, and nothing of ours on its way."""
        connections = self._server._live_connections
        self._seen = {client: seen for client, seen in self._seen.items() if client in connections}
        buffer = self._server._broadcast_buffer
        for client, connection in connections.items():
            if connection.transport.get_write_buffer_size():
                continue
            if client not in self._seen:
                if buffer.generator_cursors.get(client, NOT_YET) < buffer.message_counter - 1:
                    continue
                end: socket.socket = connection.transport.get_extra_info("socket")
                end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
            yield client, connection
