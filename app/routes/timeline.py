"""Time that runs backwards: the last minutes of the live walk, each of their ticks, and a fork from one of them."""

import asyncio
import time
from contextlib import suppress
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, WebSocket, WebSocketDisconnect
from pydantic import ValidationError
from websockets.frames import CloseCode

from app.http.live_json import live_json, past_json
from app.http.refusals import field_errors, summary
from app.http.schemas import ForkBody, LookMessage, MarkBody, TimelineBody
from app.http.turns import ReadBudget
from app.live.fork import Fork
from app.live.messages import NoResponseError
from app.live.past import PastTicks
from app.live.runner import Runner
from app.routes.dependencies import AllRuns, LiveRunner, LiveViewer, Past
from app.routes.live_robot import REFUSALS
from app.routes.past_run import RunTicks, check_robot
from app.routes.scripted_runs import NO_RECORDING
from app.runs import Runs
from app.runs.restore import restored
from app.viewer import PastLook, TooManyLooksError
from app.work import NoFileError, UnknownWorkError, WorkUnavailableError
from walkcore.errors import WalkError
from walkcore.values import MAX_TICK

MAX_MESSAGE = 200  # characters
MAX_RATE, BURST = 60.0, 20  # messages that are read a second, and at once
REST = 0.25  # [s] without another tick, after which footsteps and plots are drawn anew
PLOTTED, NB_POINTS = 8.0, 100  # [s] before a tick that are drawn, and by how many snapshots

router = APIRouter(prefix="/api/v1/live", tags=["live"], responses={**REFUSALS})


@router.get("/timeline")
async def timeline(runner: LiveRunner) -> TimelineBody:
    """The ticks of the present walk that are kept, the last two minutes, and marks where something happened."""
    line = await asyncio.wrap_future(runner.timeline())
    return TimelineBody(
        walk=line.walk,
        first_tick=line.first_tick,
        last_tick=line.last_tick,
        control_period=line.control_period,
        marks=[MarkBody(tick=mark.tick, kind=mark.kind, text=mark.text) for mark in line.marks],
    )


@router.get("/timeline/{tick}")
async def past_tick(tick: Annotated[int, Path(ge=0, le=MAX_TICK)], runner: LiveRunner, past: Past) -> dict[str, Any]:
    """The snapshot of an earlier tick, or of the nearest one that is kept, without the trajectories of its plan."""
    snapshot, _, _ = await past.at(tick)
    return past_json(runner.latest, snapshot)


@router.post("/fork", responses=NO_RECORDING)
async def fork(body: ForkBody, runner: LiveRunner, runs: AllRuns) -> dict[str, Any]:
    """Go on from an earlier tick; without a change the same walk comes again, to the last bit.

    The walk that was is drawn beside the one that goes on, the live snapshot compares them under `fork`, and it can be
    saved as the walk before the last reset; where it is that of a `run`, the present walk can.
    """
    forked = body.to_fork()
    runner.check_fork(forked)
    if body.run:
        await asyncio.to_thread(_fork_from_run, forked, body.run, runner, runs)
    else:
        await asyncio.wrap_future(runner.fork(forked))
    return live_json(runner.latest)


def _fork_from_run(forked: Fork, run_id: str, runner: Runner, runs: Runs) -> None:
    """Let the robot go on from a tick of a recorded run; waits until it does."""
    folder = runs.file(run_id, "run.json").parent
    check_robot(runs.get(run_id).robot, runner.robot)
    with restored(runs.restoring, folder, forked.tick) as segments:
        runner.fork(forked, segments).result()


@router.websocket("/look")
async def look(
    socket: WebSocket,
    runner: LiveRunner,
    viewer: LiveViewer,
    past: Past,
    runs: AllRuns,
    client: Annotated[str, Query(max_length=64)] = "",
) -> None:
    """Show the scene of one browser, by the name of its controls, the ticks that it asks for: `{"tick": 1200}`.

    With a `run` beside the tick it is one of a recorded run of the same robot, or the frame next to it.
    Each is answered by its snapshot, as the live stream has it. Others go on seeing the present, and so does this one
    after `{"tick": null}`, or once the socket is closed.
    """
    await socket.accept()
    try:
        with viewer.past_look(client) as shown:
            remembering: asyncio.Task[None] | None = None
            source = _Source(past, runs)
            budget = ReadBudget(MAX_RATE, BURST)
            try:
                while True:
                    text = await socket.receive_text()
                    if remembering is not None:
                        remembering.cancel()
                    tick = await _look(text, socket, runner, source, shown)
                    remembering = None if tick is None else asyncio.create_task(_remember(tick, runner, source, shown))
                    await asyncio.sleep(budget.take(time.monotonic()))
            finally:
                if remembering is not None:
                    remembering.cancel()
    except TooManyLooksError as refusal:
        await socket.close(CloseCode.TRY_AGAIN_LATER, str(refusal))
    except WebSocketDisconnect:
        return


class _Source:
    """Past of the live walk, or a run that was opened, as one browser looks at it."""

    def __init__(self, past: PastTicks, runs: Runs) -> None:
        """Begin with the live walk's past."""
        self._past, self._runs = past, runs
        self.ticks: PastTicks | RunTicks = past

    async def choose(self, run: str, runner: LiveRunner) -> None:
        """Look at a run by its id, or at the past of the live walk where that is empty."""
        if not run:
            self.ticks = self._past
        elif not isinstance(self.ticks, RunTicks) or self.ticks.run_id != run:
            self.ticks = await RunTicks.opened(run, self._runs, runner.robot)


async def _look(text: str, socket: WebSocket, runner: LiveRunner, source: _Source, shown: PastLook) -> int | None:
    """Carry out a message; the tick that is shown then, None if there is none."""
    try:
        message = LookMessage.model_validate_json(text[:MAX_MESSAGE])
        if message.tick is None:
            shown.leave()
            return None
        await source.choose(message.run, runner)
        snapshot, parameters, world = await source.ticks.at(message.tick)
    except ValidationError as error:
        await socket.send_json({"error": summary(field_errors(error.errors()))})
    except (WalkError, NoResponseError, UnknownWorkError, NoFileError, WorkUnavailableError) as error:
        await socket.send_json({"error": str(error)})
    else:
        shown.show(snapshot, parameters, world)
        await socket.send_json(past_json(runner.latest, snapshot))
        return snapshot.tick
    return None


async def _remember(tick: int, runner: LiveRunner, source: _Source, shown: PastLook) -> None:
    """Draw what was before a tick at which a browser rests."""
    await asyncio.sleep(REST)
    nb_ticks = round(PLOTTED / runner.parameters.control_period)
    with suppress(WalkError, NoResponseError):
        shown.remember(await source.ticks.before(tick, nb_ticks, max(nb_ticks // NB_POINTS, 1)))
