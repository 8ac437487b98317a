"""Connections of the port: sent without delay, counted, closed where no request comes, and ended without noise.

A connection that sends its request a byte at a time holds a descriptor, and a few hundred of them all that a process
may have. So a request has a deadline from its first moment on, and connections that wait for one are few: where there
are more, the oldest one goes of the address that has the most, so that a newcomer always finds a place.
"""

import asyncio
import resource
import socket
from collections import Counter
from typing import Any
from weakref import WeakKeyDictionary

import h11
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.utils import ClientDisconnected
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import CloseCode

from app.http.guards import refuse

SEND_BUFFER = 32 * 1024  # bytes the system holds for a slow reader: what is in there cannot be overtaken by newer
REQUEST_TIMEOUT = 10.0  # [s] from the first byte of a request, or the connection's beginning, to its last
LEAST_RATE = 100e3  # bytes a second, at which a long body has more time than that
MAX_WAITING = 128  # connections without a request, all addresses together
MAX_OPEN = 768  # connections
MAX_OPEN_BY_ADDRESS = 256  # connections; a proxy's address stands for all that come by it
DESCRIPTORS = 4096  # that are requested of the system
FLUSH_TIMEOUT = 0.3  # [s] a websocket's reader has to take what it was sent when the server stops


def listening_socket(host: str, port: int) -> socket.socket:
    """A socket that listens.

    Raises:
        OSError: if the address is not available.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio sends at once (TCP_NODELAY) only where the socket says that it is TCP; else a response may wait 40 ms.
    listening = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
    try:
        listening.bind((host, port))
    except OSError:
        listening.close()
        raise
    listening.listen()
    return listening


def allow_connections() -> None:
    """Have as many descriptors as the limits here need, if the system permits."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


class Connections:
    """Open connections of one server by their addresses. Belongs to the event loop."""

    def __init__(self) -> None:
        """Start without any."""
        # Weak, as a connection that became a websocket is not heard of again.
        self._open = WeakKeyDictionary[asyncio.Transport, str]()
        self._waiting: dict[asyncio.Transport, str] = {}

    def admit(self, transport: asyncio.Transport, address: str) -> bool:
        """Count a new connection, which waits for a request; False, and it is not counted, if there are too many."""
        if len(self._open) >= MAX_OPEN or self._nb_open(address) >= MAX_OPEN_BY_ADDRESS:
            self._open = _still_open(self._open)
            if len(self._open) >= MAX_OPEN or self._nb_open(address) >= MAX_OPEN_BY_ADDRESS:
                return False
        self._open[transport] = address
        self.wait(transport)
        return True

    def wait(self, transport: asyncio.Transport) -> None:
        """Count a connection as one that waits for a request; where those are too many, one is closed."""
        if transport not in self._open:
            return
        self._waiting[transport] = self._open[transport]
        if len(self._waiting) > MAX_WAITING:
            self._waiting = {waiting: at for waiting, at in self._waiting.items() if not waiting.is_closing()}
        if len(self._waiting) > MAX_WAITING:
            ((greediest, _),) = Counter(self._waiting.values()).most_common(1)
            oldest = next(waiting for waiting, address in self._waiting.items() if address == greediest)
            self.close(oldest)

    def serve(self, transport: asyncio.Transport) -> None:
        """Count a connection, whose request has come, as one that does not wait."""
        self._waiting.pop(transport, None)

    def close(self, transport: asyncio.Transport) -> None:
        """End a connection at once."""
        self._waiting.pop(transport, None)
        self._open.pop(transport, None)
        transport.abort()

    def _nb_open(self, address: str) -> int:
        return sum(at == address for at in self._open.values())


def _still_open(
    connections: "WeakKeyDictionary[asyncio.Transport, str]",
) -> "WeakKeyDictionary[asyncio.Transport, str]":
    found = WeakKeyDictionary[asyncio.Transport, str]()
    found.update({transport: at for transport, at in connections.items() if not transport.is_closing()})
    return found


