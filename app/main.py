"""The server: wires runner, viewer, routes and page together, and stops them."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version

from fastapi import FastAPI

from app import errors, page
from app.metrics import LiveMetrics
from app.origin import SameOriginMiddleware
from app.proxy import viewer_router
from app.routes import live, service, sockets
from app.runner import Runner
from app.settings import Settings
from app.viewer import LIGHT, Look, Viewer
from walkcore import Parameters, load_robot

# The paper takes 0.8 s to start; a hand on a joystick waits for the step.
LIVE = Parameters(initial_double_support_duration=0.3, dynamic_filter=True)


def create_app(settings: Settings) -> FastAPI:
    """The application; the robot stands ready, and walks while the application runs.

    Raises:
        WalkError: if there is no such robot.
    """
    runner = Runner(load_robot(settings.robot), LIVE)  # its process gets ready while the viewer does
    viewer = Viewer(runner, LIGHT if settings.scene == "light" else Look())

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        runner.start()
        viewer.start()
        try:
            yield
        finally:
            viewer.stop()
            runner.stop()

    app = FastAPI(title="walk", version=version("walk"), description=__doc__ or "", lifespan=lifespan)
    app.state.runner = runner
    app.state.nb_streams = 0
    app.state.metrics = LiveMetrics(runner, lambda: app.state.nb_streams)
    errors.install(app)
    app.add_middleware(SameOriginMiddleware)
    for routes in (
        live.router,
        sockets.router,
        service.router,
        service.metrics_router,
        viewer_router(lambda: viewer.port),
    ):
        app.include_router(routes)
    page.install(app)
    return app
