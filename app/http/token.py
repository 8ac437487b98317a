"""Token authentication for the page, the scene, the API and the sockets, in two roles.

Programs send a token as `Authorization: Bearer TOKEN`. A browser is shown a form once and gets a cookie that scripts
cannot read; the cookie is derived from the token and reveals nothing of it. The operator's token may do everything,
the viewer's token only look. Without any token whoever comes is an operator.
"""

import hashlib
import hmac
import math
import time
from collections.abc import Callable, Mapping
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import Literal
from urllib.parse import parse_qs, quote

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse
from starlette.datastructures import Headers
from starlette.requests import HTTPConnection
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from app.http.guards import READING, refusal, refuse
from app.http.wrong_tokens import WrongTokens

Role = Literal["operator", "viewer"]

SIGN_IN = "/signin"
HEALTH = "/api/v1/health"  # health checks have no token
COMMANDING = {"/api/v1/live/teleop", "/api/v1/live/booth/screen"}  # websockets that let the robot walk
PHONE = "/api/v1/live/booth/phone"  # websocket whose visitors show a key of their own, and no token
OPEN = {SIGN_IN, HEALTH, "/phone", PHONE} | {
    f"/static/{file}"
    for file in (
        *("style.css", "icon.svg", "signin.js"),
        *("phone.css", "phone.js", "joystick.js", "reconnecting_socket.js"),
    )
}
COOKIE_AGE = 30 * 24 * 3600  # [s]
LOOKING_ONLY = "the view token only looks: driving, pushing and changing take the operator's token"


def role_of(connection: HTTPConnection) -> Role:
    """The role in which a request or a websocket came."""
    return connection.scope.get("walk.role", "operator")


class Token:
    """A token, and the cookie that stands for it."""

    def __init__(self, token: str) -> None:
        """Derive the cookie."""
        self._token = token.encode()
        self.cookie_value = hmac.new(self._token, b"the cookie of walk", hashlib.sha256).hexdigest()
        # Cookies do not tell ports apart: servers of one host must not overwrite each other's.
        self.cookie_name = f"walk-{self.cookie_value[:8]}"

    def has_cookie(self, headers: Headers) -> bool:
        """Whether a request carries the cookie that was given for the token."""
        cookie = _cookies(headers).get(self.cookie_name)
        return cookie is not None and hmac.compare_digest(cookie.value.encode(), self.cookie_value.encode())

    def is_equal(self, given: bytes) -> bool:
        """Whether `given` is the token; takes as long wherever it differs."""
        return hmac.compare_digest(given, self._token)


class Tokens:
    """The tokens by their roles, and what was shown in their place."""

    def __init__(self, operator: str, viewer: str = "") -> None:
        """Take the tokens.

        Args:
            operator: may do everything.
            viewer: may only look; none if it is empty.
        """
        by_role: dict[Role, Token] = {"operator": Token(operator)}
        if viewer:
            by_role["viewer"] = Token(viewer)
        self.by_role: Mapping[Role, Token] = by_role
        self._wrong = WrongTokens()

    def role_by_cookie(self, headers: Headers) -> Role | None:
        """Role of a browser that has signed in, if it has."""
        return self._role_of(lambda token: token.has_cookie(headers))

    def wait(self, address: str) -> float:
        """Time until a token of this address is looked at [s]; wrong ones make it grow."""
        return self._wrong.wait(address, time.monotonic())

    def role_by_token(self, given: bytes, address: str) -> Role | None:
        """Role of a token, which is not looked at before its time has come."""
        if self.wait(address) > 0.0:
            return None
        role = self._role_of(lambda token: token.is_equal(given))
        if role is None:
            self._wrong.count(address, given, time.monotonic())
        return role

    def _role_of(self, is_shown: Callable[[Token], bool]) -> Role | None:
        for role, token in self.by_role.items():
            if is_shown(token):
                return role
        return None


class TokenMiddleware:
    """Refuses requests and websockets that show no token, or one that may not do what they request."""

    def __init__(self, app: ASGIApp, tokens: Tokens) -> None:
        """Guard `app`."""
        self._app, self._tokens = app, tokens

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or refuse: with the form where a person looks at a page, else with 401, 403 or 429."""
        if scope["type"] not in ("http", "websocket") or scope["path"] in OPEN:
            await self._app(scope, receive, send)
            return
        headers, address = Headers(scope=scope), address_of(scope)
        given = _bearer(headers)
        wait = 0.0 if given is None else self._tokens.wait(address)
        role = self._tokens.role_by_cookie(headers)
        if role is None and given is not None:
            role = self._tokens.role_by_token(given, address)
        if role is not None and (role == "operator" or _only_looks(scope)):
            await self._app({**scope, "walk.role": role}, receive, send)
        elif role is not None:
            await refuse(403, LOOKING_ONLY, scope, receive, send)
        elif scope["type"] == "websocket":
            await refuse(401, "the token is missing", scope, receive, send)
        else:
            await _refusal(scope, headers, wait)(scope, receive, send)


def _only_looks(scope: Scope) -> bool:
    return scope["path"] not in COMMANDING if scope["type"] == "websocket" else scope["method"] in READING


def address_of(scope: Scope) -> str:
    """Address of the client of a request or a websocket; "" where it has none."""
    client = scope.get("client")
    return client[0] if client else ""


def _bearer(headers: Headers) -> bytes | None:
    kind, _, given = headers.get("authorization", "").partition(" ")
    return given.strip().encode("latin-1") if kind.lower() == "bearer" else None


def _refusal(scope: Scope, headers: Headers, wait: float) -> Response:
    if wait > 0.0:
        seconds = math.ceil(wait)
        return refusal(429, f"too many wrong tokens; try again in {seconds} s", {"Retry-After": str(seconds)})
    if scope["method"] == "GET" and "text/html" in headers.get("accept", ""):
        query = f"?{scope['query_string'].decode('latin-1')}" if scope["query_string"] else ""
        return RedirectResponse(f"{SIGN_IN}?next={quote(scope['path'] + query, safe='/')}", status_code=303)
    detail = "the token is missing or wrong; send it as Authorization: Bearer TOKEN"
    return refusal(401, detail, {"WWW-Authenticate": "Bearer"})


def _cookies(headers: Headers) -> SimpleCookie:
    try:
        return SimpleCookie(headers.get("cookie", ""))
    except CookieError:
        return SimpleCookie()


def signin_router(tokens: Tokens, form: Path) -> APIRouter:
    """Routes of the form on which a person enters a token, once a browser.

    Args:
        tokens: for which cookies are given.
        form: file of the page.
    """
    router = APIRouter(include_in_schema=False)

    @router.get(SIGN_IN)
    async def show_form() -> FileResponse:
        return FileResponse(form, headers={"Cache-Control": "no-store"})

    @router.post(SIGN_IN)
    async def sign_in(request: Request) -> Response:
        fields, address = parse_qs((await request.body()).decode("latin-1")), address_of(request.scope)
        place = _local_place(fields.get("next", ["/"])[0])
        wait = math.ceil(tokens.wait(address))
        role = tokens.role_by_token(fields.get("token", [""])[0].encode(), address)
        if role is None:
            problem = f"wait={wait}" if wait else "wrong"
            return RedirectResponse(f"{SIGN_IN}?{problem}&next={quote(place, safe='/')}", status_code=303)
        token = tokens.by_role[role]
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
