"""A server among hostile clients and faults: what must hold of it whatever happens, in whatever order.

Hypothesis chooses what happens: requests that are good and bad, sockets that talk nonsense or are cut, a control
process that is killed or stopped, a disk that is full. After each of them the server responds within a bounded time and
never by 500, its health tells the truth, no run is lost, and once the faults are over the robot goes on.
"""

import json
import os
import signal
import socket
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest
from conftest import PATIENCE, Server, serving, wait_for
from disks import fill, small_disk
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

BOUND = PATIENCE  # [s] in which every request is responded to: the slowest one has a live walk written
SHORT = {"name": "short", "robot": "hrp2", "duration": 2.0, "parameters": {"control_period": 0.1}}
FORESEEN = {200, 201, 202, 204, 404, 409, 413, 422, 429, 503}

PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(st.characters(), max_size=20)
    | st.sampled_from(["piqp", "daqp", "full", "\ud800", 10**400])
    | st.integers(0, 250_000).map(lambda length: "x" * length),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
PARAMETERS = st.dictionaries(
    st.sampled_from(["solver", "scheme", "alpha", "horizon_samples", "cop_margin", "step_duration", "com_height", "a"]),
    PLAIN,
    max_size=2,
)
MESSAGES = (
    st.text(max_size=40)
    | st.binary(max_size=40)
    | PLAIN.map(json.dumps)
    | st.fixed_dictionaries({"reference": PLAIN, "engagement": PLAIN}).map(json.dumps)
    | st.integers(0, 70_000).map(lambda length: "x" * length)
    | st.just('{"reference": {"vx": 0.2}}')
    | st.just('{"push": {"impulse": [0, 2]}}')
)
SCENARIOS = st.just(SHORT) | st.fixed_dictionaries({"robot": st.just("hrp2"), "duration": PLAIN, "events": PLAIN})
BYTES = st.binary(max_size=200) | st.sampled_from(
    [
        b"GET / HTTP/1.1\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"\x16\x03\x01" + bytes(50),
        b"PUT /api/v1/live/reference HTTP/1.1\r\n",
    ]
)


