"""Work that clients send to the server, to be done behind the live walk: runs of scenarios, and sweeps.

`work` has a piece of work and its state, `store` keeps all work of one kind, and `queue` has it done by processes, for
the routes, which list it and cancel it.
"""

from app.work.queue import WorkQueue
from app.work.store import WorkStore
from app.work.work import ENDED, NoRecordingError, RunsUnavailableError, UnknownRunError, Work, WorkStatus

__all__ = [
    "ENDED",
    "NoRecordingError",
    "RunsUnavailableError",
    "UnknownRunError",
    "Work",
    "WorkQueue",
    "WorkStatus",
    "WorkStore",
]