class LimitedProtocol(H11Protocol):
    """uvicorn's protocol for HTTP, with deadlines and limits."""

    limits: Connections
    """Connections of the server; see `limited_protocol`."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """See uvicorn."""
        super().__init__(*args, **kwargs)
        self._deadline: asyncio.TimerHandle | None = None
        self._began_at, self._nb_received = 0.0, 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Take the connection, or close it if there are too many."""
        super().connection_made(transport)
        if not self.limits.admit(transport, self.client[0] if self.client else ""):
            transport.abort()
            return
        self._begin_to_wait()

    def data_received(self, data: bytes) -> None:
        """Hand data on; a request that begins with them has a deadline."""
        if self._deadline is None and self.conn.their_state is h11.IDLE:
            self._begin_to_wait()
        self._nb_received += len(data)
        super().data_received(data)
        if self.conn.their_state is not h11.IDLE:
            self.limits.serve(self.transport)
        if self.conn.their_state not in (h11.IDLE, h11.SEND_BODY):
            self._end_waiting()

    def on_response_complete(self) -> None:
        """Wait for the next request; uvicorn closes a connection on which none begins."""
        super().on_response_complete()
        if not self.transport.is_closing():
            self.limits.wait(self.transport)

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Hand the connection over to the protocol for websockets."""
        self._end_waiting()
        super().handle_websocket_upgrade(event)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._end_waiting()
        self.limits.close(self.transport)
        super().connection_lost(exc)

    def _begin_to_wait(self) -> None:
        self._began_at, self._nb_received = self.loop.time(), 0
        self._deadline = self.loop.call_later(REQUEST_TIMEOUT, self._check_deadline)

    def _check_deadline(self) -> None:
        """Close the connection, unless a body comes fast enough."""
        deadline = self._began_at + REQUEST_TIMEOUT + self._nb_received / LEAST_RATE
        if self.loop.time() < deadline:
            self._deadline = self.loop.call_at(deadline, self._check_deadline)
        else:
            self.limits.close(self.transport)

    def _end_waiting(self) -> None:
        self.limits.serve(self.transport)
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None


def limited_protocol() -> type[LimitedProtocol]:
    """A protocol class for one server, with its own count of connections."""
    return type("ServerProtocol", (LimitedProtocol,), {"limits": Connections()})


class QuietWebsocket(WebSocketsSansIOProtocol):
    """uvicorn's protocol for websockets, whose end is always a disconnect for the handler that uses it."""

    async def send(self, message: Any) -> None:
        """Send; raises `ClientDisconnected` where the connection was closed from outside the handler.

        That is after a broken frame, where nobody responds to pings, or as the server stops: uvicorn raises
        `RuntimeError` until the connection is gone.
        """
        try:
            await super().send(message)
        except RuntimeError as error:
            if self.transport.is_closing():
                raise ClientDisconnected from error
            raise

    def send_receive_event_to_app(self) -> None:
        """Hand a message on; one of text that is no UTF-8 ends the connection, and uvicorn would log a traceback."""
        if self.curr_msg_data_type == "text" and not _is_text(b"".join(self.frames)):
            self.conn.send_close(CloseCode.INVALID_DATA)
            self.handle_parser_exception()
        else:
            super().send_receive_event_to_app()

    def keepalive_timeout(self) -> None:
        """Give up a connection whose client does not respond, with what it was sent: nobody takes that any more."""
        super().keepalive_timeout()
        self.transport.abort()

    def shutdown(self) -> None:
        """Close the connection as the server stops; a reader that takes nothing is not waited for."""
        super().shutdown()
        self.loop.call_later(FLUSH_TIMEOUT, self.transport.abort)


def _is_text(data: bytes) -> bool:
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True


class EndingMiddleware:
    """Ends what is still under way a while after the server was stopped: uvicorn cancels it, and would log each."""

    def __init__(self, app: ASGIApp) -> None:
        """Run `app`."""
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on; a request that is cancelled before its response has begun is refused with 503."""
        is_begun = False

        async def noted_send(message: Message) -> None:
            nonlocal is_begun
            is_begun = True
            await send(message)

        try:
            await self._app(scope, receive, noted_send)
        except asyncio.CancelledError:
            if scope["type"] == "lifespan":
                raise
            if scope["type"] == "http" and not is_begun:
                await refuse(503, "the server stops", scope, receive, send)
