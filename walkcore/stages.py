"""Durations of the stages of a tick, and the time left for it, by the caller's clock: the core reads none."""

import math
from collections.abc import Callable
from typing import Protocol


class Stages(Protocol):
    """Listener to the stages of a tick."""

    def start(self) -> None:
        """Note that a tick begins."""
        ...

    def lap(self, stage: str) -> None:
        """Note that a stage is over, which lasted since the last call."""
        ...


class Stopwatch:
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


class _Untimed:
    """Listener that measures nothing."""

    def start(self) -> None:
        """Do nothing."""

    def lap(self, stage: str) -> None:
        """Do nothing."""


UNTIMED: Stages = _Untimed()

TimeLeft = Callable[[], float]
"""Time that is left for the decision of a tick [s]."""


def unlimited() -> float:
    """The time left where none is limited, as in every scripted walk: what is decided then depends on no clock."""
    return math.inf
