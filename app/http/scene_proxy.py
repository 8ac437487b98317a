"""viser's websocket behind our own port.

viser's client at `/viewer/` opens the websocket at its page's address without the trailing slash, or where the page's
`websocket` parameter says: `/viewer/light` draws less, and `client` names the page, so that the panel shows whose
sliders drive. viser has no authentication, takes any Origin and believes its clients. So only this module reaches it,
behind the guards of all routes, and hands on what `app.viewer.transport.client_messages` lets pass.
"""

import asyncio
import logging
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request, Response, WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, unix_connect
from websockets.exceptions import WebSocketException
from websockets.frames import CloseCode

from app.http.page import viser_page
from app.http.seats import Seats
from app.http.token import role_of
from app.http.turns import ReadBudget
from app.viewer import LIGHT_PATH, Viewer
from app.viewer.transport.client_messages import ClientMessages, ForbiddenMessageError

logger = logging.getLogger(__name__)

CLOSE_TIMEOUT = 0.2  # [s] viser's response to a close is waited for; behind poses that nobody takes it never comes
FORWARD_PERIOD = 1.0 / 30.0  # [s] from one handing on of a browser's messages to the next
COST_OF_CONTROLS = 4  # messages that one to a control counts as: it goes to every browser, and calls back

Client = Annotated[str, Query(max_length=64)]


def scene_router(viewer: Callable[[], Viewer], seats: Seats) -> APIRouter:
    """Routes of the scene: viser's page and its websocket.

    Args:
        viewer: gives the owner of viser's server, which another robot changes.
        seats: one of which each open scene takes.
    """
    router = APIRouter(include_in_schema=False)

    @router.get("/viewer/")
    async def page(request: Request) -> Response:
        return viser_page().response(request)

    @router.websocket("/viewer")
    async def scene(browser: WebSocket, client: Client = "") -> None:
        await _seat(browser, viewer(), seats, "/", client)

    @router.websocket("/viewer/light")
    async def light_scene(browser: WebSocket, client: Client = "") -> None:
        await _seat(browser, viewer(), seats, LIGHT_PATH, client)

    return router


async def _seat(browser: WebSocket, viewer: Viewer, seats: Seats, path: str, page: str) -> None:
    """Connect a browser with viser if there is a place for it."""
    if not seats.has_room(browser):
        await browser.close(CloseCode.TRY_AGAIN_LATER)
        return
    with seats.taken():
        await _proxy(browser, viewer, path, page)


async def _proxy(browser: WebSocket, viewer: Viewer, path: str, page: str) -> None:
    """Connect a browser with viser."""
    try:
        upstream = await unix_connect(
            str(viewer.socket),
            f"ws://localhost{path}?{urlencode({'client': page})}",
            subprotocols=browser.scope["subprotocols"],  # viser closes a connection that does not name its own
            compression=None,
            close_timeout=CLOSE_TIMEOUT,
            max_size=None,
            max_queue=2,
        )
    except (OSError, WebSocketException):
        await browser.close(CloseCode.TRY_AGAIN_LATER)
        return
    async with upstream:
        await browser.accept(subprotocol=upstream.subprotocol)
        await _relay(browser, upstream, viewer.client_messages(role_of(browser) == "operator", page))


async def _relay(browser: WebSocket, upstream: ClientConnection, messages: ClientMessages) -> None:
    """Pass messages both ways until one side closes, or the browser sends what it may not."""
    refusal = ""

    async def down() -> None:
        async for message in upstream:
            await (browser.send_text(message) if isinstance(message, str) else browser.send_bytes(message))
        await browser.close()

    async def up() -> None:
        nonlocal refusal
        budget = ReadBudget()
        while (message := await browser.receive())["type"] == "websocket.receive":
            try:
                is_control = messages.add(message.get("bytes") or b"")
            except ForbiddenMessageError as error:
                refusal = str(error)
                return
            cost = COST_OF_CONTROLS if is_control else 1
            # Meanwhile nothing is read: the sender has to wait.
            await asyncio.sleep(budget.take(time.monotonic(), cost))

    async def forward() -> None:
        while True:
            for message in messages.take():
                await upstream.send(message)
            await asyncio.sleep(FORWARD_PERIOD)

    pumps = [asyncio.ensure_future(pump()) for pump in (down, up, forward)]
    try:
        await asyncio.wait(pumps, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for pump in pumps:
            pump.cancel()
        for outcome in await asyncio.gather(*pumps, return_exceptions=True):
            if isinstance(outcome, Exception) and not isinstance(outcome, (WebSocketDisconnect, WebSocketException)):
                raise outcome
    if refusal:
        logger.warning("a browser was disconnected from the scene for its message: %.100r", refusal)
        with suppress(WebSocketDisconnect):
            await browser.close(CloseCode.POLICY_VIOLATION)
