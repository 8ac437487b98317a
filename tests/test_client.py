"""Programs that follow the robot and drive it over websockets, the examples of the documentation among them."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import httpx
import msgpack
import pytest
from conftest import PATIENCE, live, refuse_constant, wait_for
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from app.routes.sockets import BURST, MAX_RATE

FOREIGN = "http://elsewhere.example"
DOCS = Path(__file__).parent.parent / "docs"


def run_python(*words: object, **environment: str) -> str:
    outcome = subprocess.run(
        [sys.executable, *map(str, words)],
        capture_output=True,
        text=True,
        timeout=2 * PATIENCE,
        env=os.environ | {"MPLBACKEND": "Agg"} | environment,
    )
    assert outcome.returncode == 0, outcome.stderr
    return outcome.stdout


def test_the_client_of_the_documentation_follows_the_robot(server):
    lines = run_python(DOCS / "client.py", server.url, 1.0).splitlines()
    times = [float(line.split()[1]) for line in lines]
    assert len(times) >= 2 and times == sorted(times) and times[-1] > times[0]


@pytest.mark.exhaustive
def test_the_notebook_runs(server, tmp_path):
    cells = json.loads((DOCS / "client.ipynb").read_text(encoding="utf-8"))["cells"]
    assert all(cell["outputs"] for cell in cells if cell["cell_type"] == "code"), "make notebook"
    script = tmp_path / "notebook.py"
    script.write_text("\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"))
    run_python(script, WALK_SERVER=server.url)


def test_messagepack_says_the_same_as_json(server, api):
    api.post("live/pause").raise_for_status()
    with (
        connect(server.socket_url("stream?format=msgpack")) as packed,
        connect(server.socket_url("stream")) as text,
    ):
        one, other = msgpack.unpackb(packed.recv(PATIENCE)), json.loads(text.recv(PATIENCE))
    assert one["tick"] == other["tick"] and one["q"] == other["q"] and one["plan"] == other["plan"]


def until_it_drives(joystick: ClientConnection, api: httpx.Client, reference: str) -> dict:
    """The first state in which a stick drives; it repeats its reference, which lasts for less than a busy machine may
    take to show it."""
    seen = [live(api)]

    def drives() -> bool:
        joystick.send(reference)
        seen.append(live(api))
        return seen[-1]["driver"] == "joystick"

    wait_for(drives)
    return seen[-1]


def test_joystick_is_clamped_and_counts_as_let_go_when_it_falls_silent(api, server):
    limits = api.get("live/robot").json()["limits"]
    with connect(server.socket_url("teleop")) as joystick:
        state = until_it_drives(joystick, api, '{"reference": {"vx": 1e9, "vy": -1e9}}')
        assert (state["reference_vx"], state["reference_vy"]) == (limits["vx"][1], limits["vy"][0])
        wait_for(lambda: live(api)["driver"] == "none")
    state = live(api)
    assert (state["reference_vx"], state["reference_vy"]) == (0.0, 0.0)


def test_the_last_one_touched_drives(api, server):
    with connect(server.socket_url("teleop")) as joystick:
        until_it_drives(joystick, api, '{"reference": {"vx": 0.1}}')
        api.put("live/reference", json={"vx": 0.05})
        wait_for(lambda: live(api)["driver"] == "rest")
    time.sleep(0.6)  # longer than a joystick lasts
    assert live(api)["reference_vx"] == 0.05


def test_joystick_push_is_clamped_to_the_strongest_there_is(api, server):
    api.post("live/pause")
    with connect(server.socket_url("teleop")) as joystick:
        joystick.send('{"push": {"impulse": [300.0, -400.0]}}')
        joystick.send("{}x")
        joystick.recv(PATIENCE)  # the refusal of what came after: the push has arrived
        state = api.post("live/step").json()
    assert (state["push_x"], state["push_y"]) == pytest.approx((36.0, -48.0))


@pytest.mark.parametrize(
    "message",
    [
        "nonsense",
        '{"reference": {"vx": NaN}}',
        '{"reference": {"vx": "0.1"}}',
        '{"refrence": {"vx": 0.1}}',
        '{"reference": {"vx": 0.1}, "push": {"impulse": [1, 1], "duration": 1e9}}',
        '{"push": {"impulse": [0, 1e999]}}',
        " " * 5000 + '{"reference": {"vx": 0.1}}',
        b'{"reference": {"vx": 0.1}}',
    ],
)
def test_bad_joystick_message_is_refused_and_changes_nothing(api, server, message):
    with connect(server.socket_url("teleop")) as joystick:
        joystick.send(message)
        assert set(json.loads(joystick.recv(PATIENCE))) == {"error"}
        assert live(api)["driver"] == "none"
        until_it_drives(joystick, api, '{"reference": {"vx": 0.1}}')


def test_more_messages_than_a_program_sends_have_to_wait(server):
    with connect(server.socket_url("teleop")) as joystick:
        begun = time.monotonic()
        for _ in range(500):
            joystick.send("{")
        for _ in range(500):
            joystick.recv(PATIENCE)
        assert time.monotonic() - begun > (500 - BURST) / MAX_RATE - 0.1


def test_message_that_is_far_too_long_ends_the_connection(server):
    with connect(server.socket_url("teleop")) as joystick:
        joystick.send("x" * 1_000_000)
        with pytest.raises(ConnectionClosed):
            joystick.recv(PATIENCE)


def test_stream_sends_the_keys_of_the_snapshot_route(api, server):
    with connect(server.socket_url("stream?rate=30")) as stream:
        received = (json.loads(stream.recv(PATIENCE), parse_constant=refuse_constant) for _ in range(1000))
        first = next(received)
        assert set(first) == set(live(api))
        assert any(later["tick"] > first["tick"] for later in received)
        assert api.get("health").json()["clients"] == 1
    wait_for(lambda: api.get("health").json()["clients"] == 0)


@pytest.mark.parametrize(
    "query", [*(f"rate={rate}" for rate in ("0", "-1", "1000", "nan", "inf", "fast")), "format=xml"]
)
def test_stream_refuses_impossible_rates_and_unknown_formats(server, query):
    with pytest.raises(InvalidStatus, match="403"), connect(server.socket_url(f"stream?{query}")):
        pass


@pytest.mark.parametrize("path", ["api/v1/live/teleop", "api/v1/live/stream", "viewer"])
def test_page_of_another_origin_gets_no_websocket(server, path):
    address = f"ws://{server.host}/{path}"
    with pytest.raises(InvalidStatus) as refusal, connect(address, origin=FOREIGN):
        pass
    assert refusal.value.response.status_code == 403
