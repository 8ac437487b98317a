"""Runs and sweeps that streams of events follow: each is looked up once for all of its streams."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from app.http.run_schemas import WorkSummary
from app.work import ENDED, UnknownWorkError, WorkUnavailableError

PERIOD = 0.2  # [s] between looks
MAX_STREAMS = 200  # open at once

Summary = TypeVar("Summary", bound=WorkSummary)


@dataclass(slots=True, eq=False)
class _Followed(Generic[Summary]):
    """A run with streams, and what was last known of it."""

    summary: Summary
    changed: asyncio.Event = field(default_factory=asyncio.Event)
    """Set, and replaced, when there is something new, or when the run is gone."""
    nb_streams: int = 0
    is_gone: bool = False


class FollowedRuns(Generic[Summary]):
    """Reader of the followed runs, for any number of streams. Belongs to the event loop."""

    def __init__(self, look_up: Callable[[str], Summary]) -> None:
        """Follow none yet.

        Args:
            look_up: gives the present summary of an id; raises `UnknownWorkError` if there is none.
        """
        self._summary = look_up
        self._followed: dict[str, _Followed[Summary]] = {}
        self._reader: asyncio.Task[None] | None = None
        self._nb_streams = 0

    def check_room(self) -> None:
        """Refuse one stream more than there may be.

        Raises:
            WorkUnavailableError: if there are so many.
        """
        if self._nb_streams >= MAX_STREAMS:
            raise WorkUnavailableError(f"{MAX_STREAMS} streams of events are open")

    async def summaries(self, first: Summary) -> AsyncIterator[Summary]:
        """The state of a run, now and at each change, until it has ended or is gone.

        Args:
            first: state of the run as it was found.
        """
        run_id = first.id
        followed = self._followed.setdefault(run_id, _Followed(first))
        followed.nb_streams += 1
        self._nb_streams += 1
        try:
            while True:
                changed, summary = followed.changed, followed.summary
                yield summary
                if summary.status in ENDED or followed.is_gone:
                    return
                if self._reader is None or self._reader.done():
                    self._reader = asyncio.create_task(self._read())
                await changed.wait()
        finally:
            self._nb_streams -= 1
            followed.nb_streams -= 1
            if not followed.nb_streams:
                self._followed.pop(run_id, None)

    async def _read(self) -> None:
        """Look up every followed run, as long as there is one."""
        while self._followed:
            await asyncio.sleep(PERIOD)
            found = await asyncio.to_thread(self._look_up, list(self._followed))
            for run_id, followed in list(self._followed.items()):
                if run_id in found and (summary := found[run_id]) != followed.summary:
                    followed.is_gone, followed.summary = summary is None, summary or followed.summary
                    followed.changed.set()
                    followed.changed = asyncio.Event()

    def _look_up(self, run_ids: list[str]) -> dict[str, Summary | None]:
        found: dict[str, Summary | None] = dict.fromkeys(run_ids)
        for run_id in run_ids:
            with suppress(UnknownWorkError):
                found[run_id] = self._summary(run_id)
        return found
