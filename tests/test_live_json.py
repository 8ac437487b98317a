"""The live snapshot is plain values, whatever the robot does: an encoder that is strict takes it."""

import json
from dataclasses import replace

import msgspec
import pytest
from conftest import Clock

from app.http.live_json import live_json
from app.live.control import Control
from app.live.live_state import LiveState, ReferenceCommand
from app.routes import sockets
from walkcore import Parameters, Push, Reference, load_robot
from walkcore.mpc.plan import Status

PERIOD = 0.02  # [s]


@pytest.mark.parametrize("name", ["hrp2", "talos"])
def test_every_state_of_a_walk_that_ends_on_the_ground_can_be_encoded(name):
    robot, clock, shown = load_robot(name), Clock(), list[LiveState]()
    control = Control(robot, Parameters(control_period=PERIOD, dynamic_filter=True), shown.append, clock)
    control.start()
    for tick in range(400):
        if tick == 20:
            control.set_reference(ReferenceCommand(Reference(0.1, 0.05, 0.1), "rest"))
        if tick in (100, 101, 300):
            control.push(Push([0.0, 10.0 if tick < 300 else 120.0], 0.1 if tick == 101 else 0.0))
        clock.now += max(control.time_left, 0.0)
        control.tick()
        encodable = live_json(control.latest)
        text = json.loads(json.dumps(encodable))
        assert msgspec.json.decode(msgspec.json.encode(encodable)) == text
        assert msgspec.msgpack.decode(msgspec.msgpack.encode(encodable)) == text
    assert control.latest.snapshot.status is Status.FALLEN and control.latest.last_push is not None


class Frozen:
    """Stand-in for the runner: a robot whose state changes only where a test changes it."""

    def __init__(self) -> None:
        self.states: list[LiveState] = []
        Control(load_robot("hrp2"), Parameters(), self.states.append)

    @property
    def latest(self) -> LiveState:
        return self.states[-1]


def test_a_snapshot_is_encoded_once_for_all_streams_of_a_format(monkeypatch):
    encoded: list[LiveState] = []
    monkeypatch.setattr(sockets, "live_json", lambda state: encoded.append(state) or live_json(state))
    runner = Frozen()
    streams = sockets.SnapshotStreams(lambda: runner.latest)
    for _ in range(20):
        text, binary = streams.latest("json"), streams.latest("msgpack")
    assert len(encoded) == 2
    assert json.loads(text) == msgspec.msgpack.decode(binary) == live_json(runner.latest)

    runner.states.append(replace(runner.latest, speed=2.0))
    assert json.loads(streams.latest("json"))["speed"] == 2.0 and len(encoded) == 3


def test_streams_of_one_rate_are_due_together_and_never_twice_in_a_period(monkeypatch):
    for now in (100.0, 100.01, 100.033, 100.0333333, 1e6):
        monkeypatch.setattr(sockets.time, "monotonic", lambda now=now: now)
        wait = sockets.time_to_next(30.0)
        assert 1e-4 < wait <= 1.0334 / 30.0
        assert ((now + wait) * 30.0) % 1.0 == pytest.approx(0.0, abs=1e-6) or ((now + wait) * 30.0) % 1.0 > 1.0 - 1e-6
