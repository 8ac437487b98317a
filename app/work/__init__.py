"""Work that clients send to the server, to be done behind the live walk: runs of scenarios, and sweeps.

`work` has a piece of work and its state, `store` keeps all work of one kind, `queue` has it done by processes, for the
routes, which list it and cancel it, and `awaited_jobs` does the jobs that a request waits for.
"""

from app.work.awaited_jobs import AwaitedJobs
from app.work.queue import WorkQueue
from app.work.store import WorkStore
from app.work.work import ENDED, NoFileError, UnknownWorkError, Work, WorkStatus, WorkUnavailableError

__all__ = [
    "ENDED",
    "AwaitedJobs",
    "NoFileError",
    "WorkUnavailableError",
    "UnknownWorkError",
    "Work",
    "WorkQueue",
    "WorkStatus",
    "WorkStore",
]
