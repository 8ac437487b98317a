"""Earlier ticks of the live walk, read from the control process by segments, and kept a while.

Looking costs the control process no tick: it hands out bytes that it has packed already.
"""

import asyncio
from collections import OrderedDict
from collections.abc import Callable, Sequence

from app.live.runner import Runner
from app.live.session_log import Segment
from walkcore import Parameters, Snapshot
from walkcore.plant.world import World

MAX_SEGMENTS = 400  # about 40 MB: two browsers' eight seconds of plots at 200 Hz, and room


class PastTicks:
    """Reader of earlier ticks, for any number of browsers. Belongs to the server's event loop."""

    def __init__(self, runner: Callable[[], Runner]) -> None:
        """Begin without any.

        Args:
            runner: gives the robot that walks now.
        """
        self._runner = runner
        self._walk: tuple[Runner, int] | None = None
        self._segments = OrderedDict[int, Segment]()
        """Segments by their first tick, the one that was used last at the end."""

    async def at(self, tick: int) -> tuple[Snapshot, Parameters, World]:
        """A tick of the present walk, or the nearest one of those that are kept.

        Raises:
            WalkError: if none is kept.
            NoResponseError: if the control process does not respond at the moment.
        """
        segment = await self._segment(tick)
        first, nb_ticks = segment.first_tick, len(segment.ticks)
        index = min(max(tick - first, 0), nb_ticks - 1)
        return segment.ticks[index].snapshot, segment.ticks[index].parameters, segment.world

    async def before(self, tick: int, nb_ticks: int, every: int) -> Sequence[Snapshot]:
        """Some snapshots of the time before a tick, with equal gaps; fewer where fewer are kept.

        Args:
            tick: the last.
            nb_ticks: from the first to the last.
            every: gap in ticks.
        """
        found: list[Snapshot] = []
        for at in range(max(tick - nb_ticks, 0), tick + 1, every):
            snapshot, _, _ = await self.at(at)
            if not found or snapshot.tick > found[-1].tick:
                found.append(snapshot)
        return found

    async def _segment(self, tick: int) -> Segment:
        runner = self._runner()
        walk = runner, runner.latest.walk
        if walk != self._walk:
            self._walk = walk
            self._segments.clear()
        for first, segment in reversed(self._segments.items()):
            if first <= tick < first + len(segment.ticks):
                self._segments.move_to_end(first)
                return segment
        segment = (await asyncio.wrap_future(runner.past(tick))).unpacked()
        if (self._runner(), runner.latest.walk) == walk:
            self._segments[segment.first_tick] = segment
            if len(self._segments) > MAX_SEGMENTS:
                self._segments.popitem(last=False)
        return segment
