"""A server that is not healthy for long ends itself; one that is, or is again, goes on."""

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from conftest import PATIENCE, serving, wait_for

from app.http.watchdog import Watchdog


class Health(ThreadingHTTPServer):
    """Answers with the status that a test sets."""

    status = 200
    nb_asked = 0


class Handler(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        assert isinstance(self.server, Health)
        self.server.nb_asked += 1
        self.send_response(self.server.status)
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture
def health() -> Iterator[Health]:
    server = Health(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


def url(server: Health) -> str:
    return f"http://127.0.0.1:{server.server_port}/"


def test_a_server_that_stays_unhealthy_is_ended(health):
    ended = threading.Event()
    watchdog = Watchdog(url(health), patience=0.2, end=ended.set)
    watchdog.start()
    wait_for(lambda: health.nb_asked > 20)
    assert not ended.is_set()
    health.status = 503
    assert ended.wait(PATIENCE)


def test_a_server_that_does_not_answer_is_ended(health):
    ended = threading.Event()
    address = url(health)
    health.shutdown()
    health.server_close()
    Watchdog(address, patience=0.2, end=ended.set).start()
    assert ended.wait(PATIENCE)


def test_nothing_is_ended_after_a_stop(health):
    ended = threading.Event()
    watchdog = Watchdog(url(health), patience=0.2, end=ended.set)
    watchdog.start()
    wait_for(lambda: health.nb_asked > 0)
    watchdog.stop()
    wait_for(lambda: all(thread.name != "watchdog" for thread in threading.enumerate()))
    assert not ended.is_set()


def test_a_healthy_server_goes_on_with_a_watchdog():
    with serving("--robot", "hrp2", "--scene", "light", EXIT_UNHEALTHY_AFTER="30") as server:
        with server.client() as client:
            assert client.get("health").status_code == 200
