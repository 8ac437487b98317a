"""A run: a scenario, and how far its simulation is."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.work import Work
from walkcore import Parameters

BYTES_PER_TICK = 2000  # of a robot with a body; half as many without


@dataclass(frozen=True, slots=True)
class RunProgress:
    """The progress of a run that is under way."""

    fraction: float = 0.0
    """Fraction of its ticks that are simulated, in [0, 1]."""
    real_time_factor: float | None = None
    """Simulated over real time since its first tick; None before it is known."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Run(Work):
    """A scenario and the state of its simulation."""

    robot: str
    duration: float
    """Simulated time [s]."""
    progress: RunProgress = RunProgress()
    metrics: Mapping[str, Any] | None = None
    """Metrics in run.json; numbers that are not finite are None."""

    @property
    def expected_size(self) -> int:
        """Size that its files will about have [bytes]."""
        period = (self.source.get("parameters") or {}).get("control_period", Parameters.control_period)
        return round(self.duration / period) * BYTES_PER_TICK
