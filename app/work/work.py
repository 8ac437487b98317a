"""A piece of work as it is known from outside, and why one cannot be taken in or handed out."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

WorkStatus = Literal["queued", "running", "done", "failed", "cancelled"]
ENDED = ("done", "failed", "cancelled")


class UnknownWorkError(Exception):
    """There is no work of that id, or no longer."""

    def __init__(self, work_id: str, kind: str = "run") -> None:
        super().__init__(f"no {kind} {work_id[:64]!r}")


class NoFileError(Exception):
    """A run has no recording, or a sweep no such file, not yet or not at all."""


class WorkUnavailableError(Exception):
    """No work can be taken in, handed out or removed now; the message says when to try again."""

    RETRY_AFTER = 10
    """Time to wait [s]."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"{reason}; try again in {self.RETRY_AFTER} s")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Work:
    """Something that was sent to be done, and the state that it is in."""

    id: str
    source: Mapping[str, Any]
    """Scenario or sweep, as it was sent."""
    status: WorkStatus = "queued"
    reason: str = ""
    """Why it failed, or was cancelled."""
    created: float
    """Time at which it was taken in [s since 1970], as the following times."""
    started: float | None = None
    ended: float | None = None
    progress: Any
    """The progress that its job reported last."""
    size: int = 0
    """Size of its files [bytes]."""

    @property
    def name(self) -> str:
        """Name of the scenario or the sweep."""
        return self.source.get("name", "unnamed")

    @property
    def has_ended(self) -> bool:
        """Whether nothing more will change."""
        return self.status in ENDED
