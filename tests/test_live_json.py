"""The live snapshot is plain values, whatever the robot does: an encoder that is strict takes it."""

import json

import msgspec
import pytest

from app.http.schemas import live_json
from app.live.control import Control
from app.live.live_state import LiveState, ReferenceCommand
from walkcore import Parameters, Push, Reference, load_robot
from walkcore.mpc.plan import Status

PERIOD = 0.02  # [s]


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


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
        told = live_json(control.latest, robot)
        text = json.loads(json.dumps(told))
        assert msgspec.json.decode(msgspec.json.encode(told)) == text
        assert msgspec.msgpack.decode(msgspec.msgpack.encode(told)) == text
    assert control.latest.snapshot.status is Status.FALLEN and control.latest.last_push is not None
