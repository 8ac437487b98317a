"""Only our own page may drive the robot: what other sites send from a visitor's browser is refused."""

from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocketClose

READING = {"GET", "HEAD", "OPTIONS"}


class SameOriginMiddleware:
    """Refuses websockets and requests that change something when their Origin is not our Host.

    A browser always sends an Origin with these; what has none is no browser, and passes.
    """

    def __init__(self, app: ASGIApp) -> None:
        """Guard `app`."""
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or refuse with 403."""
        is_guarded = scope["type"] == "websocket" or (scope["type"] == "http" and scope["method"] not in READING)
        if not is_guarded or is_same_origin(Headers(scope=scope)):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await receive()  # the connection must be seen before it can be refused
            await WebSocketClose(1008, "foreign origin")(scope, receive, send)
        else:
            detail = {"detail": "requests from pages of another origin are refused", "errors": []}
            await JSONResponse(detail, status_code=403)(scope, receive, send)


def is_same_origin(headers: Headers) -> bool:
    """Whether the Origin, if there is one, is where the request went."""
    origin = headers.get("origin")
    return origin is None or urlsplit(origin).netloc.lower() == headers.get("host", "").lower()
