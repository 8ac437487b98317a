"""The command of each tick of a live walk: reference and pushes as they were requested last, or pushes at random."""

import math

import numpy as np

from app.live.fork import ForkedWalk
from app.live.live_state import NO_REFERENCE, RandomPushes, ReferenceCommand
from walkcore import Command, Push, Reference

PAST = ReferenceCommand(Reference(), "past")
"""Driver that is told while a forked walk follows the commands of the walk that was."""


class CommandSource:
    """The latest reference until it expires, and the push of the coming tick."""

    def __init__(self, control_period: float) -> None:
        """Begin without either.

        Args:
            control_period: from one tick to the next [s].
        """
        self._period = control_period
        self._random_pusher: RandomPusher | None = None
        self.begin()

    def begin(self, command: ReferenceCommand = NO_REFERENCE, push: Push | None = None) -> None:
        """Forget what came before; random pushes go on.

        Args:
            command: reference to begin with.
            push: of the first tick.
        """
        self._push = push
        self.set_reference(command)

    @property
    def reference(self) -> Reference:
        """The reference that was commanded last."""
        return self._command.reference

    @property
    def pushes_at_random(self) -> bool:
        """Whether pushes come by themselves."""
        return self._random_pusher is not None

    def set_reference(self, command: ReferenceCommand) -> None:
        """Follow a reference from the next tick on."""
        self._command = command

    def push(self, push: Push) -> None:
        """Begin a push at the next tick; of several before it the last one counts."""
        self._push = push

    def push_at_random(self, pushes: RandomPushes | None) -> None:
        """Let pushes come by themselves; None ends them."""
        self._random_pusher = None if pushes is None else RandomPusher(pushes, self._period)

    def next(self, now: float, forked: ForkedWalk | None) -> tuple[Command, ReferenceCommand]:
        """The command of the coming tick, and who drives.

        Args:
            now: time on the wall [s].
            forked: walk whose commands come again, while it follows them; None where none does.
        """
        if now > self._command.expires_at:
            self._command = NO_REFERENCE
        push, self._push = self._push, None
        if forked is not None:
            forked.begin()
            if forked.follows:
                return forked.command(push), PAST
        if push is None and self._random_pusher is not None:
            push = self._random_pusher.at_next_tick()
        return Command(self._command.reference, push), self._command


class RandomPusher:
    """Draws when the next random push comes, from where and how strong."""

    def __init__(self, pushes: RandomPushes, period: float) -> None:
        """Let the first push come after about one interval.

        Args:
            pushes: how strong and how often.
            period: from one tick to the next [s].
        """
        self._pushes, self._period = pushes, period
        self._random = np.random.default_rng(pushes.seed)
        self._ticks_left = self._draw_wait()

    def at_next_tick(self) -> Push | None:
        """The push that begins at the next tick, if one does."""
        self._ticks_left -= 1
        if self._ticks_left > 0:
            return None
        self._ticks_left = self._draw_wait()
        angle = self._random.uniform(-math.pi, math.pi)
        strength = self._pushes.strength * self._random.uniform(0.5, 1.0)
        return Push(strength * np.array([math.cos(angle), math.sin(angle)]))

    def _draw_wait(self) -> int:
        return max(1, round(self._pushes.interval * self._random.uniform(0.5, 1.5) / self._period))
