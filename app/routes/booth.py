"""Routes of the booth: the screen that shows the code, and the phones that it lets drive."""

import asyncio
import io
import secrets
import time
from contextlib import suppress
from typing import Annotated, Any
from urllib.parse import urlsplit

import segno
from fastapi import APIRouter, Query, Response, WebSocket, WebSocketDisconnect
from pydantic import BaseModel, Field, ValidationError
from starlette.websockets import WebSocketDisconnected
from websockets.frames import CloseCode

from app.http.refusals import field_errors, summary
from app.http.schemas import Body, ErrorBody
from app.http.turns import ReadBudget
from app.live.booth import Booth
from app.live.driver_lease import LeaseHeldError
from app.live.driver_queue import NotYourTurnError, QueueFullError
from app.live.messages import NoResponseError
from app.routes.dependencies import TheBooth
from walkcore.errors import InvalidValueError

MAX_MESSAGE = 500  # characters
MAX_RATE, BURST = 30.0, 20  # messages of a phone that are read a second, and at once
MAX_PHONES = 100  # connected at once
PERIOD = 0.25  # [s] between messages to a phone or a screen
CLOSED = (WebSocketDisconnect, WebSocketDisconnected)  # told by what comes in, or by what was sent before
Share = Annotated[float, Field(ge=-1.0, le=1.0)]

router = APIRouter(prefix="/api/v1/live/booth", tags=["booth"], responses={422: {"model": ErrorBody}})


class PhoneMessage(Body):
    """Message of a phone: how its stick stands, a push, or that its visitor wants another turn."""

    forward: Share = 0.0
    left: Share = 0.0
    turn: Share = 0.0
    push: float | None = Field(default=None, ge=-10.0, le=10.0, description="Direction from ahead to the left [rad].")
    again: bool = False


class BoothBody(BaseModel):
    """The booth as its host sees it."""

    is_open: bool = Field(description="Whether a screen shows it.")
    phone: str = Field(description="Path of the controls for a phone, with the key that lets it drive.")
    number: int = Field(description="Number of the visitor who drives; 0 where none does.")
    waiting: int
    time_left: float = Field(description="Time that is left of the turn [s].")
    problem: str = Field(description="Why visitors wait though it is their turn; empty where they do not.")
    is_attracting: bool = Field(description="Whether the robot walks by itself.")


@router.get("")
async def booth(booth: TheBooth) -> BoothBody:
    """State of the booth: the visitor who drives, the line, and the link that the code on the screen holds."""
    return BoothBody(is_open=booth.is_open, phone=_phone_path(booth), **_state(booth))


@router.get("/code.svg", response_class=Response, responses={200: {"content": {"image/svg+xml": {}}}})
async def code(address: Annotated[str, Query(max_length=200)], booth: TheBooth) -> Response:
    """The QR code that leads a phone to its controls, by the address at which phones reach this server."""
    parts = urlsplit(address)
    if parts.scheme not in ("http", "https") or not parts.netloc:
        raise InvalidValueError("address", address, "must begin with http:// or https:// and name a host")
    picture = io.BytesIO()
    segno.make_qr(f"{parts.scheme}://{parts.netloc}{_phone_path(booth)}", error="m").save(
        picture, kind="svg", border=2, light="#fff", xmldecl=False, omitsize=True
    )
    return Response(picture.getvalue(), media_type="image/svg+xml", headers={"Cache-Control": "no-store"})


def _phone_path(booth: Booth) -> str:
    return f"/phone?key={booth.key}"


@router.websocket("/screen")
async def screen(socket: WebSocket, booth: TheBooth) -> None:
    """Keep the booth open, and tell a screen who drives and how many wait."""
    await socket.accept()
    with booth.screen():
        sending = asyncio.create_task(_tell_screen(socket, booth))
        try:
            with suppress(*CLOSED):
                while True:
                    await socket.receive_text()  # only to see it close
        finally:
            sending.cancel()


async def _tell_screen(socket: WebSocket, booth: Booth) -> None:
    with suppress(*CLOSED):
        while True:
            booth.step()
            await socket.send_json(_state(booth))
            await asyncio.sleep(PERIOD)


def _state(booth: Booth) -> dict[str, Any]:
    queue = booth.queue
    return {
        "number": queue.number,
        "waiting": queue.nb_waiting,
        "time_left": round(queue.time_left, 1),
        "problem": booth.problem,
        "is_attracting": booth.is_attracting,
    }


@router.websocket("/phone")
async def phone(
    socket: WebSocket,
    booth: TheBooth,
    key: Annotated[str, Query(max_length=64)] = "",
    client: Annotated[str, Query(max_length=64)] = "",
) -> None:
    """Let the visitor at a phone stand in line and drive in turn; the key is in the code on the screen."""
    if not secrets.compare_digest(key.encode(), booth.key.encode()):
        await socket.close(CloseCode.POLICY_VIOLATION, "the code is of another day: scan it again")
        return
    if booth.nb_phones >= MAX_PHONES:
        await socket.close(CloseCode.TRY_AGAIN_LATER)
        return
    await socket.accept()
    visitor = _Phone(socket, booth, client or secrets.token_hex(8))
    with booth.phone():
        visitor.join()
        sending = asyncio.create_task(visitor.tell())
        try:
            with suppress(*CLOSED):
                await visitor.obey()
        finally:
            sending.cancel()
            booth.queue.disconnect(visitor.name)


class _Phone:
    """A phone that is connected."""

    def __init__(self, socket: WebSocket, booth: Booth, name: str) -> None:
        self._socket, self._booth, self.name = socket, booth, name
        self._number, self._error = 0, ""

    def join(self) -> None:
        """Stand in line, where there is room and the booth is open."""
        self._error = ""
        try:
            if self._booth.is_open:
                self._number = self._booth.queue.join(self.name)
        except QueueFullError as error:
            self._error = str(error)

    async def tell(self) -> None:
        """Tell the phone its place, again and again."""
        with suppress(*CLOSED):
            while True:
                place = self._booth.queue.place(self.name)
                own = {"place": place, "own_number": self._number, "is_open": self._booth.is_open}
                await self._socket.send_json(_state(self._booth) | own | {"error": self._error})
                await asyncio.sleep(PERIOD)

    async def obey(self) -> None:
        """Carry out what the phone sends."""
        budget = ReadBudget(MAX_RATE, BURST)
        while True:
            self._carry_out((await self._socket.receive_text())[:MAX_MESSAGE])
            await asyncio.sleep(budget.take(time.monotonic()))

    def _carry_out(self, text: str) -> None:
        booth = self._booth
        try:
            message = PhoneMessage.model_validate_json(text)
            if message.again:
                self.join()
            elif message.push is not None:
                booth.push(self.name, message.push)
            else:
                booth.steer(self.name, message.forward, message.left, message.turn)
            self._error = "" if not message.again else self._error
        except NotYourTurnError:
            pass  # its place says so already
        except ValidationError as error:
            self._error = summary(field_errors(error.errors()))
        except (LeaseHeldError, NoResponseError) as error:
            self._error = str(error)
