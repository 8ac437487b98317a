"""The server itself, and the robots and scenarios that ship with it."""

import time
from functools import cache
from importlib.metadata import version
from typing import Any

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST

from app.http.live_json import late_json
from app.http.prometheus import SERVER, memory_of
from app.http.schemas import Health, RobotBody, Session, robot_body
from app.http.token import role_of
from app.live.live_state import LiveState
from app.routes.dependencies import AllRuns, LiveRunner, LiveSwitch
from walkcore import load_scenario, scenario_names

VERSION = version("walk")  # looking it up takes longer than all the rest of the health
SLOW = 0.95  # real-time factor below which a walk is degraded

router = APIRouter(prefix="/api/v1", tags=["service"])
metrics_router = APIRouter(include_in_schema=False)


@router.get("/health", responses={503: {"model": Health, "description": "The control process does not respond."}})
async def health(request: Request, response: Response, runner: LiveRunner, runs: AllRuns) -> Health:
    """Whether the walk keeps up with real time, what it costs, and whether runs can be kept.

    503 while the control process does not respond.
    """
    state, trouble = runner.latest, runner.trouble
    reason = trouble or "; ".join(filter(None, (_trouble(state), runs.problem)))
    if trouble:
        response.status_code = 503
    return Health(
        status="unhealthy" if trouble else "degraded" if reason else "ok",
        reason=reason,
        version=VERSION,
        robot=runner.robot.name,
        tick_rate=1.0 / runner.parameters.control_period,
        speed=state.speed,
        real_time_factor=state.timing.real_time_factor,
        tick_ms=state.timing.tick_ms,
        tick_ms_max=state.timing.tick_ms_max,
        misses=state.timing.misses,
        late=late_json(state.timing),
        control_process=runner.process_id,
        memory_mb=sum(memory_of(runner).values()) / 1e6,
        uptime=time.time() - SERVER.create_time(),
        clients=request.app.state.streams.nb_clients,
        runs=runs.problem or runs.notice,
    )


@router.get("/session")
async def session(request: Request) -> Session:
    """The role of the client: an operator may do everything, a viewer only look."""
    return Session(role=role_of(request))


@metrics_router.get("/metrics")
async def metrics(request: Request) -> Response:
    """The same measures and more for Prometheus."""
    return Response(request.app.state.metrics.text(), media_type=CONTENT_TYPE_LATEST)


@router.get("/robots")
def robots(switch: LiveSwitch) -> list[RobotBody]:
    """The robots that may walk here, the one that does first, with the limits of references and pushes."""
    walking = switch.runner.robot
    robots = [walking, *(robot for robot in switch.choices.all() if robot.name != walking.name)]
    return [robot_body(robot) for robot in robots]


@router.get("/scenarios")
async def scenarios() -> list[dict[str, Any]]:
    """The scenarios that ship, as `walk run` takes them."""
    return _scenarios()


@cache
def _scenarios() -> list[dict[str, Any]]:
    return [dict(load_scenario(name).source) for name in scenario_names()]


def _trouble(state: LiveState) -> str:
    """Why the server is degraded, or empty; a robot that has fallen does not degrade it."""
    if state.fault:
        return state.fault
    if state.running and state.timing.real_time_factor < SLOW:
        requested = "real time" if state.speed == 1.0 else f"the requested speed, {state.speed:g} times real time"
        return f"simulated time runs at {state.timing.real_time_factor:.2f} of {requested}"
    return ""
