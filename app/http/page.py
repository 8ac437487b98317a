"""Everything a browser loads: our page, and viser's page and websocket behind our own port.

viser's client at `/viewer/` opens the websocket at its page's address without the trailing slash, or where the page's
`websocket` parameter says: `/viewer/light` draws less, and `client` names the page, so that the panel shows whose
sliders drive. viser has no authentication and takes any Origin, so it listens on the loopback only, and
`app.http.guards` refuses foreign pages before they come here.
"""

import asyncio
import gzip
import hashlib
import socket
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from os import PathLike, stat_result
from pathlib import Path
from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, FastAPI, Query, Request, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import FileResponse
from fastapi.staticfiles import StaticFiles
from starlette.middleware.gzip import GZipMiddleware
from starlette.types import Scope
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import WebSocketException

from app.viewer import CLIENT_PAGE, LIGHT_PATH

STATIC = Path(__file__).parents[2] / "static"
# Without this a browser keeps some of the modules of an older version for days, and mixes them with new ones.
REVALIDATE = {"Cache-Control": "no-cache"}
RECEIVE_BUFFER = 16 * 1024  # bytes; what waits here for a slow browser cannot be overtaken by newer poses
CLOSE_TIMEOUT = 0.2  # [s] viser's response to a close is waited for; behind poses that nobody takes it never comes
TRY_AGAIN_LATER = 1013

Client = Annotated[str, Query(max_length=64)]


class PageFiles(StaticFiles):
    """Static files that a browser keeps, and revalidates each time."""

    def file_response(
        self, full_path: str | PathLike[str], stat_result: stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        """The base class's response, with our header on caching."""
        response = super().file_response(full_path, stat_result, scope, status_code)
        response.headers.update(REVALIDATE)
        return response


def install(app: FastAPI) -> None:
    """Serve the page at `/` and its parts, compressed, below `/static`."""

    @app.get("/", include_in_schema=False)
    async def page() -> FileResponse:
        return FileResponse(STATIC / "index.html", headers=REVALIDATE)

    app.mount("/static", GZipMiddleware(PageFiles(directory=STATIC)), name="static")


@dataclass(frozen=True, slots=True)
class ViserPage:
    """viser's page: 0.8 MB that never change while the server runs, so compressed once."""

    plain: bytes
    compressed: bytes
    """The same by gzip."""
    tag: str
    """Entity tag, by which a browser says that it has the page already."""

    def response(self, request: Request) -> Response:
        """The page, or 304 where the browser has it."""
        headers = REVALIDATE | {"ETag": self.tag, "Vary": "Accept-Encoding"}
        if request.headers.get("if-none-match") == self.tag:
            return Response(status_code=304, headers=headers)
        if "gzip" not in request.headers.get("accept-encoding", ""):
            return Response(self.plain, media_type="text/html", headers=headers)
        return Response(self.compressed, media_type="text/html", headers=headers | {"Content-Encoding": "gzip"})


@cache
def _viser_page() -> ViserPage:
    plain = CLIENT_PAGE.read_bytes()
    return ViserPage(plain, gzip.compress(plain), f'W/"{hashlib.sha256(plain).hexdigest()[:16]}"')


def viewer_router(port: Callable[[], int]) -> APIRouter:
    """Routes to the viser server.

    Args:
        port: finds its port on the loopback.
    """
    router = APIRouter(include_in_schema=False)

    @router.get("/viewer/")
    async def page(request: Request) -> Response:
        return _viser_page().response(request)

    @router.websocket("/viewer")
    async def scene(browser: WebSocket, client: Client = "") -> None:
        await _proxy(browser, port(), f"/?{urlencode({'client': client})}")

    @router.websocket("/viewer/light")
    async def light_scene(browser: WebSocket, client: Client = "") -> None:
        await _proxy(browser, port(), f"{LIGHT_PATH}?{urlencode({'client': client})}")

    return router


async def _proxy(browser: WebSocket, port: int, path: str) -> None:
    """Connect a browser with viser."""
    try:
        upstream = await _connect(port, path, browser.scope["subprotocols"])
    except (OSError, WebSocketException):
        await browser.close(TRY_AGAIN_LATER)
        return
    async with upstream:
        await browser.accept(subprotocol=upstream.subprotocol)
        await _relay(browser, upstream)


async def _connect(port: int, path: str, subprotocols: list[str]) -> ClientConnection:
    """Open a websocket to viser, which closes one that does not name its subprotocol."""
    end = socket.socket()
    end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
    end.setblocking(False)
    await asyncio.get_running_loop().sock_connect(end, ("127.0.0.1", port))
    return await connect(
        f"ws://127.0.0.1:{port}{path}",
        sock=end,
        subprotocols=subprotocols,  # pyright: ignore[reportArgumentType]  # Subprotocol is a str
        compression=None,
        close_timeout=CLOSE_TIMEOUT,
        max_size=None,
        max_queue=2,
    )


async def _relay(browser: WebSocket, upstream: ClientConnection) -> None:
    """Pass messages both ways until one side closes."""

    async def down() -> None:
        async for message in upstream:
            await (browser.send_text(message) if isinstance(message, str) else browser.send_bytes(message))
        await browser.close()

    async def up() -> None:
        while (message := await browser.receive())["type"] == "websocket.receive":
            await upstream.send(message.get("bytes") or message.get("text") or b"")

    pumps = [asyncio.ensure_future(pump()) for pump in (down, up)]
    try:
        await asyncio.wait(pumps, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for pump in pumps:
            pump.cancel()
        for outcome in await asyncio.gather(*pumps, return_exceptions=True):
            if isinstance(outcome, Exception) and not isinstance(outcome, (WebSocketDisconnect, WebSocketException)):
                raise outcome
