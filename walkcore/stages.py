"""Durations of the stages of a tick, and the time left for it, by the caller's clock: the core reads none."""

import math
from collections.abc import Callable
from itertools import count


class Stages:
    """Listener to the stages of a tick; this one takes no notice of them."""

    def start(self) -> None:
        """Note that a tick begins."""

    def lap(self, stage: str) -> None:
        """Note that a stage is over, which lasted since the last call."""


UNTIMED = Stages()


class Stopwatch(Stages):
    """Durations of the stages of the latest tick."""

    def __init__(self, clock: Callable[[], float]) -> None:
        """Start with no stages.

        Args:
            clock: gives the time [s].
        """
        self._clock = clock
        self._last = 0.0
        self.laps: dict[str, float] = {}
        """Duration of each stage [s], in the order in which they came; a stage that comes again adds up."""

    def start(self) -> None:
        """Forget the last tick."""
        self.laps = {}
        self._last = self._clock()

    def lap(self, stage: str) -> None:
        """Add the time since the last call to a stage."""
        now = self._clock()
        self.laps[stage] = self.laps.get(stage, 0.0) + now - self._last
        self._last = now


TimeLeft = Callable[[], float]
"""Time that is left for the decision of a tick [s]."""


def unlimited() -> float:
    """The time left where none is limited, as in a scripted walk: what is decided then depends on no clock."""
    return math.inf


class CountedTime:
    """Time left of one tick, which notes when it was over, so that the tick can be decided the same again.

    What a decision does depends on the clock only by whether there was time left each time that it asked.
    """

    def __init__(self, time_left: TimeLeft) -> None:
        """Begin to count.

        Args:
            time_left: reads the clock.
        """
        self._time_left = time_left
        self._nb_in_time, self._is_over = 0, False

    def __call__(self) -> float:
        """Time left [s]; once it was over, there is never any again."""
        left = 0.0 if self._is_over else self._time_left()
        self._is_over = left <= 0.0
        self._nb_in_time += not self._is_over
        return left

    @property
    def solves_in_time(self) -> int | None:
        """Number of times that there was time left before there was none; None if there always was."""
        return self._nb_in_time if self._is_over else None


def time_of_solves(solves_in_time: int | None) -> TimeLeft:
    """Time left of a tick that goes out of time as another one did.

    Args:
        solves_in_time: as `CountedTime` counted; None for time without limit.
    """
    if solves_in_time is None:
        return unlimited
    numbers = count()
    return lambda: math.inf if next(numbers) < solves_in_time else 0.0
