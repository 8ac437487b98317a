"""Connections of the port: sent without delay, none without a request keeps others out, and all end without noise."""

import asyncio
import base64
import logging
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import httpx
import pytest
import uvicorn
from conftest import PATIENCE, wait_for
from websockets.sync.client import connect

from app.http import connections
from app.http.connections import Connections, EndingMiddleware, QuietWebsocket, limited_protocol, listening_socket

FOR_EVER = "/for-ever"
LATE = "/late"
STARTED: list[str] = []
"""Kind of each connection to a path `FOR_EVER` since a test began."""
ENDED: list[BaseException] = []
"""Errors that ended their handlers."""


async def application(scope: Any, receive: Any, send: Any) -> None:
    """Responds to a request once its body is there, and to each message of a websocket; or sends for ever."""
    if scope.get("path") in (FOR_EVER, LATE):
        STARTED.append(scope["type"])
        try:
            await _send_for_ever(scope, receive, send)
        except BaseException as error:
            ENDED.append(error)
            raise
    elif scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.accept"})
        while (message := await receive())["type"] == "websocket.receive":
            await send({"type": "websocket.send", "text": message["text"]})
    elif scope["type"] == "http":
        while (await receive()).get("more_body"):
            pass
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"2")]})
        await send({"type": "http.response.body", "body": b"ok"})


async def _send_for_ever(scope: Any, receive: Any, send: Any) -> None:
    await receive()
    if scope["type"] == "http":
        await asyncio.Event().wait()
    await send({"type": "websocket.accept"})
    if scope["path"] == LATE:
        await receive()
    while True:
        await send({"type": "websocket.send", "bytes": bytes(4096)})
        await asyncio.sleep(0.001)


@pytest.fixture
def address(monkeypatch) -> Iterator[tuple[str, int]]:
    """Address of a server with small limits."""
    for name, value in {"REQUEST_TIMEOUT": 1.0, "MAX_WAITING": 8, "MAX_OPEN": 24, "MAX_OPEN_BY_ADDRESS": 16}.items():
        monkeypatch.setattr(connections, name, value)
    listening = listening_socket("127.0.0.1", 0)
    with running(listening):
        yield listening.getsockname()


@contextmanager
def running(listening: socket.socket) -> Iterator[None]:
    """A server, which is stopped at the end, with short times and with its log in pytest's."""
    config = uvicorn.Config(
        EndingMiddleware(application),
        http=limited_protocol(),
        ws=QuietWebsocket,
        ws_ping_interval=0.3,
        ws_ping_timeout=0.3,
        timeout_graceful_shutdown=1,
        log_config=None,
    )
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
    thread.start()
    wait_for(lambda: server.started)
    try:
        yield
    finally:
        server.should_exit = True
        thread.join(PATIENCE)


def url(address: tuple[str, int]) -> str:
    return f"http://{address[0]}:{address[1]}/"


def is_closed(end: socket.socket) -> bool:
    """Whether the other side closes the connection, which is waited for."""
    end.settimeout(PATIENCE)
    try:
        return end.recv(1) == b""
    except ConnectionResetError:
        return True


def test_more_connections_without_a_request_than_there_are_places_keep_nobody_out(address):
    slow = [socket.create_connection(address) for _ in range(40)]
    for end in slow:
        with suppress(OSError):  # it may be closed already
            end.sendall(b"GET / HTTP/1.1\r\nHost: a\r\nX: ")
    assert httpx.get(url(address), timeout=PATIENCE).text == "ok"
    assert sum(is_closed(end) for end in slow) == len(slow)
    for end in slow:
        end.close()


