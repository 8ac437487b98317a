"""The schedule of the ticks: when the next one is due, and how well the last ones kept up."""

import time
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

MAX_CATCH_UP = 0.005  # [s] of lateness made up for; beyond it the schedule moves: one late tick, not a burst of them
FACTOR_WINDOW = 5.0  # [s] over which the real-time factor is taken
SMOOTHING = 0.02  # weight of the latest tick in the smoothed means
LATENESS_EDGES = (0.001, 0.005, 0.05)  # [s] between the classes by which late ticks are counted


@dataclass(frozen=True, slots=True, eq=False)
class TickTiming:
    """Measures of how well the ticks keep up with real time."""

    tick_ms: float
    """Smoothed mean of a tick's computation [ms]."""
    tick_ms_max: float
    """Largest computation among the ticks of the last second [ms]."""
    misses: int
    """Ticks that started more than one period late."""
    real_time_factor: float
    """Simulated time of the last seconds over real time times the requested speed: 1 where the walk keeps up."""
    ticks: int
    """Ticks taken on schedule since the control process started; single ticks of a paused robot do not count."""
    lateness: tuple[int, ...]
    """Number of ticks that started no later than the first of `LATENESS_EDGES`, between the first two, and so on."""
    lateness_sum: float
    """Sum of the lateness of all ticks [s]."""
    lateness_max: float
    """Largest lateness of all ticks [s]."""
    stages: Mapping[str, float]
    """Smoothed mean of each stage of a tick [ms]."""

    def later_than(self, edge: float) -> int:
        """Number of ticks that started later than one of `LATENESS_EDGES` [s]."""
        return sum(self.lateness[LATENESS_EDGES.index(edge) + 1 :])


class TickScheduler:
    """Tells when ticks are due and measures them. Belongs to one thread."""

    def __init__(self, period: float, clock: Callable[[], float] = time.perf_counter) -> None:
        """Let the first tick be due now.

        Args:
            period: of simulated time from one tick to the next [s].
            clock: reads the time on the wall [s].
        """
        self._period, self._clock = period, clock
        self._durations: deque[float] = deque([0.0], maxlen=max(1, round(1.0 / period)))
        self._mean = 0.0
        self._stages: dict[str, float] = {}
        self._ticks, self._misses = 0, 0
        self._lateness = [0] * (len(LATENESS_EDGES) + 1)
        self._lateness_sum = self._lateness_max = 0.0
        self.real_t = 0.0
        """Time on the wall during which the robot was running, since it was set to zero [s]."""
        self.set_speed(1.0)

    def set_speed(self, speed: float) -> None:
        """Let simulated time pass `speed` times as fast as real time; the next tick is due now."""
        self._interval = self._period / speed
        self._starts: deque[float] = deque(maxlen=round(FACTOR_WINDOW / self._interval) + 1)
        self.restart()

    def restart(self) -> None:
        """Let the next tick be due now; time before it, such as a pause, does not count."""
        self._due = self._clock()
        self._starts.clear()

    @property
    def time_left(self) -> float:
        """Time until the next tick is due [s]; negative where it is late."""
        return self._due - self._clock()

    def start_tick(self) -> None:
        """Note that a tick starts now. Far behind, the schedule moves and simulated time slows; no tick is skipped."""
        now = self._clock()
        late = max(now - self._due, 0.0)
        self._ticks += 1
        self._lateness[bisect_left(LATENESS_EDGES, late)] += 1
        self._lateness_sum += late
        self._lateness_max = max(self._lateness_max, late)
        self._misses += late > self._interval
        self._due += self._interval + (late if late > MAX_CATCH_UP else 0.0)
        if self._starts:
            self.real_t += now - self._starts[-1]
        self._starts.append(now)

    def record(self, duration: float, stages: Mapping[str, float]) -> None:
        """Add a tick's computation to the measures.

        Args:
            duration: of the whole computation [s].
            stages: duration of each stage [s].
        """
        self._mean += (duration - self._mean) * (SMOOTHING if self._mean else 1.0)
        self._durations.append(duration)
        for stage in {**self._stages, **stages}:
            now, mean = 1e3 * stages.get(stage, 0.0), self._stages.get(stage)
            self._stages[stage] = now if mean is None else mean + (now - mean) * SMOOTHING

    @property
    def timing(self) -> TickTiming:
        """The measures at this moment."""
        elapsed = self._starts[-1] - self._starts[0] if self._starts else 0.0
        return TickTiming(
            tick_ms=1e3 * self._mean,
            tick_ms_max=1e3 * max(self._durations),
            misses=self._misses,
            real_time_factor=(len(self._starts) - 1) * self._interval / elapsed if elapsed > 0.0 else 1.0,
            ticks=self._ticks,
            lateness=tuple(self._lateness),
            lateness_sum=self._lateness_sum,
            lateness_max=self._lateness_max,
            stages=dict(self._stages),
        )
