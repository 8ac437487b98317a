"""A run as it is known from outside."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Status = Literal["queued", "running", "done", "failed", "cancelled"]
ENDED = ("done", "failed", "cancelled")


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a run that is under way has come."""

    fraction: float = 0.0
    """Of its ticks, in [0, 1]."""
    real_time_factor: float | None = None
    """Simulated over real time since its first tick; None before it is known."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A scenario and what became of it."""

    id: str
    scenario: Mapping[str, Any]
    """As it was sent."""
    robot: str
    duration: float
    """[s]."""
    status: Status
    reason: str
    """Why it failed, or was cancelled."""
    created: float
    """[s] since 1970, as the following."""
    started: float | None
    ended: float | None
    progress: Progress
    size: int
    """Of its files [bytes]."""
    metrics: Mapping[str, Any] | None
    """As run.json has them; numbers that are not finite are None."""

    @property
    def name(self) -> str:
        """Of the scenario."""
        return self.scenario.get("name", "unnamed")

    @property
    def has_ended(self) -> bool:
        """Whether nothing more will change."""
        return self.status in ENDED
