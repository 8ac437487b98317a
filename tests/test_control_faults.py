"""Faults of the control process and hostile changes, as the users of the API meet them."""

import json
import os
import signal
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest
from conftest import PATIENCE, live, send_text, wait_for
from websockets.sync.client import connect


def test_a_killed_control_process_is_told_refuses_and_comes_back_while_sockets_go_on(api, server):
    api.put("live/reference", json={"vx": 0.2}).raise_for_status()
    wait_for(lambda: live(api)["com_x"] > 0.05)
    process, before = api.get("health").json()["control_process"], live(api)
    with (
        connect(server.socket_url("stream?rate=60")) as stream,
        connect(server.socket_url("teleop?client=me")) as teleop,
    ):
        os.kill(process, signal.SIGKILL)
        wait_for(lambda: api.get("health").status_code == 503)
        assert api.get("health").json()["status"] == "unhealthy"
        assert live(api)["fault"] and live(api)["running"] is False
        for method, path, body in COMMANDS:
            answer = api.request(method, path, json=body)
            assert answer.status_code == 503 and set(answer.json()) == {"detail", "errors"}, path
        teleop.send(json.dumps({"reference": {"vx": 0.1}}))
        assert "control process" in json.loads(teleop.recv(timeout=PATIENCE))["error"]
        assert httpx.get(f"{server.url}metrics").status_code == 200
        wait_for(lambda: api.get("health").status_code == 200)
        assert api.get("health").json()["control_process"] != process
        after = live(api)
        assert after["tick"] >= before["tick"] and after["fault"] == "" and after["running"] is True
        wait_for(lambda: json.loads(stream.recv(timeout=PATIENCE))["tick"] > after["tick"] + 20)
        assert live(api)["reference_vx"] == 0.2
        teleop.send(json.dumps({"reference": {"vx": 0.1}, "driver": "joystick"}))
        wait_for(lambda: live(api)["driver_client"] == "me")


COMMANDS = [
    ("PUT", "live/reference", {"vx": 0.1}),
    ("POST", "live/push", {"impulse": [0.0, 1.0]}),
    ("POST", "live/pause", None),
    ("POST", "live/reset", None),
    ("PATCH", "live/parameters", {"alpha": 1e-5}),
    ("POST", "live/preview", {"impulse": [0.0, 1.0]}),
    ("POST", "live/save", None),
]


def test_no_request_waits_for_a_control_process_that_was_stopped(api):
    process = api.get("health").json()["control_process"]
    os.kill(process, signal.SIGSTOP)
    with ThreadPoolExecutor() as threads:
        requests = [threads.submit(api.request, method, path, json=body) for method, path, body in COMMANDS]
        assert {request.result(PATIENCE).status_code for request in requests} <= {200, 503}
    wait_for(lambda: api.get("health").json().get("control_process") not in (None, process))
    wait_for(lambda: api.get("health").status_code == 200)


def deep(depth: int) -> str:
    return "[" * depth + "]" * depth


@pytest.mark.parametrize(
    "body",
    [
        '{"solver": []}',
        '{"solver": {}}',
        '{"a": "' + "x" * 60_000 + '"}',
        '{"' + "k" * 60_000 + '": 1}',
        '{"\\ud800": 1}',
        '{"scheme": "\\udfff"}',
        '{"alpha": ' + deep(100) + "}",
        '{"alpha": ' + deep(990) + "}",
        '{"k": ' + deep(990) + "}",
        '{"alpha": ' + deep(30_000) + "}",
        '{"horizon_samples": 1' + "0" * 4000 + "}",
        '{"horizon_samples": 1' + "0" * 60_000 + "}",
        '{"alpha": NaN}',
        '{"alpha": -Infinity}',
        '{"alpha": 1e999}',
        '{"com_height": "x"}',
        "[]",
        "null",
        '"x"',
        "",
        "{",
    ],
)
def test_a_change_of_any_json_is_refused_with_its_field_and_changes_nothing(api, body):
    before = api.get("live/parameters").json()
    answer = send_text(api, "PATCH", "live/parameters", body)
    assert answer.status_code == 422, answer.text[:300]
    error = answer.json()["errors"][0]
    assert set(error) == {"field", "value", "limit"} and error["limit"] and len(answer.text) < 5000
    assert api.get("live/parameters").json() == before
    assert api.get("health").status_code == 200
