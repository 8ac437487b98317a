"""Scripted runs: send a scenario, follow its run, download its recording."""

import re
from collections.abc import AsyncIterable
from pathlib import Path
from typing import Any, Literal

from fastapi import APIRouter, Response
from fastapi.responses import FileResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent

from app.formats import FORMATS
from app.formats.stored_run import read_run
from app.http.guards import MAX_BODY
from app.http.run_schemas import RunBody, RunSummary, address
from app.http.scenario_schema import request_schema
from app.http.schemas import ErrorBody, TimelineBody
from app.routes.dependencies import AllRuns, KnownRun, RoomToFollow
from app.routes.past_run import run_timeline
from app.runs import Run, Runs
from app.work import Work

BUSY: dict[str, Any] = {
    "model": ErrorBody,
    "headers": {"Retry-After": {"description": "[s]", "schema": {"type": "integer"}}},
}
UNKNOWN: dict[int | str, dict[str, Any]] = {404: {"model": ErrorBody, "description": "There is no such run."}}

Ending = Literal[tuple(FORMATS)]

router = APIRouter(
    prefix="/api/v1/runs", tags=["runs"], responses={422: {"model": ErrorBody, "description": "Bad input."}}
)


@router.post(
    "",
    status_code=202,
    responses={
        202: {"headers": {"Location": {"description": "Address of the run.", "schema": {"type": "string"}}}},
        413: {"model": ErrorBody, "description": f"The body is longer than {MAX_BODY} bytes."},
        422: {
            "model": ErrorBody,
            "description": "Not a scenario, or beyond a limit: the field, its value and the limit.",
        },
        503: BUSY | {"description": "Too many runs wait already, or the disk takes no more."},
    },
    openapi_extra={"requestBody": {"content": {"application/json": {"schema": request_schema()}}}},
)
def submit(scenario: dict[str, Any], runs: AllRuns, response: Response) -> RunBody:
    """Simulate a scenario, as `walk run` does with a file of the same content; responds at once."""
    run = runs.submit(scenario)
    response.headers["Location"] = address(run.id)
    return RunBody.model_validate(run)


@router.get("")
def all_runs(runs: AllRuns) -> list[RunSummary]:
    """All runs that are kept, the latest first."""
    return [RunSummary.model_validate(run) for run in runs.list()]


@router.get("/{run_id}", responses=UNKNOWN)
def one_run(run: KnownRun) -> RunBody:
    """The state of a run: queued, running with progress, done with metrics, failed with the reason, or cancelled."""
    return RunBody.model_validate(run)


@router.delete(
    "/{run_id}",
    response_model=RunBody,
    responses=UNKNOWN
    | {204: {"description": "It is removed."}, 503: BUSY | {"description": "The disk lets no file be removed."}},
)
def delete(run_id: str, runs: AllRuns) -> RunBody | Response:
    """Cancel a run that has not ended (200, and it is kept as cancelled); remove one that has, files and all (204)."""
    if runs.delete(run_id).has_ended:
        return Response(status_code=204)
    return RunBody.model_validate(runs.get(run_id))


# FastAPI would say that refusals, too, are event streams.
REFUSED = {"content": {"application/json": {"schema": {"$ref": "#/components/schemas/ErrorBody"}}}}


@router.get(
    "/{run_id}/events",
    response_class=EventSourceResponse,
    responses={
        404: REFUSED | {"description": "There is no such run."},
        422: REFUSED | {"description": "Bad input."},
        503: REFUSED | {"description": "Too many streams are open."},
    },
)
async def events(run: KnownRun, followed: RoomToFollow) -> AsyncIterable[ServerSentEvent]:
    """Follow a run by server-sent events: its state, whenever that changes, until it has ended."""
    async for summary in followed.summaries(RunSummary.model_validate(run)):
        yield ServerSentEvent(data=summary)


NO_RECORDING = UNKNOWN | {409: {"model": ErrorBody, "description": "The run is not done: it has no files."}}


@router.get(
    "/{run_id}/recording.{ending}",
    response_class=FileResponse,
    responses=NO_RECORDING | {503: BUSY | {"description": "Too many files are being made."}},
)
def recording(
    run: KnownRun,
    ending: Ending,  # pyright: ignore[reportInvalidTypeForm]  # the registry's names
    runs: AllRuns,
) -> FileResponse:
    """The recording, the same bytes as from `walk run`; other formats than npz and csv are made on first request."""
    return _download(run, f"recording.{ending}", runs)


@router.get("/{run_id}/timeline", responses=NO_RECORDING)
def run_ticks(run: KnownRun, runs: AllRuns) -> TimelineBody:
    """The ticks of a run, with marks at its pushes and its fall; `WS /api/v1/live/look` shows them in a scene."""
    return run_timeline(read_run(runs.file(run.id, "run.json").parent))


@router.get("/{run_id}/run.json", response_class=FileResponse, responses=NO_RECORDING)
def run_json(run: KnownRun, runs: AllRuns) -> FileResponse:
    """Scenario, all parameters in force, versions and metrics: the same bytes as from `walk run`."""
    return _download(run, "run.json", runs)


def _download(run: Run, name: str, runs: Runs) -> FileResponse:
    """A file, named after the scenario."""
    media_type = next((form.media_type for form in FORMATS.values() if form.file == name), "application/json")
    return file_response(run, runs.file(run.id, name), f".{name.rpartition('.')[2]}", media_type, "allow-scripts")


def file_response(work: Work, path: Path, ending: str, media_type: str, rights: str) -> FileResponse:
    """A file of a run or a sweep, named after it: a page opens, anything else is saved.

    Args:
        work: whose file it is.
        path: of the file.
        ending: of the name that it is saved under, behind the name and the id of the run or the sweep.
        media_type: of the file.
        rights: of a page, which is none of ours: words of a Content-Security-Policy's sandbox.
    """
    stem = re.sub(r"[^\w.-]+", "-", work.name)[:60]
    return FileResponse(
        path,
        media_type=media_type,
        filename=f"{stem}-{work.id[:8]}{ending}",
        content_disposition_type="inline" if ending.endswith(".html") else "attachment",
        headers={"Content-Security-Policy": f"sandbox {rights}"},
    )
