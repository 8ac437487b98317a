"""Websockets of the robot that walks on the page: snapshots out, teleop in. The latest value wins on both."""

import asyncio
import math
import secrets
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Annotated, Any, Literal

import msgspec
from fastapi import APIRouter, Query, WebSocket, WebSocketDisconnect
from pydantic import ValidationError
from websockets.frames import CloseCode

from app.http.live_json import live_json
from app.http.refusals import field_errors, summary
from app.http.schemas import ReferenceBody, TeleopMessage
from app.http.turns import ReadBudget
from app.live.driver_lease import DriverLease, LeaseHeldError
from app.live.live_state import LiveState
from app.live.messages import NoResponseError
from app.live.teleop_client import TeleopClient
from app.routes.dependencies import Lease, LiveSwitch
from walkcore.errors import InvalidValueError
from walkcore.values import check_range

MAX_MESSAGE = 4096  # characters
MAX_RATE, BURST = 400.0, 100  # messages that are read a second and at once; a program may send one for each tick
MAX_STREAMS = 250  # open at once
EARLY = 1e-3  # of a period: an event loop may wake so much before a time, and would send twice
Encoding = Literal["json", "msgpack"]

router = APIRouter(prefix="/api/v1/live")


class SnapshotStreams:
    """The live snapshot for any number of streams, encoded once for all that are due at the same time."""

    def __init__(self, state: Callable[[], LiveState]) -> None:
        """Serve the snapshots of a robot.

        Args:
            state: gives the latest one.
        """
        self._latest = state
        self._state: LiveState | None = None
        self._encoded: dict[Encoding, str | bytes] = {}
        self.nb_clients = 0
        """Number of open streams."""

    def latest(self, encoding: Encoding) -> str | bytes:
        """The latest snapshot as text in JSON, or the same keys and values in binary MessagePack."""
        state = self._latest()
        if state is not self._state:
            self._state, self._encoded = state, {}
        if encoding not in self._encoded:
            self._encoded[encoding] = _ENCODERS[encoding](live_json(state))
        return self._encoded[encoding]


_ENCODERS: dict[Encoding, Callable[[dict[str, Any]], str | bytes]] = {
    "json": lambda snapshot: msgspec.json.encode(snapshot).decode(),
    "msgpack": msgspec.msgpack.encode,
}


@router.websocket("/stream")
async def stream(
    socket: WebSocket,
    rate: Annotated[float, Query(ge=0.1, le=60.0, allow_inf_nan=False)] = 30.0,
    format: Encoding = "json",
) -> None:
    """Send the latest snapshot `rate` times a second, or as often as the reader can take it.

    As text in JSON, or the same keys and values in binary MessagePack.
    """
    streams: SnapshotStreams = socket.app.state.streams
    if streams.nb_clients >= MAX_STREAMS:
        await socket.close(CloseCode.TRY_AGAIN_LATER)
        return
    await socket.accept()
    send = socket.send_text if format == "json" else socket.send_bytes
    streams.nb_clients += 1
    try:
        with suppress(WebSocketDisconnect):
            while True:
                await send(streams.latest(format))  # pyright: ignore[reportArgumentType]  # text goes with JSON
                await asyncio.sleep(time_to_next(rate))
    finally:
        streams.nb_clients -= 1


def time_to_next(rate: float) -> float:
    """Time until the next multiple of the period [s], at which all streams of this rate are due together."""
    now = time.monotonic()
    return (math.floor(now * rate + EARLY) + 1) / rate - now


@router.websocket("/teleop")
async def teleop(
    socket: WebSocket, switch: LiveSwitch, lease: Lease, client: Annotated[str, Query(max_length=64)] = ""
) -> None:
    """Take references and pushes, clamped to the robot's limits; bad messages are reported and change nothing.

    The live snapshot names the `client` that drives: whatever a page calls itself, or a name of our own.
    """
    await socket.accept()
    name = client or secrets.token_hex(8)
    teleop_client = TeleopClient(lambda: switch.runner, name)
    with suppress(WebSocketDisconnect), lease.present(name):
        refused, budget = "", ReadBudget(MAX_RATE, BURST)
        while (message := await socket.receive())["type"] != "websocket.disconnect":
            try:
                _obey(message.get("text") or "", teleop_client, lease, name)
                refused = ""
            except LeaseHeldError as error:
                if not refused:  # a held control repeats itself
                    await socket.send_json({"error": str(error)})
                refused = str(error)
            except ValidationError as error:
                await socket.send_json({"error": summary(field_errors(error.errors()))})
            except (InvalidValueError, NoResponseError) as error:
                await socket.send_json({"error": str(error)})
            await asyncio.sleep(budget.take(time.monotonic()))


def _obey(text: str, client: TeleopClient, lease: DriverLease, name: str) -> None:
    """Carry out a teleop message; a reference of zero stops the robot, whoever drives.

    Raises:
        LeaseHeldError: if another browser drives alone.
        ValidationError: if it is not a message.
        InvalidValueError: if it is too long, or requests what cannot be clamped.
        NoResponseError: if the control process does not respond at the moment.
    """
    check_range("length", len(text), 0, MAX_MESSAGE)
    message = TeleopMessage.model_validate_json(text)
    if message.push is not None:
        client.push(message.push.to_push())
    if message.reference is not None:
        if message.reference != ReferenceBody():
            lease.check(name)
        client.steer(message.reference.to_reference(), message.driver, message.engagement)
