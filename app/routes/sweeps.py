"""Sweeps: send one, follow it, see what came of it."""

from collections.abc import AsyncIterable
from typing import Any, Literal

from fastapi import APIRouter, Response
from fastapi.responses import FileResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent

from app.http.guards import MAX_BODY
from app.http.schemas import ErrorBody
from app.http.sweep_schemas import SWEEP, SweepBody, SweepSummary, sweep_address
from app.routes.dependencies import AllSweeps, KnownSweep, RoomToFollowSweeps
from app.routes.scripted_runs import BUSY, REFUSED, file_response

UNKNOWN: dict[int | str, dict[str, Any]] = {404: {"model": ErrorBody, "description": "There is no such sweep."}}
MEDIA_TYPES = {
    "sweep.html": "text/html",
    "sweep.json": "application/json",
    "cells.parquet": "application/vnd.apache.parquet",
}
ALLOWED = "allow-scripts allow-downloads allow-popups allow-popups-to-escape-sandbox"
"""Rights of the page of a sweep, which is none of ours: to save a scenario, and to open one in a page of ours."""
Name = Literal[tuple(MEDIA_TYPES)]

router = APIRouter(
    prefix="/api/v1/sweeps", tags=["sweeps"], responses={422: {"model": ErrorBody, "description": "Bad input."}}
)


@router.post(
    "",
    status_code=202,
    responses={
        202: {"headers": {"Location": {"description": "Address of the sweep.", "schema": {"type": "string"}}}},
        413: {"model": ErrorBody, "description": f"The body is longer than {MAX_BODY} bytes."},
        422: {"model": ErrorBody, "description": "Not a sweep, or beyond a limit: the field, its value and the limit."},
        503: BUSY | {"description": "Too many sweeps wait already, or the disk takes no more."},
    },
    openapi_extra={"requestBody": {"content": {"application/json": {"schema": SWEEP}}}},
)
def submit(sweep: dict[str, Any], sweeps: AllSweeps, response: Response) -> SweepBody:
    """Find how hard robots can be pushed, as `walk sweep` does with a file of the same content; responds at once."""
    posted = sweeps.submit(sweep)
    response.headers["Location"] = sweep_address(posted.id)
    return SweepBody.model_validate(posted)


@router.get("")
def all_sweeps(sweeps: AllSweeps) -> list[SweepSummary]:
    """All sweeps that are kept, the latest first."""
    return [SweepSummary.model_validate(sweep) for sweep in sweeps.list()]


@router.get("/{sweep_id}", responses=UNKNOWN)
def one_sweep(sweep: KnownSweep) -> SweepBody:
    """The state of a sweep: queued, running with its finished cells, done, failed with the reason, or cancelled."""
    return SweepBody.model_validate(sweep)


@router.delete(
    "/{sweep_id}",
    response_model=SweepBody,
    responses=UNKNOWN
    | {204: {"description": "It is removed."}, 503: BUSY | {"description": "The disk lets no file be removed."}},
)
def delete(sweep_id: str, sweeps: AllSweeps) -> SweepBody | Response:
    """Cancel a sweep that has not ended (200, and it is kept as cancelled); remove one that has, files too (204)."""
    if sweeps.delete(sweep_id).has_ended:
        return Response(status_code=204)
    return SweepBody.model_validate(sweeps.get(sweep_id))


@router.get(
    "/{sweep_id}/events",
    response_class=EventSourceResponse,
    responses={
        404: REFUSED | {"description": "There is no such sweep."},
        422: REFUSED | {"description": "Bad input."},
        503: REFUSED | {"description": "Too many streams are open."},
    },
)
async def events(sweep: KnownSweep, followed: RoomToFollowSweeps) -> AsyncIterable[ServerSentEvent]:
    """Follow a sweep by server-sent events: its state, whenever that changes, until it has ended."""
    async for summary in followed.summaries(SweepSummary.model_validate(sweep)):
        yield ServerSentEvent(data=summary)


@router.get(
    "/{sweep_id}/{name}",
    response_class=FileResponse,
    responses=UNKNOWN | {409: {"model": ErrorBody, "description": "The sweep is not done: it has no files."}},
)
def file(
    sweep: KnownSweep,
    name: Name,  # pyright: ignore[reportInvalidTypeForm]  # the names above
    sweeps: AllSweeps,
) -> FileResponse:
    """A file of a sweep, as `walk sweep` writes it; `sweep.html` is a page, where a click on a cell tells of it."""
    return file_response(sweep, sweeps.file(sweep, name), f"-{name}", MEDIA_TYPES[name], ALLOWED)
