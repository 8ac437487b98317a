"""What the routes find in the application; by coroutines, since FastAPI takes a thread for each plain function."""

from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection

from app.live.runner import Runner
from app.viewer import Viewer


async def _runner(connection: HTTPConnection) -> Runner:
    return connection.app.state.runner


LiveRunner = Annotated[Runner, Depends(_runner)]


async def _viewer(connection: HTTPConnection) -> Viewer:
    return connection.app.state.viewer


LiveViewer = Annotated[Viewer, Depends(_viewer)]
