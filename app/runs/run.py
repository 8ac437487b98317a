"""A run as it is known from outside, and why one cannot be taken in or handed out."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from walkcore import Parameters

RunStatus = Literal["queued", "running", "done", "failed", "cancelled"]
BYTES_PER_TICK = 2000  # of a robot with a body; half as many without
ENDED = ("done", "failed", "cancelled")


class UnknownRunError(Exception):
    """There is no run of that id, or no longer."""

    def __init__(self, run_id: str, kind: str = "run") -> None:
        super().__init__(f"no {kind} {run_id[:64]!r}")


class NoRecordingError(Exception):
    """A run has no recording, not yet or not at all."""


class RunsUnavailableError(Exception):
    """No run can be taken in, handed out or removed now; the message says when to try again."""

    RETRY_AFTER = 10
    """Time to wait [s]."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"{reason}; try again in {self.RETRY_AFTER} s")


@dataclass(frozen=True, slots=True)
class RunProgress:
    """The progress of a run that is under way."""

    fraction: float = 0.0
    """Fraction of its ticks that are simulated, in [0, 1]."""
    real_time_factor: float | None = None
    """Simulated over real time since its first tick; None before it is known."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A scenario and the state of its simulation."""

    id: str
    scenario: Mapping[str, Any]
    """The scenario as it was sent."""
    robot: str
    duration: float
    """Simulated time [s]."""
    status: RunStatus
    reason: str
    """Why it failed, or was cancelled."""
    created: float
    """Time at which it was taken in [s since 1970], as the following times."""
    started: float | None
    ended: float | None
    progress: RunProgress
    size: int
    """Size of its files [bytes]."""
    metrics: Mapping[str, Any] | None
    """Metrics in run.json; numbers that are not finite are None."""

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return self.scenario.get("name", "unnamed")

    @property
    def expected_size(self) -> int:
        """Size that its files will about have [bytes]."""
        period = (self.scenario.get("parameters") or {}).get("control_period", Parameters.control_period)
        return round(self.duration / period) * BYTES_PER_TICK

    @property
    def has_ended(self) -> bool:
        """Whether nothing more will change."""
        return self.status in ENDED
