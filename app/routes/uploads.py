"""Uploaded recordings: a file from anywhere becomes a run, to look at in the page like any other."""

import asyncio
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from starlette.exceptions import HTTPException

from app.http.guards import UPLOAD, announced_length, too_long
from app.http.run_schemas import RunBody, address
from app.http.schemas import ErrorBody
from app.routes.dependencies import AllRuns, LiveSwitch
from app.routes.scripted_runs import BUSY

RATE = 40e6  # bytes a second that are read of one upload: more would leave the loop little time for pictures
FILE = "upload"

router = APIRouter(tags=["runs"])


@router.post(
    UPLOAD,
    status_code=201,
    responses={
        201: {"headers": {"Location": {"description": "Address of the run.", "schema": {"type": "string"}}}},
        413: {"model": ErrorBody, "description": "The file is longer than `UPLOADS_MAX_BYTES`."},
        422: {"model": ErrorBody, "description": "Not a recording, or beyond a limit: field, value and limit."},
        503: BUSY | {"description": "Too many files are being uploaded, or the disk takes no more."},
    },
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
async def upload(
    request: Request,
    runs: AllRuns,
    switch: LiveSwitch,
    response: Response,
    name: Annotated[str, Query(max_length=200, description="Name of the run; empty for that of its scenario.")] = "",
    robot: Annotated[
        str, Query(max_length=100, description="Robot that walked, where the file does not tell; else the one here.")
    ] = "",
) -> RunBody:
    """Keep a recording as a run that is done: .npz, .csv, .parquet, .mcap, or a .zip of one with its run.json.

    The body is the file itself; its first bytes tell which of these it is. Parquet and MCAP carry their run.json.
    Without one there is something to look at, and no tick to go on from.
    """
    with runs.uploads.place(), runs.draft() as draft:
        await _receive(request, draft / FILE, runs.upload_limits.bytes)
        walked = robot or switch.runner.robot.name
        run = await asyncio.to_thread(runs.add_upload, draft / FILE, name, walked)
    response.headers["Location"] = address(run.id)
    return RunBody.model_validate(run)


async def _receive(request: Request, path: Path, max_bytes: int) -> None:
    """Write a body to a file, as it comes."""
    nb_bytes = announced_length(request.scope)
    if nb_bytes > max_bytes:
        raise HTTPException(413, too_long(max_bytes))
    nb_bytes = 0
    with path.open("wb") as file:
        async for chunk in request.stream():
            nb_bytes += len(chunk)
            if nb_bytes > max_bytes:
                raise HTTPException(413, too_long(max_bytes))
            await asyncio.to_thread(file.write, chunk)
            await asyncio.sleep(len(chunk) / RATE)
