"""The robot that walks on the page: its state, its parameters, commands, and what is drawn of it."""

import asyncio
from datetime import UTC, datetime
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from pydantic import StrictBool

from app.http.live_json import live_json, preview_json
from app.http.run_schemas import RunBody, address
from app.http.schemas import (
    ErrorBody,
    LiveRobotBody,
    PushBody,
    RandomPushesBody,
    ReferenceBody,
    RobotBody,
    RobotChoice,
    SaveBody,
    SpeedBody,
    StepBody,
    robot_body,
)
from app.routes.dependencies import AllRuns, Lease, LiveRunner, LiveSwitch, LiveViewer
from app.viewer.scene.layers import DEFAULT_LAYERS

REFUSALS = {422: {"model": ErrorBody}, 503: {"model": ErrorBody, "description": "The control process is gone."}}

Client = Annotated[str | None, Query(max_length=64, description="Name of the browser's controls.")]

router = APIRouter(prefix="/api/v1/live", tags=["live"], responses={**REFUSALS})


@router.get("")
async def live(runner: LiveRunner) -> dict[str, Any]:
    """The latest snapshot: the columns of a recording, `q`, the plan, timing, and who drives."""
    return live_json(runner.look())


@router.get("/robot")
async def robot(switch: LiveSwitch) -> LiveRobotBody:
    """The robot that walks."""
    walking = robot_body(switch.runner.robot).model_dump()
    return LiveRobotBody(**walking, height=switch.viewer.scene.height)


@router.get("/robot/defaults")
async def first_robot(switch: LiveSwitch) -> RobotBody:
    """The robot that the server started with."""
    return robot_body(switch.first)


@router.put("/robot")
async def switch_robot(body: RobotChoice, switch: LiveSwitch) -> LiveRobotBody:
    """Let another robot walk, for all browsers; responds once it stands, which takes some seconds.

    It begins at rest with its own parameters. The walk of the one before can still be saved, as that before a reset. A
    robot that cannot stand or be drawn is refused, and the one that walks goes on; so it does while another switch is
    under way, with 503.
    """
    await asyncio.to_thread(switch.switch, body.robot)
    return await robot(switch)


@router.put("/reference", responses={409: {"model": ErrorBody, "description": "A browser drives alone."}})
async def reference(body: ReferenceBody, runner: LiveRunner, lease: Lease) -> ReferenceBody:
    """Request a velocity from the next tick on, until there is another request; zero is taken whoever drives."""
    if body != ReferenceBody():
        lease.check("")
    runner.drive(body.to_reference(), "rest")
    return body


@router.get("/parameters")
async def parameters(runner: LiveRunner) -> dict[str, Any]:
    """The parameters in force."""
    return runner.parameters.to_mapping()


@router.get("/parameters/defaults")
async def defaults(runner: LiveRunner) -> dict[str, Any]:
    """The parameters that the server started with."""
    return runner.defaults.to_mapping()


@router.patch("/parameters")
async def change(values: dict[str, Any], runner: LiveRunner) -> dict[str, Any]:
    """Change some parameters while the robot walks, the scheme included; returns all of them.

    Another `plant` resets the robot, since it holds for a whole walk. A `twin` may come and go at any time.
    """
    await asyncio.wrap_future(runner.change(values))
    return runner.parameters.to_mapping()


@router.get("/world")
async def world(runner: LiveRunner) -> dict[str, Any]:
    """The world that a plant with contact physics stands in."""
    return runner.latest.world.to_mapping()


@router.patch("/world")
async def change_world(values: dict[str, Any], runner: LiveRunner) -> dict[str, Any]:
    """Change some of the world, as the key `world` of a scenario; the robot is reset into it. Returns all of it."""
    await asyncio.wrap_future(runner.begin({}, values))
    return runner.latest.world.to_mapping()


@router.post("/push")
async def push(body: PushBody, runner: LiveRunner) -> PushBody:
    """Push the robot at the next tick; of several within one tick the last one counts."""
    runner.push(body.to_push())
    return body


