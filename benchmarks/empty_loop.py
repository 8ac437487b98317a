"""A loop with the rate and the precedence of the control loop that does nothing: how late it is, the machine is."""

import multiprocessing
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from multiprocessing.sharedctypes import SynchronizedArray
from typing import Any

from app.live.process import request_real_time_priority
from app.live.tick_scheduler import LATENESS_EDGES, TickScheduler

PERIOD = 0.005  # [s]


class EmptyLoop:
    """Counts of a loop that runs in a process of its own."""

    def __init__(self, counts: "SynchronizedArray[int]") -> None:
        """Read the counts from shared memory."""
        self._counts = counts

    @property
    def late(self) -> Mapping[str, int]:
        """Number of turns that started later than so many ms."""
        counts = list(self._counts)
        return {f"{1e3 * edge:g}": sum(counts[k + 1 :]) for k, edge in enumerate(LATENESS_EDGES)}


@contextmanager
def empty_loop() -> Iterator[EmptyLoop]:
    """Run the loop until the block ends."""
    context = multiprocessing.get_context("spawn")
    counts: Any = context.Array("q", len(LATENESS_EDGES) + 1)
    process = context.Process(target=_run, args=(counts,), daemon=True)
    process.start()
    try:
        yield EmptyLoop(counts)
    finally:
        process.terminate()
        process.join()


def _run(counts: "SynchronizedArray[int]") -> None:
    request_real_time_priority()
    scheduler = TickScheduler(PERIOD)
    while True:
        time.sleep(max(scheduler.time_left, 0.0))
        scheduler.start_tick()
        counts[:] = scheduler.timing.lateness
