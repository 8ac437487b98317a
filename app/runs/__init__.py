"""Scripted runs: admitted, queued, simulated in processes of their own, and kept.

`runs` serves the routes. `admission` checks scenarios against the limits of the server, `store` keeps runs on the disk,
with `database` for their rows and `recovery` for what a server left half done. `run_jobs` are the jobs of the
processes, and so are `upload`, which makes a run of a recording that was uploaded and has `upload_check` check it, and
`restore`, which gives a tick of a run back to the live robot.
"""

from app.runs.admission import RunLimits
from app.runs.run import Run
from app.runs.runs import Runs

__all__ = ["Run", "RunLimits", "Runs"]
