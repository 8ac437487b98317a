"""A hand on the robot: one of several browsers that steer and push it, of which the last one to take hold drives.

A held stick repeats itself, so that a lost connection is noticed. Were every repetition
obeyed, two hands would pull the robot to and fro; so a hand that was overtaken is heard
again only when it takes hold anew, or when nobody drives any more.
"""

import numpy as np

from app.live.runner import NOBODY, Runner
from walkcore import Push, Reference

EXPIRES = 0.4  # [s] after which a silent hand counts as let go


class Hand:
    """Steers and pushes for one client, within the robot's limits."""

    def __init__(self, runner: Runner, client: str) -> None:
        """A hand that has not taken hold yet."""
        self._runner, self._client = runner, client
        self._grip = -1
        self._driver = NOBODY.driver

    def steer(self, reference: Reference, driver: str, grip: int | None) -> None:
        """Ask for a velocity, clamped to the limits.

        Args:
            reference: what is asked.
            driver: what the hand holds: "joystick", "keyboard" ...
            grip: grows each time the hand takes hold; None takes hold with every call.

        Raises:
            InvalidValueError: for what cannot be clamped.
        """
        if self._has_hold(grip):
            robot, self._driver = self._runner.robot, driver
            self._runner.drive(robot.clamped_reference(reference), driver, EXPIRES, self._client)

    def push(self, push: Push) -> None:
        """Push the robot, in the direction asked and no stronger than the limit.

        Raises:
            InvalidValueError: for what cannot be clamped.
        """
        self._runner.push(_clamped(push, self._runner.robot.max_push))

    def _has_hold(self, grip: int | None) -> bool:
        if grip is None:
            return True
        is_new = grip > self._grip
        self._grip = max(grip, self._grip)
        driver, client = self._runner.helm
        return is_new or driver == NOBODY.driver or (driver, client) == (self._driver, self._client)


def _clamped(push: Push, max_push: float) -> Push:
    """The push in its direction, no stronger than a limit."""
    strength = float(np.linalg.norm(push.impulse))
    if strength <= max_push:
        return push
    shrunk = push.impulse * (max_push / strength * (1.0 - 1e-9))  # so that rounding stays below the limit
    return Push(shrunk, push.duration, push.frame)
