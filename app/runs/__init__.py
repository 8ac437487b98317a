"""Scripted runs: admitted, queued, simulated in processes of their own, and kept.

`runs` serves the routes. `admission` checks scenarios against the limits of the server, `store` keeps runs on the disk,
with `database` for their rows and `recovery` for what a server left half done. `queue` has them simulated one after the
other, and `run_jobs` are the jobs of its processes. `run_writer` keeps walks without simulating them: those that
were driven live, and uploaded recordings, which `upload` reads and `upload_check` checks.
"""

from app.runs.admission import RunLimits
from app.runs.run import NoRecordingError, Run, RunsUnavailableError, UnknownRunError
from app.runs.runs import Runs

__all__ = [
    "NoRecordingError",
    "Run",
    "RunLimits",
    "Runs",
    "RunsUnavailableError",
    "UnknownRunError",
]
