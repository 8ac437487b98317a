"""Several clients of one robot: the last one to take hold drives, and the others wait."""

import time
from collections.abc import Iterator

import pytest
from pydantic import ValidationError

from app.http.schemas import TeleopMessage
from app.live import teleop_client
from app.live.runner import Runner
from app.live.teleop_client import TeleopClient
from walkcore import Parameters, Push, Reference, load_robot

FORWARD, BACK = Reference(vx=0.1), Reference(vx=-0.1)


@pytest.fixture
def runner(monkeypatch) -> Iterator[Runner]:
    """Not started: what drives is known before the first tick. Holds last for longer than a test."""
    monkeypatch.setattr(teleop_client, "TELEOP_TIMEOUT", 600.0)
    runner = Runner(load_robot("hrp2"), Parameters())
    yield runner
    runner.stop()


def test_client_that_was_overtaken_is_not_heard_until_it_takes_hold_anew(runner):
    one, other = TeleopClient(lambda: runner, "one"), TeleopClient(lambda: runner, "other")
    one.steer(FORWARD, "joystick", engagement=1)
    assert runner.active_driver == ("joystick", "one")
    other.steer(BACK, "keyboard", engagement=7)
    one.steer(FORWARD, "joystick", engagement=1)
    assert runner.active_driver == ("keyboard", "other")
    one.steer(FORWARD, "joystick", engagement=2)
    assert runner.active_driver == ("joystick", "one")


def test_held_control_drives_again_when_nobody_else_does(runner, monkeypatch):
    one, other = TeleopClient(lambda: runner, "one"), TeleopClient(lambda: runner, "other")
    one.steer(FORWARD, "joystick", engagement=1)
    with monkeypatch.context() as patch:
        patch.setattr(teleop_client, "TELEOP_TIMEOUT", 0.01)
        other.steer(BACK, "joystick", engagement=1)
    time.sleep(0.02)
    assert runner.active_driver == ("none", "")
    one.steer(FORWARD, "joystick", engagement=1)
    assert runner.active_driver == ("joystick", "one")


def test_held_control_does_not_take_the_robot_back_from_a_reference_that_is_held(runner):
    one = TeleopClient(lambda: runner, "one")
    one.steer(FORWARD, "gamepad", engagement=1)
    for driver, client in (("rest", ""), ("sliders", "one")):  # the sliders of the same browser, too
        runner.drive(BACK, driver, client=client)
        one.steer(FORWARD, "gamepad", engagement=1)
        assert runner.active_driver == (driver, client)


def test_message_without_an_engagement_always_takes_hold(runner):
    one, other = TeleopClient(lambda: runner, "one"), TeleopClient(lambda: runner, "other")
    for _ in range(2):
        one.steer(FORWARD, "joystick", engagement=None)
        assert runner.active_driver == ("joystick", "one")
        other.steer(BACK, "joystick", engagement=None)
        assert runner.active_driver == ("joystick", "other")


def test_client_pushes_no_stronger_than_the_limit_whoever_drives(runner, monkeypatch):
    pushes: list[Push] = []
    monkeypatch.setattr(runner, "push", pushes.append)
    runner.drive(BACK, "rest")
    TeleopClient(lambda: runner, "one").push(Push([300.0, -400.0]))
    assert pushes[0].impulse == pytest.approx([0.6 * runner.robot.max_push, -0.8 * runner.robot.max_push])


@pytest.mark.parametrize("name", ["engagement", "grip"])
def test_a_message_names_its_hold_by_the_new_and_by_the_deprecated_name(name):
    assert TeleopMessage.model_validate_json(f'{{"reference": {{"vx": 0.1}}, "{name}": 3}}').engagement == 3


def test_a_message_that_names_its_hold_twice_is_refused():
    with pytest.raises(ValidationError):
        TeleopMessage.model_validate_json('{"engagement": 3, "grip": 2}')