class Faults(RuleBasedStateMachine):
    """One server, what was sent to it, and what it must still know.

    What may happen next depends on what was chosen before and never on the server's answers: Hypothesis repeats them.
    """

    server: Server
    disk: Path | None
    """A small file system that holds the data folder; None where the tests may not mount one."""

    @initialize()
    def begin(self) -> None:
        self.api = httpx.Client(base_url=f"{self.server.url}api/v1/", timeout=BOUND)
        self.known: list[str] = []
        self.removed: set[str] = set()
        self.is_paused = self.is_stopped = False
        self.filling: Path | None = None
        self.sockets: list[ClientConnection] = []
        self.request("POST", "live/reset")
        self.request("POST", "live/resume")

    def request(self, method: str, path: str, **options: Any) -> httpx.Response:
        """A response, which is one of those that the document names."""
        if "json" in options:  # as it is: httpx refuses some of what a client may send
            text = json.dumps(options.pop("json"))
            options |= {"content": text.encode(errors="replace"), "headers": {"Content-Type": "application/json"}}
        response = self.api.request(method, path, **options)
        assert response.status_code in FORESEEN, f"{method} {path}: {response.status_code} {response.text[:200]}"
        return response

    # Clients

    @rule(vx=st.floats(-0.3, 0.3), yaw_rate=st.floats(-0.3, 0.3))
    def drive(self, vx: float, yaw_rate: float) -> None:
        self.request("PUT", "live/reference", json={"vx": vx, "yaw_rate": yaw_rate})

    @rule(x=st.floats(-5, 5), y=st.floats(-3, 3))
    def push(self, x: float, y: float) -> None:
        self.request("POST", "live/push", json={"impulse": [x, y]})

    @rule(values=PARAMETERS)
    def change_parameters(self, values: dict[str, Any]) -> None:
        self.request("PATCH", "live/parameters", json=values)

    @rule(path=st.sampled_from(["live/reference", "live/push", "live/speed", "live/step"]), body=PLAIN)
    def send_anything(self, path: str, body: Any) -> None:
        self.request("PUT" if path == "live/reference" else "POST", path, json=body)

    @rule(action=st.sampled_from(["pause", "resume", "step", "reset"]))
    def command(self, action: str) -> None:
        if self.request("POST", f"live/{action}").status_code == 200 and action in ("pause", "resume"):
            self.is_paused = action == "pause"

    @rule(data=BYTES)
    def talk_nonsense(self, data: bytes) -> None:
        host, _, port = self.server.host.partition(":")
        with socket.create_connection((host, int(port)), timeout=BOUND) as client, suppress(OSError):
            client.sendall(data)
            client.shutdown(socket.SHUT_WR)
            client.recv(1000)

    @rule(path=st.sampled_from(["stream?rate=60", "stream?format=msgpack", "teleop"]))
    def open_socket(self, path: str) -> None:
        with suppress(WebSocketException, OSError):  # refused while many are open
            self.sockets.append(connect(self.server.socket_url(path), open_timeout=BOUND))

    @rule(message=MESSAGES)
    def send_message(self, message: str | bytes) -> None:
        with suppress(WebSocketException, OSError, UnicodeEncodeError):  # ended for an earlier message
            for client in self.sockets[-1:]:
                client.send(message)

    @rule()
    def cut_connection(self) -> None:
        with suppress(OSError):
            if self.sockets:
                self.sockets.pop().socket.shutdown(socket.SHUT_RDWR)

    # Runs

    @rule(scenario=SCENARIOS)
    def submit(self, scenario: dict[str, Any]) -> None:
        response = self.request("POST", "runs", json=scenario)
        if response.status_code == 202:
            self.known.append(response.json()["id"])

    @rule()
    def save(self) -> None:
        response = self.request("POST", "live/save", json={})
        if response.status_code == 201:
            self.known.append(response.json()["id"])

    @rule(number=st.integers(0, 99))
    def delete(self, number: int) -> None:
        if not self.known:
            return
        run_id = self.known[number % len(self.known)]
        if self.request("DELETE", f"runs/{run_id}").status_code == 204:
            self.known.remove(run_id)
            self.removed.add(run_id)

    # Faults

    @precondition(lambda self: not self.is_stopped)
    @rule()
    def kill_control_process(self) -> None:
        before = self.control_process()
        with suppress(ProcessLookupError):
            os.kill(before, signal.SIGKILL)
        wait_for(lambda: self.control_process() != before or self.health()["status"] == "unhealthy")

    @precondition(lambda self: not self.is_stopped)
    @rule()
    def stop_control_process(self) -> None:
        self.stopped, self.is_stopped = self.control_process(), True
        with suppress(ProcessLookupError):
            os.kill(self.stopped, signal.SIGSTOP)
            wait_for(lambda: self.control_process() != self.stopped or self.health()["status"] != "ok")

    @precondition(lambda self: self.is_stopped)
    @rule()
    def continue_control_process(self) -> None:
        self.is_stopped = False
        with suppress(ProcessLookupError, psutil.NoSuchProcess):  # the watchdog has ended it
            if psutil.Process(self.stopped).status() == psutil.STATUS_STOPPED:
                os.kill(self.stopped, signal.SIGCONT)

    @precondition(lambda self: self.disk is not None and self.filling is None)
    @rule()
    def fill_disk(self) -> None:
        assert self.disk is not None
        self.filling = fill(self.disk)
        health = self.health()
        assert health["runs"] and health["status"] != "ok"

    @precondition(lambda self: self.filling is not None)
    @rule()
    def free_disk(self) -> None:
        assert self.filling is not None
        self.filling.unlink()
        self.filling = None

    # What must hold

    def health(self) -> dict[str, Any]:
        return self.request("GET", "health").json()

    def control_process(self) -> int:
        return self.health()["control_process"]

    @invariant()
    def health_is_told(self) -> None:
        if hasattr(self, "known"):
            health = self.health()
            assert health["status"] in ("ok", "degraded", "unhealthy")
            assert (health["status"] == "ok") == (health["reason"] == "")

    @invariant()
    def no_run_is_lost(self) -> None:
        if hasattr(self, "known"):
            listed = {run["id"] for run in self.request("GET", "runs").json()}
            assert set(self.known) <= listed and not self.removed & listed

    def teardown(self) -> None:
        """The faults end: the robot goes on, and every run comes to its end."""
        if not hasattr(self, "known"):
            return
        for client in self.sockets:
            with suppress(OSError):
                client.socket.shutdown(socket.SHUT_RDWR)
        if self.is_stopped:
            self.continue_control_process()
        if self.filling is not None:
            self.free_disk()
        try:
            wait_for(lambda: self.health()["status"] != "unhealthy" and not self.health()["runs"])
        except AssertionError as error:
            raise AssertionError(f"faults that are over last: {self.health()}") from error
        wait_for(lambda: self.request("POST", "live/reset").status_code == 200)
        self.request("POST", "live/resume")
        tick = self.request("GET", "live").json()["tick"]
        wait_for(lambda: self.request("GET", "live").json()["tick"] > tick)
        for run_id in self.known:
            wait_for(lambda: self.request("GET", f"runs/{run_id}").json()["status"] not in ("queued", "running"))  # noqa: B023 (called at once)
            run = self.request("GET", f"runs/{run_id}").json()
            assert run["status"] == "done" or run["reason"], run
            assert (self.request("GET", f"runs/{run_id}/run.json").status_code == 200) == bool(run["size"])
        for run_id in self.known:
            self.request("DELETE", f"runs/{run_id}")
        self.api.close()


@pytest.mark.parametrize(
    ("nb_examples", "nb_steps"),
    [(2, 15), pytest.param(30, 50, marks=pytest.mark.exhaustive)],
    ids=["short", "long"],
)
def test_whatever_happens_the_server_goes_on_and_says_what_is_wrong(tmp_path, nb_examples, nb_steps):
    with ExitStack() as end:
        disk = end.enter_context(small_disk(tmp_path / "disk", "64m"))
        data = (disk or tmp_path) / "data"
        server = end.enter_context(
            serving("--robot", "hrp2", "--scene", "light", WALK_DATA=str(data), RUNS_QUEUED="99")
        )
        machine = type("Machine", (Faults,), {"server": server, "disk": disk})
        machine.TestCase.settings = settings(
            max_examples=nb_examples,
            stateful_step_count=nb_steps,
            derandomize=True,
            phases=[Phase.explicit, Phase.generate],  # what went before is part of a failure: nothing to shrink
            suppress_health_check=list(HealthCheck),
        )
        machine.TestCase().runTest()
