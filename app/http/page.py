"""Pages that a browser loads: our own with its parts, and that of viser's client."""

import gzip
import hashlib
from dataclasses import dataclass
from functools import cache
from os import PathLike, stat_result
from pathlib import Path

from fastapi import FastAPI, Request, Response
from fastapi.responses import FileResponse
from fastapi.staticfiles import StaticFiles
from starlette.middleware.gzip import GZipMiddleware
from starlette.types import Scope

from app.http.seats import Seats, full_page
from app.viewer import CLIENT_PAGE

STATIC = Path(__file__).parents[2] / "static"
# Without this a browser keeps some of the modules of an older version for days, and mixes them with new ones.
REVALIDATE = {"Cache-Control": "no-cache"}


class PageFiles(StaticFiles):
    """Static files that a browser keeps, and revalidates each time."""

    def file_response(
        self, full_path: str | PathLike[str], stat_result: stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        """The base class's response, with our header on caching."""
        response = super().file_response(full_path, stat_result, scope, status_code)
        response.headers.update(REVALIDATE)
        return response


def install(app: FastAPI, seats: Seats) -> None:
    """Serve the page at `/`, while there is a place for its scene, and its parts, compressed, below `/static`."""

    @app.get("/", include_in_schema=False)
    async def page(request: Request) -> FileResponse:
        if not seats.has_room(request):
            return full_page(STATIC / "full.html")
        return FileResponse(STATIC / "index.html", headers=REVALIDATE)

    @app.get("/phone", include_in_schema=False)
    async def phone() -> FileResponse:
        return FileResponse(STATIC / "phone.html", headers=REVALIDATE)

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
def viser_page() -> ViserPage:
    """The page of viser's client."""
    plain = CLIENT_PAGE.read_bytes()
    return ViserPage(plain, gzip.compress(plain), f'W/"{hashlib.sha256(plain).hexdigest()[:16]}"')
