"""The controls of browsers: who of them drives, and within what limits.

Several browsers may command the robot, and the last one to take hold drives. A held stick repeats its reference, so
that a lost connection is noticed. If every repetition were obeyed, two browsers would pull the robot to and fro; so a
client that was overtaken is heard again only when it takes hold anew, or when nobody drives any more.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from app.live.live_state import NO_REFERENCE
from app.live.runner import Runner
from walkcore import Push, Reference

TELEOP_TIMEOUT = 0.4  # [s] after which a silent teleop client counts as let go


class TeleopClient:
    """The controls of one browser: its references and pushes, kept within the robot's limits."""

    def __init__(self, runner: Callable[[], Runner], client: str) -> None:
        """Begin without a hold.

        Args:
            runner: gives that of the robot that walks at the moment.
            client: name of the browser.
        """
        self._runner, self._client = runner, client
        self._engagement = -1
        self._driver = NO_REFERENCE.driver

    def steer(self, reference: Reference, driver: str, engagement: int | None) -> None:
        """Request a velocity, which is clamped to the limits; ignored where another client has overtaken this one.

        Args:
            reference: as the control stands.
            driver: kind of control: "joystick", "keyboard" ...
            engagement: number of the current hold of the control, which grows with each; None takes hold anew with
                every call.

        Raises:
            InvalidValueError: for what cannot be clamped.
        """
        if self._has_hold(engagement):
            runner, self._driver = self._runner(), driver
            runner.drive(runner.robot.clamped_reference(reference), driver, TELEOP_TIMEOUT, self._client)

    def push(self, push: Push) -> None:
        """Push the robot, in the given direction and no stronger than the limit.

        Raises:
            InvalidValueError: for what cannot be clamped.
        """
        runner = self._runner()
        strength, limit = float(np.linalg.norm(push.impulse)), runner.robot.max_push
        if strength > limit:  # and by so much less that rounding stays below it
            push = replace(push, impulse=push.impulse * (limit / strength * (1.0 - 1e-9)))
        runner.push(push)

    def _has_hold(self, engagement: int | None) -> bool:
        if engagement is None:
            return True
        is_new = engagement > self._engagement
        self._engagement = max(engagement, self._engagement)
        driver, client = self._runner().active_driver
        return is_new or driver == NO_REFERENCE.driver or (driver, client) == (self._driver, self._client)
