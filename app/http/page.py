"""The page's own files, packed where the browser takes it, and asked after at every visit.

Without a word on caching a browser keeps some of the modules of an older version for
days, and mixes them with new ones.
"""

from os import PathLike, stat_result
from pathlib import Path

from fastapi import FastAPI
from fastapi.responses import FileResponse, Response
from fastapi.staticfiles import StaticFiles
from starlette.middleware.gzip import GZipMiddleware
from starlette.types import Scope

STATIC = Path(__file__).parents[2] / "static"
ALWAYS_ASK = {"Cache-Control": "no-cache"}


class PageFiles(StaticFiles):
    """Static files that a browser keeps, and asks after each time."""

    def file_response(
        self, full_path: str | PathLike[str], stat_result: stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        """As the base class answers, with a word on caching."""
        response = super().file_response(full_path, stat_result, scope, status_code)
        response.headers.update(ALWAYS_ASK)
        return response


def install(app: FastAPI) -> None:
    """Serve the page at `/` and its parts below `/static`."""

    @app.get("/", include_in_schema=False)
    async def page() -> FileResponse:
        return FileResponse(STATIC / "index.html", headers=ALWAYS_ASK)

    app.mount("/static", GZipMiddleware(PageFiles(directory=STATIC)), name="static")
