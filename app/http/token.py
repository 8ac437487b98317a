"""Who knows the token may come in: to the page, the scene, the API, the sockets, all of it.

Programs send it as `Authorization: Bearer TOKEN`. A browser is shown a form once
(`app.routes.signin`) and gets a cookie that scripts cannot read; the cookie is derived
from the token and tells nothing of it.
"""

import hashlib
import hmac
from http.cookies import CookieError, SimpleCookie
from urllib.parse import quote

from starlette.datastructures import Headers
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocketClose

SIGN_IN = "/signin"
HEALTH = "/api/v1/health"  # health checks have no token
OPEN = {SIGN_IN, HEALTH, "/static/style.css", "/static/icon.svg"}


class Token:
    """The token that is asked for."""

    def __init__(self, token: str) -> None:
        """Known from outside."""
        self._token = token.encode()
        self.cookie_value = hmac.new(self._token, b"the cookie of walk", hashlib.sha256).hexdigest()
        # Cookies do not tell ports apart: servers of one host must not overwrite each other's.
        self.cookie_name = f"walk-{self.cookie_value[:8]}"

    def is_shown_by(self, headers: Headers) -> bool:
        """Whether a request carries the token, or the cookie that was given for it."""
        kind, _, given = headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer" and self.is_equal(given.strip().encode("latin-1")):
            return True
        cookie = _cookies(headers).get(self.cookie_name)
        return cookie is not None and hmac.compare_digest(cookie.value.encode(), self.cookie_value.encode())

    def is_equal(self, given: bytes) -> bool:
        """Whether it was given; takes as long wherever it differs."""
        return hmac.compare_digest(given, self._token)


class TokenMiddleware:
    """Refuses requests and websockets that do not show the token."""

    def __init__(self, app: ASGIApp, token: Token) -> None:
        """Guard `app`."""
        self._app, self._token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or refuse: 401, or the form where a person looks at a page."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        if (scope["type"] == "http" and scope["path"] in OPEN) or self._token.is_shown_by(headers):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await receive()  # the connection must be seen before it can be refused
            await WebSocketClose(1008, "the token is missing")(scope, receive, send)
        else:
            await _refusal(scope, headers)(scope, receive, send)


def _refusal(scope: Scope, headers: Headers) -> Response:
    if scope["method"] == "GET" and "text/html" in headers.get("accept", ""):
        query = f"?{scope['query_string'].decode('latin-1')}" if scope["query_string"] else ""
        return RedirectResponse(f"{SIGN_IN}?next={quote(scope['path'] + query, safe='/')}", status_code=303)
    body = {"detail": "the token is missing or wrong; send it as Authorization: Bearer TOKEN", "errors": []}
    return JSONResponse(body, status_code=401, headers={"WWW-Authenticate": "Bearer"})


def _cookies(headers: Headers) -> SimpleCookie:
    try:
        return SimpleCookie(headers.get("cookie", ""))
    except CookieError:
        return SimpleCookie()
