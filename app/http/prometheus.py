"""Metrics of the live robot for Prometheus."""

from collections.abc import Callable, Iterator
from contextlib import suppress

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
from app.live.tick_scheduler import LATENESS_EDGES, TickTiming

SERVER = psutil.Process()


class LiveMetrics(Collector):
    """Metrics of the latest state whenever they are collected."""

    def __init__(
        self, runner: Callable[[], Runner], nb_clients: Callable[[], int], frames: Callable[[], tuple[int, float]]
    ) -> None:
        """Collect from these.

        Args:
            runner: of the robot that walks at the moment.
            nb_clients: number of open streams.
            frames: number of frames that were drawn, and the processor time of all [s].
        """
        self._runner, self._nb_clients, self._frames = runner, nb_clients, frames
        self._registry = CollectorRegistry()
        self._registry.register(self)

    def text(self) -> bytes:
        """All metrics in Prometheus's text format."""
        return generate_latest(self._registry)

    def collect(self) -> Iterator[Metric]:
        """All metrics at this moment."""
        runner = self._runner()
        state = runner.latest
        yield from _tick_metrics(state.timing)
        yield from _walk_metrics(state)
        yield GaugeMetricFamily("walk_clients", "Open streams of the live snapshot.", self._nb_clients())
        count, seconds = self._frames()
        yield SummaryMetricFamily(
            "walk_frame_seconds", "Processor time of a drawn frame, for all browsers.", count, seconds
        )
        yield from _process_metrics(runner)

    def describe(self) -> list[Metric]:
        """No metrics before the first collection: the robot may not stand yet."""
        return []


def memory_of(runner: Runner) -> dict[str, float]:
    """Resident memory of the server and of its control process, while that lives [bytes]."""
    return _by_process(runner, lambda process: process.memory_info().rss)


def _process_metrics(runner: Runner) -> Iterator[Metric]:
    memory = GaugeMetricFamily("walk_memory_bytes", "Resident memory.", labels=["process"])
    for name, size in memory_of(runner).items():
        memory.add_metric([name], size)
    yield memory
    time = CounterMetricFamily("walk_cpu_seconds", "Processor time.", labels=["process"])
    for name, seconds in _by_process(runner, _cpu_seconds).items():
        time.add_metric([name], seconds)
    yield time


def _cpu_seconds(process: psutil.Process) -> float:
    times = process.cpu_times()
    return times.user + times.system


def _by_process(runner: Runner, measure: Callable[[psutil.Process], float]) -> dict[str, float]:
    """A measure of the server's process and of its control process, while that lives."""
    found = {"server": measure(SERVER)}
    with suppress(psutil.NoSuchProcess):
        found["control"] = measure(psutil.Process(runner.process_id))
    return found


def _tick_metrics(timing: TickTiming) -> Iterator[Metric]:
    yield CounterMetricFamily("walk_ticks", "Ticks taken on schedule.", timing.ticks)
    yield CounterMetricFamily("walk_tick_misses", "Ticks that started more than a period late.", timing.misses)
    counts, buckets = 0, list[tuple[str, float]]()
    for edge, count in zip((*map(str, LATENESS_EDGES), "+Inf"), timing.lateness, strict=True):
        counts += count
        buckets.append((edge, counts))
    lateness = HistogramMetricFamily("walk_tick_lateness_seconds", "Time from when a tick was due to when it started.")
    lateness.add_metric([], buckets, timing.lateness_sum)
    yield lateness
    yield GaugeMetricFamily("walk_tick_lateness_max_seconds", "Largest lateness since the start.", timing.lateness_max)
    yield GaugeMetricFamily("walk_tick_seconds", "Smoothed mean of a tick's computation.", timing.tick_ms / 1e3)
    yield GaugeMetricFamily(
        "walk_tick_max_seconds", "Largest computation in the last second.", timing.tick_ms_max / 1e3
    )
    stages = GaugeMetricFamily("walk_stage_seconds", "Smoothed mean of a stage of a tick.", labels=["stage"])
    for stage, duration in timing.stages.items():
        stages.add_metric([stage], duration / 1e3)
    yield stages


def _walk_metrics(state: LiveState) -> Iterator[Metric]:
    factor = state.timing.real_time_factor
    yield GaugeMetricFamily("walk_real_time_factor", "Simulated time over real time times the requested speed.", factor)
    yield GaugeMetricFamily("walk_speed", "Requested ratio of simulated to real time.", state.speed)
    yield GaugeMetricFamily("walk_running", "1 while time passes, 0 while paused.", state.running)
    yield GaugeMetricFamily("walk_fault", "1 while an error holds the robot.", bool(state.fault))
    yield CounterMetricFamily("walk_relaxed_solves", "Ticks with another plan than the paper's.", state.counts.relaxed)
    yield CounterMetricFamily("walk_failed_solves", "Ticks on which nothing kept the robot up.", state.counts.failed)
