"""Scripted runs: taken in, queued, simulated in processes of their own, and kept."""

from app.runs.errors import NoRecordingError, RunsUnavailableError, UnknownRunError
from app.runs.limits import Limits
from app.runs.run import Run
from app.runs.service import Runs

__all__ = [
    "Limits",
    "NoRecordingError",
    "Run",
    "Runs",
    "RunsUnavailableError",
    "UnknownRunError",
]
