"""`walk serve` as a process: what it says of a port or a setting that it cannot use, and how it stops."""

import os
import signal
import subprocess

import pytest
from conftest import PATIENCE, WALK, start_server
from websockets.sync.client import connect

from app.http.connections import listening_socket


def test_port_that_is_taken_is_one_line_and_exit_code_1():
    with listening_socket("127.0.0.1", 0) as other:
        port = str(other.getsockname()[1])
        outcome = subprocess.run([WALK, "serve", "--port", port], capture_output=True, text=True, timeout=PATIENCE)
    assert outcome.returncode == 1 and outcome.stdout == ""
    assert len(outcome.stderr.splitlines()) == 1 and port in outcome.stderr


@pytest.mark.parametrize(("name", "value"), [("ROBOT", "asimo"), ("PORT", "none"), ("PORT", "99999")])
def test_wrong_setting_is_one_line_and_exit_code_2(name, value):
    environment = os.environ | {"PORT": "0", name: value}
    outcome = subprocess.run([WALK, "serve"], capture_output=True, text=True, timeout=PATIENCE, env=environment)
    assert outcome.returncode == 2
    assert len(outcome.stderr.splitlines()) == 1 and value in outcome.stderr


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_server_stops_at_once_though_a_stream_is_open(how):
    server = start_server("--robot", "hrp2")
    with connect(server.socket_url("stream")) as stream:
        stream.recv(PATIENCE)
        server.process.send_signal(how)
        assert server.process.wait(PATIENCE) == (0 if how == signal.SIGINT else -how)
    assert "Traceback" not in "".join(server.output) and "ERROR" not in "".join(server.output)
