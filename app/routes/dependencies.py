"""Parts of the application that routes depend on.

Coroutines where nothing blocks, since FastAPI takes a thread for each plain function.
"""

from pathlib import Path
from typing import Annotated

from fastapi import Depends
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


async def _runner(connection: HTTPConnection) -> Runner:
    return connection.app.state.switch.runner


async def _viewer(connection: HTTPConnection) -> Viewer:
    return connection.app.state.switch.viewer


async def _switch(connection: HTTPConnection) -> RobotSwitch:
    return connection.app.state.switch


async def _runs(connection: HTTPConnection) -> Runs:
    return connection.app.state.runs


async def _lease(connection: HTTPConnection) -> DriverLease:
    return connection.app.state.lease


async def _booth(connection: HTTPConnection) -> Booth:
    return connection.app.state.booth


async def _lesson_folder(connection: HTTPConnection) -> Path | None:
    return connection.app.state.lesson_folder


async def _past(connection: HTTPConnection) -> PastTicks:
    return connection.app.state.past


Lease = Annotated[DriverLease, Depends(_lease)]
LessonFolder = Annotated[Path | None, Depends(_lesson_folder)]
LiveRunner = Annotated[Runner, Depends(_runner)]
LiveSwitch = Annotated[RobotSwitch, Depends(_switch)]
LiveViewer = Annotated[Viewer, Depends(_viewer)]
TheBooth = Annotated[Booth, Depends(_booth)]
Past = Annotated[PastTicks, Depends(_past)]
AllRuns = Annotated[Runs, Depends(_runs)]


def _run(run_id: str, runs: AllRuns) -> Run:
    """The run of a path, read from the disk: not a coroutine, which would hold up the event loop."""
    return runs.get(run_id)


KnownRun = Annotated[Run, Depends(_run)]


async def _room_to_follow(connection: HTTPConnection) -> FollowedRuns[RunSummary]:
    """The followed runs, if one more stream may be opened: a stream that has begun cannot be refused."""
    followed: FollowedRuns[RunSummary] = connection.app.state.followed
    followed.check_room()
    return followed


RoomToFollow = Annotated[FollowedRuns[RunSummary], Depends(_room_to_follow)]


async def _sweeps(connection: HTTPConnection) -> PostedSweeps:
    return connection.app.state.sweeps


AllSweeps = Annotated[PostedSweeps, Depends(_sweeps)]


def _sweep(sweep_id: str, sweeps: AllSweeps) -> PostedSweep:
    """The sweep of a path."""
    return sweeps.get(sweep_id)


KnownSweep = Annotated[PostedSweep, Depends(_sweep)]


async def _room_to_follow_sweeps(connection: HTTPConnection) -> FollowedRuns[SweepSummary]:
    followed: FollowedRuns[SweepSummary] = connection.app.state.followed_sweeps
    followed.check_room()
    return followed


RoomToFollowSweeps = Annotated[FollowedRuns[SweepSummary], Depends(_room_to_follow_sweeps)]
