"""The rate of the ticks: when the next one is due, and how well the last ones kept up."""

import time
from collections import deque
from dataclasses import dataclass

MAX_LATENESS = 0.05  # [s] caught up with at most; beyond it the schedule moves and simulated time slows
FACTOR_WINDOW = 5.0  # [s] over which the real-time factor is taken
SMOOTHING = 0.02  # weight of the latest tick in the smoothed mean


@dataclass(frozen=True, slots=True, eq=False)
class Timing:
    """How well the ticks keep up with real time."""

    tick_ms: float
    """Smoothed mean of a tick's computation [ms]."""
    tick_ms_max: float
    """Largest of the last second [ms]."""
    misses: int
    """Ticks that started more than one period late."""
    real_time_factor: float
    """Simulated over real time of the last seconds."""


class Pace:
    """Sleeps from one tick to the next and measures them. Belongs to one thread."""

    def __init__(self, period: float) -> None:
        """Ticks come every `period` [s], the first one now."""
        self._period = period
        self._durations: deque[float] = deque([0.0], maxlen=max(1, round(1.0 / period)))
        self._starts: deque[float] = deque(maxlen=round(FACTOR_WINDOW / period) + 1)
        self._mean = 0.0
        self._misses = 0
        self.restart()

    def restart(self) -> None:
        """The next tick is due now; what came before, such as a pause, does not count."""
        self._due = time.perf_counter()
        self._starts.clear()

    def wait(self) -> None:
        """Sleep until the next tick is due, which no tick skips: far behind, the schedule moves."""
        late = time.perf_counter() - self._due
        if late < 0.0:
            time.sleep(-late)
        elif late > MAX_LATENESS:
            self._due += late
        if late > self._period:
            self._misses += 1
        self._due += self._period
        self._starts.append(time.perf_counter())

    def record(self, duration: float) -> None:
        """Take note of a tick's computation [s]."""
        self._mean += (duration - self._mean) * (SMOOTHING if self._mean else 1.0)
        self._durations.append(duration)

    @property
    def timing(self) -> Timing:
        """At this moment."""
        elapsed = self._starts[-1] - self._starts[0] if self._starts else 0.0
        factor = (len(self._starts) - 1) * self._period / elapsed if elapsed > 0.0 else 1.0
        return Timing(1e3 * self._mean, 1e3 * max(self._durations), self._misses, factor)
