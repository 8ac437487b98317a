"""The server: wires runner, viewer, routes and page together, and stops them."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version

from fastapi import FastAPI

from app.http import errors, page
from app.http.body_limit import BodyLimitMiddleware
from app.http.metrics import LiveMetrics
from app.http.origin import SameOriginMiddleware
from app.http.proxy import viewer_router
from app.http.token import Token, TokenMiddleware
from app.live.runner import Runner
from app.routes import layers, live, runs, service, sockets
from app.routes.signin import signin_router
from app.runs import Limits, Runs
from app.settings import Settings
from app.viewer import LIGHT, Look, Viewer
from walkcore import Parameters, load_robot

# The paper takes 0.8 s to start; a hand on a joystick waits for the step.
LIVE = Parameters(initial_double_support_duration=0.3, dynamic_filter=True)


def create_app(settings: Settings) -> FastAPI:
    """The application; the robot stands ready, and walks while the application runs.

    Raises:
        WalkError: if there is no such robot.
        OSError: if the folder for runs cannot be written to.
    """
    runner = Runner(load_robot(settings.robot), LIVE)  # its process gets ready while the viewer does
    viewer = Viewer(runner, LIGHT if settings.scene == "light" else Look())

    runner.wait()
    scripted = _runs(settings)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        runner.start()
        viewer.start()
        scripted.start()
        try:
            yield
        finally:
            scripted.stop()
            viewer.stop()
            runner.stop()

    app = FastAPI(title="walk", version=version("walk"), description=__doc__ or "", lifespan=lifespan)
    app.state.runner = runner
    app.state.viewer = viewer
    app.state.runs = scripted
    app.state.nb_streams = 0
    app.state.metrics = LiveMetrics(
        runner, lambda: app.state.nb_streams, lambda: (viewer.cost.count, viewer.cost.seconds)
    )
    errors.install(app)
    app.add_middleware(SameOriginMiddleware)
    if settings.walk_token.get_secret_value():
        token = Token(settings.walk_token.get_secret_value())
        app.add_middleware(TokenMiddleware, token=token)
        app.include_router(signin_router(token, page.STATIC / "signin.html"))
    app.add_middleware(BodyLimitMiddleware)
    for routes in (
        live.router,
        layers.router,
        sockets.router,
        runs.router,
        service.router,
        service.metrics_router,
        viewer_router(lambda: viewer.port),
    ):
        app.include_router(routes)
    page.install(app)
    return app


def _runs(settings: Settings) -> Runs:
    limits = Limits(settings.runs_max_duration, settings.runs_max_ticks, settings.runs_max_events)
    return Runs(
        settings.walk_data,
        nb_workers=settings.runs_workers,
        nb_queued=settings.runs_queued,
        nb_kept=settings.runs_kept,
        bytes_kept=settings.runs_bytes,
        limits=limits,
    )
