"""The server: wires runner, viewer, runs, routes and page together, listens on one port, and stops them."""

import os
import socket
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from importlib.metadata import version

import uvicorn
from fastapi import FastAPI
from fastapi_offline import FastAPIOffline

from app.http import page, refusals
from app.http.connections import (
    EndingMiddleware,
    QuietWebsocket,
    allow_connections,
    limited_protocol,
    listening_socket,
)
from app.http.guards import BodyLimitMiddleware, SameOriginMiddleware
from app.http.headers import SecurityHeadersMiddleware
from app.http.hosts import KnownHostMiddleware, KnownHosts
from app.http.prometheus import LiveMetrics
from app.http.run_schemas import RunSummary
from app.http.scene_proxy import scene_router
from app.http.seats import Seats
from app.http.sweep_schemas import SweepSummary
from app.http.token import HEALTH, TokenMiddleware, Tokens, signin_router
from app.http.turns import TurnMiddleware
from app.http.watchdog import Watchdog
from app.live.booth import Booth
from app.live.driver_lease import DriverLease
from app.live.past import PastTicks
from app.robot_choices import RobotChoices
from app.robot_switch import RobotSwitch
from app.routes import (
    booth,
    driver_lease,
    lessons,
    live_robot,
    scripted_runs,
    service,
    sockets,
    sweeps,
    timeline,
    uploads,
)
from app.routes.followed_runs import FollowedRuns
from app.runs import RunLimits, Runs
from app.settings import Settings
from app.sweeps.posted_sweeps import PostedSweeps, SweepLimits
from app.viewer import LIGHT, RenderQuality
from walkcore import load_robot

MAX_MESSAGE = 64 * 1024  # bytes of a websocket message
SWITCH_INTERVAL = 0.001  # [s] after which Python takes the processor from a long response for a frame that is due
NICENESS = -5  # of 19 to -20
SHUTDOWN_TIMEOUT = 1  # [s] for open connections when the server stops


def serve(settings: Settings) -> None:
    """Serve until interrupted; exits with 1 where the address is not available."""
    sys.setswitchinterval(SWITCH_INTERVAL)
    request_priority()
    allow_connections()
    listening = _listen(settings)
    config = uvicorn.Config(
        create_app(settings),
        log_level="warning",
        timeout_graceful_shutdown=SHUTDOWN_TIMEOUT,
        http=limited_protocol(),
        ws=QuietWebsocket,
        ws_max_size=MAX_MESSAGE,
        ws_per_message_deflate=False,
    )
    print(f"walk: open {_address(settings.host, listening)}", flush=True)
    watchdog = Watchdog(f"{_address(settings.host, listening)}api/v1/health", settings.exit_unhealthy_after)
    if settings.exit_unhealthy_after:
        watchdog.start()
    try:
        uvicorn.Server(config).run(sockets=[listening])
    except KeyboardInterrupt:
        return  # uvicorn has shut down and passes the signal on
    finally:
        watchdog.stop()


def request_priority() -> None:
    """Go before other processes of the machine, where the system permits it and nobody chose a niceness.

    On a busy machine the page's pictures and controls would wait for their turn: clients that flood the server often
    run beside it, and a browser's renderer takes such a priority itself. Jobs do not inherit it.
    """
    if os.getpriority(os.PRIO_PROCESS, 0) == 0:
        with suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, 0, NICENESS)


def create_app(settings: Settings) -> FastAPI:
    """The application; the robot stands ready, and walks while the application runs.

    Raises:
        WalkError: if there is no such robot.
        OSError: if the folder for runs cannot be written to.
    """
    robot, lease = load_robot(settings.robot), DriverLease()
    choices = RobotChoices(robot, settings.walk_robots)
    quality = LIGHT if settings.scene == "light" else RenderQuality()
    switch = RobotSwitch(robot, choices, settings.walk_plant, quality, lease)
    runs = _runs(settings, choices)
    posted_sweeps = PostedSweeps(
        runs.folder / "sweeps",
        SweepLimits(settings.sweeps_max_ticks, settings.sweeps_queued, settings.sweeps_kept),
        choices,
    )
    streams = sockets.SnapshotStreams(lambda: switch.runner.look())

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        switch.start()
        runs.start()
        posted_sweeps.start()
        try:
            yield
        finally:
            posted_sweeps.stop()
            runs.stop()
            switch.stop()

    app = FastAPIOffline(
        title="walk",
        version=version("walk"),
        description=__doc__ or "",
        lifespan=lifespan,
        redoc_url=None,
        favicon_url="/static/icon.svg",
    )
    app.state.switch, app.state.runs, app.state.streams, app.state.lease = switch, runs, streams, lease
    app.state.booth = Booth(lambda: switch.runner, lease)
    app.state.lesson_folder = settings.walk_lessons
    app.state.past = PastTicks(lambda: switch.runner)
    app.state.followed = FollowedRuns(lambda run_id: RunSummary.model_validate(runs.get(run_id)))
    app.state.sweeps = posted_sweeps
    app.state.followed_sweeps = FollowedRuns(lambda sweep: SweepSummary.model_validate(posted_sweeps.get(sweep)))
    app.state.metrics = LiveMetrics(
        lambda: switch.runner,
        lambda: streams.nb_clients,
        lambda: (switch.viewer.cost.count, switch.viewer.cost.seconds),
    )
    refusals.install(app)
    app.add_middleware(SameOriginMiddleware)
    operator_token, view_token = settings.walk_token.get_secret_value(), settings.walk_view_token.get_secret_value()
    seats = Seats(settings.spectators, has_roles=bool(operator_token))
    if operator_token:
        tokens = Tokens(operator_token, view_token)
        app.add_middleware(TokenMiddleware, tokens=tokens)
        app.include_router(signin_router(tokens, page.STATIC / "signin.html"))
    app.add_middleware(BodyLimitMiddleware)
    app.add_middleware(SecurityHeadersMiddleware)
    app.add_middleware(KnownHostMiddleware, hosts=KnownHosts(settings.host, settings.walk_hosts.split(",")))
    app.add_middleware(TurnMiddleware, urgent=frozenset({HEALTH}))
    app.add_middleware(EndingMiddleware)
    for routes in (
        live_robot,
        timeline,
        driver_lease,
        booth,
        sockets,
        uploads,
        scripted_runs,
        lessons,
        sweeps,
        service,
    ):
        app.include_router(routes.router)
    app.include_router(service.metrics_router)
    app.include_router(scene_router(lambda: switch.viewer, seats))
    page.install(app, seats)
    return app


def _runs(settings: Settings, choices: RobotChoices) -> Runs:
    limits = RunLimits(settings.runs_max_duration, settings.runs_max_ticks, settings.runs_max_events)
    return Runs(
        settings.walk_data,
        nb_workers=settings.runs_workers,
        nb_queued=settings.runs_queued,
        nb_kept=settings.runs_kept,
        bytes_kept=settings.runs_bytes,
        limits=limits,
        choices=choices,
        upload_bytes=settings.uploads_max_bytes,
    )


def _listen(settings: Settings) -> socket.socket:
    try:
        return listening_socket(settings.host, settings.port)
    except OSError as error:
        sys.exit(f"walk: cannot listen on {settings.host} port {settings.port}: {error.strerror or error}")


def _address(host: str, listening: socket.socket) -> str:
    port = listening.getsockname()[1]
    host = {"0.0.0.0": "localhost", "::": "localhost"}.get(host, host)
    return f"http://[{host}]:{port}/" if ":" in host else f"http://{host}:{port}/"
