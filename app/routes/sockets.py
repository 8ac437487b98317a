"""Websockets of the robot that walks on the page: snapshots out, joystick in. Latest value wins on both."""

import asyncio
import secrets
import time
from contextlib import suppress
from typing import Annotated, Any, Literal

import msgspec
from fastapi import APIRouter, Query, WebSocket, WebSocketDisconnect
from pydantic import ValidationError

from app.http.errors import field_errors, summary
from app.http.schemas import TeleopMessage, live_json
from app.live.runner import TeleopClient
from app.routes.connection import LiveRunner
from walkcore.errors import InvalidValueError
from walkcore.values import check_range

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
        await socket.send_bytes(msgspec.msgpack.encode(snapshot))
    else:
        await socket.send_text(msgspec.json.encode(snapshot).decode())


@router.websocket("/teleop")
async def teleop(socket: WebSocket, runner: LiveRunner, client: Annotated[str, Query(max_length=64)] = "") -> None:
    """Take joystick and push messages, clamped to the robot's limits; bad ones are answered and change nothing.

    The live snapshot names the `client` that drives: whatever a page calls itself, or a name of our own.
    """
    await socket.accept()
    teleop_client = TeleopClient(runner, client or secrets.token_hex(8))
    with suppress(WebSocketDisconnect):
        while (message := await socket.receive())["type"] != "websocket.disconnect":
            try:
                _obey(message.get("text") or "", teleop_client)
            except ValidationError as error:
                await socket.send_json({"error": summary(field_errors(error.errors()))})
            except InvalidValueError as error:
                await socket.send_json({"error": str(error)})


def _obey(text: str, client: TeleopClient) -> None:
    """Do what a message asks.

    Raises:
        ValidationError: if it is not a message.
        InvalidValueError: if it is too long, or asks for what cannot be clamped.
    """
    check_range("length", len(text), 0, MAX_MESSAGE)
    message = TeleopMessage.model_validate_json(text)
    if message.push is not None:
        client.push(message.push.to_push())
    if message.reference is not None:
        client.steer(message.reference.to_reference(), message.driver, message.engagement)
