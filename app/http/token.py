"""Token authentication for the page, the scene, the API and the sockets.

Programs send the token as `Authorization: Bearer TOKEN`. A browser is shown a form once and gets a cookie that scripts
cannot read; the cookie is derived from the token and reveals nothing of it.
"""

import asyncio
import hashlib
import hmac
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from urllib.parse import parse_qs, quote

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse
from starlette.datastructures import Headers
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocketClose

SIGN_IN = "/signin"
HEALTH = "/api/v1/health"  # health checks have no token
OPEN = {SIGN_IN, HEALTH, "/static/style.css", "/static/icon.svg", "/static/signin.js"}
COOKIE_AGE = 30 * 24 * 3600  # [s]
WRONG_TOKEN_DELAY = 1.0  # [s], so that guessing takes long


class Token:
    """The required token, and the cookie that stands for it."""

    def __init__(self, token: str) -> None:
        """Derive the cookie."""
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
        """Whether `given` is the token; takes as long wherever it differs."""
        return hmac.compare_digest(given, self._token)


class TokenMiddleware:
    """Refuses requests and websockets that do not show the token."""

    def __init__(self, app: ASGIApp, token: Token) -> None:
        """Guard `app`."""
        self._app, self._token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or refuse: with the form where a person looks at a page, else with 401."""
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


def signin_router(token: Token, form: Path) -> APIRouter:
    """Routes of the form on which a person enters the token, once a browser.

    Args:
        token: for which the cookie is given.
        form: file of the page.
    """
    router = APIRouter(include_in_schema=False)

    @router.get(SIGN_IN)
    async def show_form() -> FileResponse:
        return FileResponse(form, headers={"Cache-Control": "no-store"})

    @router.post(SIGN_IN)
    async def sign_in(request: Request) -> Response:
        fields = parse_qs((await request.body()).decode("latin-1"))
        place = _local_place(fields.get("next", ["/"])[0])
        if not token.is_equal(fields.get("token", [""])[0].encode()):
            await asyncio.sleep(WRONG_TOKEN_DELAY)
            return RedirectResponse(f"{SIGN_IN}?wrong&next={quote(place, safe='/')}", status_code=303)
        response = RedirectResponse(place, status_code=303)
        response.set_cookie(
            token.cookie_name,
            token.cookie_value,
            max_age=COOKIE_AGE,
            httponly=True,
            samesite="lax",
            secure=request.url.scheme == "https",
        )
        return response

    return router


def _local_place(place: str) -> str:
    """The place to go on to, or `/` where it is on another site, which a second slash of either kind would name."""
    is_local = place.startswith("/") and not place.startswith(("//", "/\\")) and place.isprintable()
    return place if is_local else "/"
