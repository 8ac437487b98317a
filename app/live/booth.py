"""Booth: phones drive in turn within bounds, the robot stands up by itself, and walks by itself while nobody drives.

It is open while a screen is: the page `?booth` keeps a socket to it. All of it survives days without a person: a robot
that has fallen or has a fault begins anew, and so does one that has walked far, where nobody sees the difference.
"""

import math
import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

import numpy as np

from app.live.driver_lease import DriverLease, LeaseHeldError
from app.live.driver_queue import DriverQueue
from app.live.live_state import LiveState
from app.live.messages import NoResponseError
from app.live.runner import Runner
from app.live.teleop_client import TELEOP_TIMEOUT
from walkcore import Push, Reference
from walkcore.mpc.plan import Status

# Pushes as shares of the robot's strongest: of visitors, and of the walk without them, which should lead to no fall.
# In contact physics the default robot falls of 0.4, to the left while it comes to a stand.
PUSH_SHARE, ATTRACT_PUSH_SHARE = 0.3, 0.2
PUSH_PERIOD = 1.5  # [s] between pushes of visitors
STAND_UP_AFTER = 4.0  # [s] on the ground, so that everybody has seen why
ATTRACT_AFTER = 60.0  # [s] without anybody who drives
FAR = 30.0  # [m] from the origin, after which the robot begins anew at the end of a round
STEP_PERIOD = 0.1  # [s] between looks after the robot
ATTRACT, PHONE = "booth", "phone"  # kinds of source of the reference


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of the walk by which the robot attracts visitors: a reference in shares of its limits, and a push."""

    duration: float
    """[s]."""
    forward: float = 0.0
    left: float = 0.0
    turn: float = 0.0
    push: float | None = None
    """Direction of a push at its beginning, counter-clockwise from ahead [rad]; None for no push."""


ROUND = (
    Stretch(3.0),
    Stretch(8.0, forward=0.8),
    Stretch(9.0, forward=0.6, turn=0.8),
    Stretch(5.0),
    Stretch(6.0, push=0.5 * math.pi),
    Stretch(7.0, left=0.8),
    Stretch(7.0, left=-0.8),
    Stretch(5.0),
    Stretch(6.0, push=0.0),
    Stretch(8.0, turn=-0.8),
    Stretch(4.0),
)
"""The walk while nobody drives, again and again; it ends at rest."""


class Booth:
    """The booth. Belongs to the event loop."""

    def __init__(
        self, runner: Callable[[], Runner], lease: DriverLease, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Start closed.

        Args:
            runner: gives that of the robot that walks at the moment.
            lease: of its controls.
            clock: gives the time, which only goes forward [s].
        """
        self._get_runner, self._clock = runner, clock
        self.key = secrets.token_urlsafe(6)
        """Secret of the code on the screen, which lets a phone drive and do nothing else."""
        self.queue = DriverQueue(lease, clock)
        self.problem = ""
        """Why visitors wait though it is their turn; empty where they do not."""
        self.is_attracting = False
        """Whether the robot walks by itself."""
        self._nb_screens = 0
        self.nb_phones = 0
        """Phones that are connected, in line or not."""
        self._last_step = self._last_driven = self._last_push = -math.inf
        self._down_since: float | None = None
        self._round = _Round()

    @property
    def is_open(self) -> bool:
        """Whether a screen shows the booth."""
        return self._nb_screens > 0

    @contextmanager
    def screen(self) -> Iterator[None]:
        """Keep the booth open meanwhile; with the last screen all visitors go."""
        self._nb_screens += 1
        try:
            yield
        finally:
            self._nb_screens -= 1
            if not self._nb_screens:
                with suppress(LeaseHeldError):
                    self.queue.clear()
                self.is_attracting = False

    @contextmanager
    def phone(self) -> Iterator[None]:
        """Count a phone as connected meanwhile."""
        self.nb_phones += 1
        try:
            yield
        finally:
            self.nb_phones -= 1

    def steer(self, name: str, forward: float, left: float, turn: float) -> None:
        """Request a velocity for a visitor.

        Args:
            name: of the visitor.
            forward: share of the robot's limit, in [-1, 1].
            left: the same.
            turn: the same, counter-clockwise.

        Raises:
            NotYourTurnError: if another one drives.
            LeaseHeldError: if a browser drives alone.
            NoResponseError: if the control process does not respond at the moment.
        """
        self.queue.check(name)
        runner = self._get_runner()
        runner.drive(_reference(runner, forward, left, turn), PHONE, TELEOP_TIMEOUT, name)

    def push(self, name: str, angle: float) -> None:
        """Push the robot for a visitor, as hard as visitors may; too soon after another push it is left out.

        Args:
            name: of the visitor.
            angle: direction, counter-clockwise from ahead of the robot [rad].

        Raises:
            NotYourTurnError: if another one drives.
            LeaseHeldError: if a browser drives alone.
            NoResponseError: if the control process does not respond at the moment.
        """
        self.queue.check(name)
        if self._clock() - self._last_push >= PUSH_PERIOD:
            self._last_push = self._clock()
            self._push(angle, PUSH_SHARE)

    def step(self) -> None:
        """Look after the robot and the line; may be called as often as one likes."""
        now = self._clock()
        if now - self._last_step < STEP_PERIOD:
            return
        self._last_step = now
        try:
            self.queue.update()
            self.problem = ""
        except LeaseHeldError as error:
            self.problem = str(error)
        with suppress(NoResponseError):  # the control process is started again by itself
            self._look_after(self._get_runner(), now)

    def _look_after(self, runner: Runner, now: float) -> None:
        state = runner.latest
        if _is_driven(state) or self.queue.driver or self.queue.is_kept_out:
            self._last_driven = now
        self.is_attracting = now - self._last_driven >= ATTRACT_AFTER
        if state.snapshot.status is Status.FALLEN or state.fault:
            self._down_since = now if self._down_since is None else self._down_since
            if now - self._down_since >= STAND_UP_AFTER:
                self._down_since = None
                self._begin_anew(runner)
            return
        self._down_since = None
        if not self.is_attracting:
            self._round = _Round()
            return
        if not state.running:
            runner.resume()  # whoever paused it has gone
        self._attract(runner, state, now)

    def _attract(self, runner: Runner, state: LiveState, now: float) -> None:
        """Walk on by the round, for a little longer than to the next step."""
        stretch, is_new = self._round.at(now)
        if is_new and stretch is ROUND[0] and np.hypot(*state.snapshot.com.position) > FAR:
            self._begin_anew(runner)
            return
        reference = _reference(runner, stretch.forward, stretch.left, stretch.turn)
        runner.drive(reference, ATTRACT, TELEOP_TIMEOUT + STEP_PERIOD)
        if is_new and stretch.push is not None:
            self._push(stretch.push, ATTRACT_PUSH_SHARE)

    def _push(self, angle: float, share: float) -> None:
        runner = self._get_runner()
        strength = share * runner.robot.max_push
        runner.push(Push(strength * np.array([math.cos(angle), math.sin(angle)])))

    @staticmethod
    def _begin_anew(runner: Runner) -> None:
        runner.reset()
        runner.resume()


class _Round:
    """Progress along `ROUND`."""

    def __init__(self) -> None:
        self._index, self._ends_at = -1, -math.inf

    def at(self, now: float) -> tuple[Stretch, bool]:
        """The stretch of a time that only goes forward [s], and whether it begins."""
        is_new = now >= self._ends_at
        if is_new:
            self._index = (self._index + 1) % len(ROUND)
            self._ends_at = now + ROUND[self._index].duration
        return ROUND[self._index], is_new


def _is_driven(state: LiveState) -> bool:
    """Whether somebody else lets the robot walk."""
    reference = state.snapshot.reference
    return state.driver != ATTRACT and any((reference.vx, reference.vy, reference.yaw_rate))


def _reference(runner: Runner, forward: float, left: float, turn: float) -> Reference:
    """A reference in shares of the robot's limits, which differ from one direction to its opposite."""
    limits = runner.robot.max_reference

    def share(part: float, name: str) -> float:
        low, high = limits[name]
        return part * high if part >= 0.0 else -part * low

    return Reference(share(forward, "vx"), share(left, "vy"), share(turn, "yaw_rate"))