@pytest.mark.parametrize(
    "beginning",
    [b"", b"G", b"GET / HTTP/1.1\r\nHost: a\r\n", b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 10\r\n\r\n12345"],
)
def test_a_request_that_does_not_end_is_given_up(address, beginning):
    with socket.create_connection(address) as end:
        end.sendall(beginning)
        assert is_closed(end)


def test_a_second_request_on_a_connection_has_a_deadline_too(address):
    with socket.create_connection(address) as end:
        end.sendall(b"GET / HTTP/1.1\r\nHost: a\r\n\r\n")
        received = b""
        while not received.endswith(b"ok"):
            received += end.recv(1000)
        end.sendall(b"GET / HT")
        assert is_closed(end)


def test_a_websocket_has_no_deadline(address):
    with connect(url(address).replace("http", "ws")) as end:
        with socket.create_connection(address) as other:
            assert is_closed(other)  # after the time that a request may take
        end.send("still here")
        assert end.recv(timeout=PATIENCE) == "still here"


def test_an_address_has_so_many_connections_and_no_more(address):
    sockets = [connect(url(address).replace("http", "ws")) for _ in range(16)]
    with socket.create_connection(address) as one_more:
        assert is_closed(one_more)
    for end in sockets:
        end.close()
    wait_for(lambda: _responds(address))


def _responds(address: tuple[str, int]) -> bool:
    try:
        return httpx.get(url(address), timeout=PATIENCE).text == "ok"
    except httpx.TransportError:
        return False


class End:
    """Stand-in for a transport."""

    def __init__(self) -> None:
        self.is_open = True

    def abort(self) -> None:
        self.is_open = False

    def is_closing(self) -> bool:
        return not self.is_open


def test_the_address_with_the_most_waiting_connections_loses_its_oldest(monkeypatch):
    monkeypatch.setattr(connections, "MAX_WAITING", 5)
    open_now, guest, greedy = Connections(), End(), [End() for _ in range(10)]
    assert open_now.admit(guest, "10.0.0.1")  # type: ignore[arg-type]
    for end in greedy:
        assert open_now.admit(end, "10.0.0.2")  # type: ignore[arg-type]
    assert guest.is_open and [end.is_open for end in greedy] == 6 * [False] + 4 * [True]


def test_what_is_sent_is_not_held_back_for_more():
    async def accepted() -> int:
        loop = asyncio.get_running_loop()
        delay: asyncio.Future[int] = loop.create_future()

        class Protocol(asyncio.Protocol):
            def connection_made(self, transport: Any) -> None:
                end = transport.get_extra_info("socket")
                delay.set_result(end.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))

        with listening_socket("127.0.0.1", 0) as listening, socket.socket() as client:
            server = await loop.create_server(Protocol, sock=listening)
            client.connect(listening.getsockname())
            found = await delay
            server.close()
            return found

    assert asyncio.run(accepted()) == 1


def upgraded(address: tuple[str, int], path: str = FOR_EVER) -> socket.socket:
    """A websocket that takes nothing and responds to nothing."""
    end = socket.socket()
    end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    end.connect(address)
    key = base64.b64encode(bytes(16)).decode()
    headers = f"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}"
    end.sendall(f"GET {path} HTTP/1.1\r\nHost: a\r\n{headers}\r\n\r\n".encode())
    assert end.recv(12) == b"HTTP/1.1 101"
    return end


def tracebacks(caplog: pytest.LogCaptureFixture) -> list[logging.LogRecord]:
    return [record for record in caplog.records if record.exc_info]


NO_FRAME = b"\xff\x80\x00\x00\x00\x00"
NO_TEXT = b"\x81\x81\x00\x00\x00\x00\xff"


@pytest.mark.parametrize(
    ("path", "frame"), [(FOR_EVER, b""), (FOR_EVER, NO_FRAME), (FOR_EVER, NO_TEXT), (LATE, NO_FRAME), (LATE, NO_TEXT)]
)
def test_a_websocket_that_is_broken_or_takes_nothing_is_a_disconnect_for_its_handler(address, caplog, path, frame):
    """None of them leaves a handler that waits, or a traceback in the log."""
    STARTED.clear(), ENDED.clear()
    with upgraded(address, path) as end:
        end.sendall(frame)
        wait_for(lambda: bool(ENDED))
    assert isinstance(ENDED[0], OSError)
    assert not tracebacks(caplog)


def test_what_is_under_way_when_the_server_stops_ends_without_a_traceback(caplog):
    STARTED.clear(), ENDED.clear()
    listening = listening_socket("127.0.0.1", 0)
    address = listening.getsockname()
    with socket.create_connection(address) as request:
        with running(listening):
            end = upgraded(address)
            request.sendall(f"GET {FOR_EVER} HTTP/1.1\r\nHost: a\r\n\r\n".encode())
            wait_for(lambda: len(STARTED) == 2)
        assert request.recv(1000).startswith(b"HTTP/1.1 503")
    end.close()
    assert len(ENDED) == 2 and not tracebacks(caplog)


def test_a_long_body_has_time_as_long_as_it_comes(address):
    """6 MB at the beginning earn a minute."""
    with socket.create_connection(address) as end:
        end.sendall(b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 6000001\r\n\r\n" + bytes(6_000_000))
        time.sleep(2 * connections.REQUEST_TIMEOUT)
        end.sendall(b"x")
        end.settimeout(PATIENCE)
        assert end.recv(100).startswith(b"HTTP/1.1 200")
