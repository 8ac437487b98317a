"""Websockets of the robot that walks on the page: snapshots out, joystick in. Latest value wins on both."""

import asyncio
import json
import time
from contextlib import suppress
from typing import Annotated, Any, Literal

import msgpack
import numpy as np
from fastapi import APIRouter, Query, WebSocket, WebSocketDisconnect
from pydantic import ValidationError

from app.errors import field_errors, summary
from app.routes.connection import LiveRunner
from app.runner import Runner
from app.schemas import TeleopMessage, live_json
from walkcore import Push
from walkcore.errors import InvalidValueError
from walkcore.values import check_range

JOYSTICK_EXPIRES = 0.4  # [s] after which a silent joystick counts as let go
MAX_MESSAGE = 4096  # characters

router = APIRouter(prefix="/api/v1/live")


@router.websocket("/stream")
async def stream(
    socket: WebSocket,
    runner: LiveRunner,
    rate: Annotated[float, Query(ge=0.1, le=60.0, allow_inf_nan=False)] = 30.0,
    format: Literal["json", "msgpack"] = "json",
) -> None:
    """Send the latest snapshot `rate` times a second, or as often as the reader can take it.

    As text in JSON, or the same keys and values in binary MessagePack.
    """
    await socket.accept()
    socket.app.state.nb_streams += 1
    try:
        with suppress(WebSocketDisconnect):
            due = time.monotonic()
            while True:
                await _send(socket, live_json(runner.latest, runner.robot), format)
                due = max(due + 1.0 / rate, time.monotonic())  # what is late is not made up for
                await asyncio.sleep(due - time.monotonic())
    finally:
        socket.app.state.nb_streams -= 1


async def _send(socket: WebSocket, snapshot: dict[str, Any], format: str) -> None:
    if format == "msgpack":
        await socket.send_bytes(msgpack.packb(snapshot))  # pyright: ignore[reportArgumentType]  # never None
    else:
        await socket.send_text(json.dumps(snapshot, separators=(",", ":")))


@router.websocket("/teleop")
async def teleop(socket: WebSocket, runner: LiveRunner) -> None:
    """Take joystick and push messages, clamped to the robot's limits; bad ones are answered and change nothing."""
    await socket.accept()
    with suppress(WebSocketDisconnect):
        while (message := await socket.receive())["type"] != "websocket.disconnect":
            try:
                _obey(message.get("text") or "", runner)
            except ValidationError as error:
                await socket.send_json({"error": summary(field_errors(error.errors()))})
            except InvalidValueError as error:
                await socket.send_json({"error": str(error)})


def _obey(text: str, runner: Runner) -> None:
    """Do what a message asks.

    Raises:
        ValidationError: if it is not a message.
        InvalidValueError: if it is too long, or asks for what cannot be clamped.
    """
    check_range("length", len(text), 0, MAX_MESSAGE)
    message = TeleopMessage.model_validate_json(text)
    if message.push is not None:
        runner.push(_clamped(message.push.to_push(), runner.robot.max_push))
    if message.reference is not None:
        reference = runner.robot.clamped_reference(message.reference.to_reference())
        runner.drive(reference, "joystick", expires_after=JOYSTICK_EXPIRES)


def _clamped(push: Push, max_push: float) -> Push:
    """The push in its direction, no stronger than a limit."""
    strength = float(np.linalg.norm(push.impulse))
    if strength <= max_push:
        return push
    shrunk = push.impulse * (max_push / strength * (1.0 - 1e-9))  # so that rounding stays below the limit
    return Push(shrunk, push.duration, push.frame)