@router.post("/preview")
async def preview(body: PushBody, runner: LiveRunner) -> dict[str, Any]:
    """The plan that would follow this push of the model if it came now, all at once; the robot does not feel it.

    `survives` is true if the legs are long enough for that plan, and further steps can catch the robot at its end.
    """
    snapshot = await asyncio.wrap_future(runner.preview(body.to_push()))
    return preview_json(snapshot, runner.robot)


@router.put("/random-pushes")
async def random_pushes(body: RandomPushesBody, runner: LiveRunner) -> dict[str, Any]:
    """Let pushes come by themselves, each like any other push; `{"strength": 0}` ends them."""
    request = runner.push_at_random(body.strength, body.interval, body.seed)
    return live_json(await asyncio.wrap_future(request))


@router.post("/speed")
async def speed(body: SpeedBody, runner: LiveRunner) -> dict[str, Any]:
    """Let simulated time pass `factor` times as fast as real time."""
    return live_json(await asyncio.wrap_future(runner.set_speed(body.factor)))


@router.post(
    "/save",
    status_code=201,
    responses={
        201: {"headers": {"Location": {"description": "Address of the run.", "schema": {"type": "string"}}}},
        409: {"model": ErrorBody, "description": "There was no walk before the last reset."},
        503: {"model": ErrorBody, "description": "The control process is gone, or too many walks are being saved."},
    },
)
async def save(switch: LiveSwitch, runs: AllRuns, response: Response, body: SaveBody | None = None) -> RunBody:
    """Keep the last minute of the robot as a run that is done, with the scenario that leads to the same again."""
    requested = body or SaveBody()
    name = requested.name or f"live {datetime.now(UTC):%Y-%m-%d %H:%M:%S}"
    with runs.sessions.place():
        session = switch.save(requested.before_reset)
        run = await asyncio.to_thread(runs.add_session, session.segments, name, session.robot)
    response.headers["Location"] = address(run.id)
    return RunBody.model_validate(run)


@router.post("/pause")
async def pause(runner: LiveRunner) -> dict[str, Any]:
    """Stop time; returns the snapshot at which it stands still."""
    return live_json(await asyncio.wrap_future(runner.pause()))


@router.post("/resume")
async def resume(runner: LiveRunner) -> dict[str, Any]:
    """Let time pass again."""
    return live_json(await asyncio.wrap_future(runner.resume()))


@router.post("/step", responses={409: {"model": ErrorBody, "description": "The robot is not paused."}})
async def step(runner: LiveRunner, body: StepBody | None = None) -> dict[str, Any]:
    """Take single ticks while paused, or go to a coming sample; returns the snapshot of the last tick."""
    steps = body or StepBody()
    request = runner.step(steps.ticks or 1) if steps.samples is None else runner.step_samples(steps.samples)
    return live_json(await asyncio.wrap_future(request))


@router.post("/reset")
async def reset(runner: LiveRunner) -> dict[str, Any]:
    """Put the robot back to rest at tick 0, with no reference and no push; a paused one stays paused."""
    return live_json(await asyncio.wrap_future(runner.reset()))


@router.get("/layers")
async def layers(viewer: LiveViewer, client: Client = None) -> dict[str, bool]:
    """The layers of the scene, and whether each is shown to a browser; to one that opens now where none is named."""
    return dict(viewer.layers.of_new_pages) if client is None else viewer.layers.of(client)


@router.get("/layers/defaults")
async def default_layers() -> dict[str, bool]:
    """The layers that the server started with."""
    return DEFAULT_LAYERS


@router.patch("/layers")
async def switch_layers(values: dict[str, StrictBool], viewer: LiveViewer, client: Client = None) -> dict[str, bool]:
    """Show some layers or hide them, in one browser, or in all and those to come; returns all of them."""
    return await asyncio.wrap_future(viewer.switch(values, client))
