"""Guards before all routes: only our own page may drive the robot from a browser, and no body may be too long."""

from collections.abc import Mapping
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose
from websockets.frames import CloseCode

READING = {"GET", "HEAD", "OPTIONS"}
MAX_BODY = 256 * 1024  # bytes: more than a scenario needs
UPLOAD = "/api/v1/runs/upload"
"""Path of the one route that takes a longer body: it writes the body to a file as it comes, and counts itself."""
FOREIGN = "requests from pages of another origin are refused"


def refusal(status: int, detail: str, headers: Mapping[str, str] | None = None) -> JSONResponse:
    """A refusal before all routes, in the shape that `refusals` gives theirs."""
    return JSONResponse({"detail": detail, "errors": []}, status, headers)


async def refuse(status: int, detail: str, scope: Scope, receive: Receive, send: Send) -> None:
    """Refuse a request with a status, or a websocket by closing it, for a reason of at most 123 bytes."""
    if scope["type"] == "websocket":
        await receive()  # the connection must be seen before it can be refused
        await WebSocketClose(CloseCode.POLICY_VIOLATION, detail)(scope, receive, send)
    else:
        await refusal(status, detail)(scope, receive, send)


class SameOriginMiddleware:
    """Refuses websockets and requests that change something when their Origin is not our Host.

    A browser always sends an Origin with these; a client without one is no browser, and passes.
    """

    def __init__(self, app: ASGIApp) -> None:
        """Guard `app`."""
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or refuse with 403."""
        is_guarded = scope["type"] == "websocket" or (scope["type"] == "http" and scope["method"] not in READING)
        if not is_guarded or is_same_origin(Headers(scope=scope)):
            await self._app(scope, receive, send)
        else:
            await refuse(403, FOREIGN, scope, receive, send)


def is_same_origin(headers: Headers) -> bool:
    """Whether the Origin, if there is one, is where the request went."""
    origin = headers.get("origin")
    return origin is None or urlsplit(origin).netloc.lower() == headers.get("host", "").lower()


class BodyLimitMiddleware:
    """Refuses a body that is too long with 413 before it is read, whether or not its length was announced."""

    def __init__(self, app: ASGIApp) -> None:
        """Guard `app`."""
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, counting; or refuse."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
        elif scope["path"] == UPLOAD:
            await self._app(scope, receive, send)
        elif announced_length(scope) > MAX_BODY:
            await refuse(413, too_long(MAX_BODY), scope, receive, send)
        else:
            await self._app(scope, _limited(receive), send)


def too_long(limit: int) -> str:
    """Refusal of a body that has more bytes than a limit."""
    return f"the body is longer than {limit} bytes"


def announced_length(scope: Scope) -> int:
    """Length of the body by its header [bytes]; 0 without one."""
    length = Headers(scope=scope).get("content-length", "")
    return int(length) if length.isdecimal() else 0


def _limited(receive: Receive) -> Receive:
    nb_bytes = 0

    async def receive_at_most() -> Message:
        nonlocal nb_bytes
        message = await receive()
        nb_bytes += len(message.get("body", b""))
        if nb_bytes > MAX_BODY:
            raise HTTPException(413, too_long(MAX_BODY))  # where the body is read, and our refusals get their shape
        return message

    return receive_at_most
