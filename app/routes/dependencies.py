"""Parts of the application that routes depend on.

Coroutines where nothing blocks, since FastAPI takes a thread for each plain function.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from fastapi import Depends
from starlette.datastructures import State
from starlette.requests import HTTPConnection

from app.http.run_schemas import RunSummary
from app.http.sweep_schemas import SweepSummary
from app.live.booth import Booth
from app.live.driver_lease import DriverLease
from app.live.past import PastTicks
from app.live.runner import Runner
from app.robot_switch import RobotSwitch
from app.routes.followed_runs import FollowedRuns
from app.runs import Run, Runs
from app.sweeps.posted_sweep import PostedSweep
from app.sweeps.posted_sweeps import PostedSweeps
from app.viewer import Viewer


def _part(read: Callable[[State], Any]) -> Any:
    """Dependency on a part of the application, as `app.main.create_app` has put it there."""

    async def part(connection: HTTPConnection) -> Any:
        return read(connection.app.state)

    return Depends(part)


Lease = Annotated[DriverLease, _part(lambda state: state.lease)]
LessonFolder = Annotated[Path | None, _part(lambda state: state.lesson_folder)]
LiveRunner = Annotated[Runner, _part(lambda state: state.switch.runner)]
LiveSwitch = Annotated[RobotSwitch, _part(lambda state: state.switch)]
LiveViewer = Annotated[Viewer, _part(lambda state: state.switch.viewer)]
TheBooth = Annotated[Booth, _part(lambda state: state.booth)]
Past = Annotated[PastTicks, _part(lambda state: state.past)]
AllRuns = Annotated[Runs, _part(lambda state: state.runs)]
AllSweeps = Annotated[PostedSweeps, _part(lambda state: state.sweeps)]
RoomToFollow = Annotated[FollowedRuns[RunSummary], _part(lambda state: _with_room(state.followed))]
RoomToFollowSweeps = Annotated[FollowedRuns[SweepSummary], _part(lambda state: _with_room(state.followed_sweeps))]


def _with_room(followed: FollowedRuns[Any]) -> FollowedRuns[Any]:
    """The followed runs, if one more stream may be opened: a stream that has begun cannot be refused."""
    followed.check_room()
    return followed


def _run(run_id: str, runs: AllRuns) -> Run:
    """The run of a path, read from the disk: not a coroutine, which would hold up the event loop."""
    return runs.get(run_id)


def _sweep(sweep_id: str, sweeps: AllSweeps) -> PostedSweep:
    """The sweep of a path."""
    return sweeps.get(sweep_id)


KnownRun = Annotated[Run, Depends(_run)]
KnownSweep = Annotated[PostedSweep, Depends(_sweep)]
