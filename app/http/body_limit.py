"""No request may carry more than a scenario needs: the rest is refused before it is read."""

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

MAX_BODY = 256 * 1024  # bytes
DETAIL = f"the body is longer than {MAX_BODY} bytes"


class BodyLimitMiddleware:
    """Answers 413 to a body that is too long, whether it says so in advance or not."""

    def __init__(self, app: ASGIApp) -> None:
        """Guard `app`."""
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, counting; or refuse."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
        elif _announced(scope) > MAX_BODY:
            await JSONResponse({"detail": DETAIL, "errors": []}, status_code=413)(scope, receive, send)
        else:
            await self._app(scope, _counted(receive), send)


def _announced(scope: Scope) -> int:
    length = Headers(scope=scope).get("content-length", "")
    return int(length) if length.isdecimal() else 0


def _counted(receive: Receive) -> Receive:
    nb_bytes = 0

    async def receive_at_most() -> Message:
        nonlocal nb_bytes
        message = await receive()
        nb_bytes += len(message.get("body", b""))
        if nb_bytes > MAX_BODY:
            raise HTTPException(413, DETAIL)  # where the body is read, and our refusals get their shape
        return message

    return receive_at_most
