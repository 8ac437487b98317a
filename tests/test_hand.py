"""Several hands on one robot: the last one to take hold drives, and the others wait."""

import time
from collections.abc import Iterator

import pytest

from app.live import hand
from app.live.hand import Hand
from app.live.runner import Runner
from walkcore import Parameters, Push, Reference, load_robot

FORWARD, BACK = Reference(vx=0.1), Reference(vx=-0.1)


@pytest.fixture
def runner() -> Iterator[Runner]:
    """Not started: what drives is known before the first tick."""
    runner = Runner(load_robot("hrp2"), Parameters())
    yield runner
    runner.stop()


def test_hand_that_was_overtaken_is_not_heard_until_it_takes_hold_anew(runner):
    one, other = Hand(runner, "one"), Hand(runner, "other")
    one.steer(FORWARD, "joystick", grip=1)
    assert runner.helm == ("joystick", "one")
    other.steer(BACK, "keyboard", grip=7)
    one.steer(FORWARD, "joystick", grip=1)
    assert runner.helm == ("keyboard", "other")
    one.steer(FORWARD, "joystick", grip=2)
    assert runner.helm == ("joystick", "one")


def test_held_hand_drives_again_when_nobody_else_does(runner, monkeypatch):
    monkeypatch.setattr(hand, "EXPIRES", 0.01)
    one, other = Hand(runner, "one"), Hand(runner, "other")
    one.steer(FORWARD, "joystick", grip=1)
    other.steer(BACK, "joystick", grip=1)
    time.sleep(0.02)
    assert runner.helm == ("none", "")
    one.steer(FORWARD, "joystick", grip=1)
    assert runner.helm == ("joystick", "one")


def test_held_hand_does_not_take_the_robot_back_from_a_reference_that_is_held(runner):
    one = Hand(runner, "one")
    one.steer(FORWARD, "gamepad", grip=1)
    for driver, client in (("rest", ""), ("sliders", "one")):  # the sliders of the same browser, too
        runner.drive(BACK, driver, client=client)
        one.steer(FORWARD, "gamepad", grip=1)
        assert runner.helm == (driver, client)


def test_message_without_a_grip_always_takes_hold(runner):
    one, other = Hand(runner, "one"), Hand(runner, "other")
    for _ in range(2):
        one.steer(FORWARD, "joystick", grip=None)
        assert runner.helm == ("joystick", "one")
        other.steer(BACK, "joystick", grip=None)
        assert runner.helm == ("joystick", "other")


def test_hand_pushes_no_stronger_than_the_limit_whoever_drives(runner, monkeypatch):
    pushes: list[Push] = []
    monkeypatch.setattr(runner, "push", pushes.append)
    runner.drive(BACK, "rest")
    Hand(runner, "one").push(Push([300.0, -400.0]))
    assert pushes[0].impulse == pytest.approx([0.6 * runner.robot.max_push, -0.8 * runner.robot.max_push])
