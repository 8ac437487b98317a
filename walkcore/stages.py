"""How long each stage of a tick takes, on a clock that the caller brings: the core reads none."""

from collections.abc import Callable
from typing import Protocol


class Stages(Protocol):
    """Is told when a tick begins and when each of its stages is over."""

    def start(self) -> None:
        """A tick begins."""
        ...

    def lap(self, stage: str) -> None:
        """What went on since the last call was this stage."""
        ...


class Stopwatch:
    """Measures the stages of the latest tick."""

    def __init__(self, clock: Callable[[], float]) -> None:
        """Read the time from `clock` [s]."""
        self._clock = clock
        self._last = 0.0
        self.laps: dict[str, float] = {}
        """Duration of each stage [s], in the order in which they came; a stage that comes again adds up."""

    def start(self) -> None:
        """Forget the last tick."""
        self.laps = {}
        self._last = self._clock()

    def lap(self, stage: str) -> None:
        """Give the time since the last call to a stage."""
        now = self._clock()
        self.laps[stage] = self.laps.get(stage, 0.0) + now - self._last
        self._last = now


class _Untimed:
    """Measures nothing."""

    def start(self) -> None:
        """Nothing."""

    def lap(self, stage: str) -> None:
        """Nothing."""


UNTIMED: Stages = _Untimed()
