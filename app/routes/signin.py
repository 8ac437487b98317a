"""The form on which a person shows the token, once a browser."""

import asyncio
from pathlib import Path
from urllib.parse import parse_qs, quote

from fastapi import APIRouter, Request, Response
from fastapi.responses import FileResponse, RedirectResponse

from app.http.token import SIGN_IN, Token

COOKIE_LASTS = 30 * 24 * 3600  # [s]
WRONG_TAKES = 1.0  # [s] so that guessing does


def signin_router(token: Token, form: Path) -> APIRouter:
    """Routes that ask for a token and give the cookie for it."""
    router = APIRouter(include_in_schema=False)

    @router.get(SIGN_IN)
    async def ask() -> FileResponse:
        return FileResponse(form, headers={"Cache-Control": "no-store"})

    @router.post(SIGN_IN)
    async def sign_in(request: Request) -> Response:
        fields = parse_qs((await request.body()).decode("latin-1"))
        place = _place_of_ours(fields.get("next", ["/"])[0])
        if not token.is_equal(fields.get("token", [""])[0].encode()):
            await asyncio.sleep(WRONG_TAKES)
            return RedirectResponse(f"{SIGN_IN}?wrong&next={quote(place, safe='/')}", status_code=303)
        answer = RedirectResponse(place, status_code=303)
        answer.set_cookie(
            token.cookie_name,
            token.cookie_value,
            max_age=COOKIE_LASTS,
            httponly=True,
            samesite="lax",
            secure=request.url.scheme == "https",
        )
        return answer

    return router


def _place_of_ours(place: str) -> str:
    """Where to go on; never to another site, which a second slash of either kind would name."""
    is_ours = place.startswith("/") and not place.startswith(("//", "/\\")) and place.isprintable()
    return place if is_ours else "/"
