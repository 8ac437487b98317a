"""What `/metrics` tells Prometheus of the live robot."""

from collections.abc import Callable, Iterator

import psutil
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
    SummaryMetricFamily,
)
from prometheus_client.registry import Collector

from app.live.live_state import LiveState
from app.live.runner import Runner
from app.live.tick_scheduler import LATENESS_EDGES, Timing

SERVER = psutil.Process()


class LiveMetrics(Collector):
    """Reads the latest state whenever it is asked."""

    def __init__(self, runner: Runner, nb_clients: Callable[[], int], frames: Callable[[], tuple[int, float]]) -> None:
        """Of a runner, of so many open streams, and of so many drawn frames that took so many seconds."""
        self._runner, self._nb_clients, self._frames = runner, nb_clients, frames
        self._registry = CollectorRegistry()
        self._registry.register(self)

    def text(self) -> bytes:
        """In Prometheus's format."""
        return generate_latest(self._registry)

    def collect(self) -> Iterator[Metric]:
        """All of them, at this moment."""
        state = self._runner.latest
        yield from _of_ticks(state.timing)
        yield from _of_walk(state)
        yield GaugeMetricFamily("walk_clients", "Open streams of the live snapshot.", self._nb_clients())
        count, seconds = self._frames()
        yield SummaryMetricFamily(
            "walk_frame_seconds", "Processor time of a drawn frame, for all who look.", count, seconds
        )
        yield from _of_processes(self._runner)

    def describe(self) -> list[Metric]:
        """Nothing before the first question: the robot may not stand yet."""
        return []


def memory_of(runner: Runner) -> dict[str, float]:
    """Resident memory of the server and of its control process, while that lives [bytes]."""
    return _asked(runner, lambda process: process.memory_info().rss)


def _of_processes(runner: Runner) -> Iterator[Metric]:
    memory = GaugeMetricFamily("walk_memory_bytes", "Resident memory.", labels=["process"])
    for name, size in memory_of(runner).items():
        memory.add_metric([name], size)
    yield memory
    time = CounterMetricFamily("walk_cpu_seconds", "Processor time.", labels=["process"])
    for name, seconds in _asked(runner, _cpu_seconds).items():
        time.add_metric([name], seconds)
    yield time


def _cpu_seconds(process: psutil.Process) -> float:
    times = process.cpu_times()
    return times.user + times.system


def _asked(runner: Runner, ask: Callable[[psutil.Process], float]) -> dict[str, float]:
    """What the server's process and its control process answer, while that lives."""
    answers = {"server": ask(SERVER)}
    try:
        answers["control"] = ask(psutil.Process(runner.process_id))
    except psutil.NoSuchProcess:
        return answers
    return answers


def _of_ticks(timing: Timing) -> Iterator[Metric]:
    yield CounterMetricFamily("walk_ticks", "Ticks taken on schedule.", timing.ticks)
    yield CounterMetricFamily("walk_tick_misses", "Ticks that started more than a period late.", timing.misses)
    counts, buckets = 0, list[tuple[str, float]]()
    for edge, count in zip((*map(str, LATENESS_EDGES), "+Inf"), timing.lateness, strict=True):
        counts += count
        buckets.append((edge, counts))
    lateness = HistogramMetricFamily("walk_tick_lateness_seconds", "From when a tick was due to when it started.")
    lateness.add_metric([], buckets, timing.lateness_sum)
    yield lateness
    yield GaugeMetricFamily("walk_tick_lateness_max_seconds", "Largest there ever was.", timing.lateness_max)
    yield GaugeMetricFamily("walk_tick_seconds", "Smoothed mean of a tick's computation.", timing.tick_ms / 1e3)
    yield GaugeMetricFamily("walk_tick_max_seconds", "Largest of the last second.", timing.tick_ms_max / 1e3)
    stages = GaugeMetricFamily("walk_stage_seconds", "Smoothed mean of a stage of a tick.", labels=["stage"])
    for stage, duration in timing.stages.items():
        stages.add_metric([stage], duration / 1e3)
    yield stages


def _of_walk(state: LiveState) -> Iterator[Metric]:
    factor = state.timing.real_time_factor
    yield GaugeMetricFamily("walk_real_time_factor", "Simulated time over what the speed asks for.", factor)
    yield GaugeMetricFamily("walk_speed", "Simulated over real time that is asked for.", state.speed)
    yield GaugeMetricFamily("walk_running", "1 while time passes, 0 while paused.", state.running)
    yield GaugeMetricFamily("walk_fault", "1 while an error holds the robot.", bool(state.fault))
    yield CounterMetricFamily("walk_relaxed_solves", "Ticks on which a soft margin was given up.", state.counts.relaxed)
    yield CounterMetricFamily("walk_failed_solves", "Ticks on which nothing kept the robot up.", state.counts.failed)
