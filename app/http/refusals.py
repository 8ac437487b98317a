"""Refusals in one shape: `{"detail": "...", "errors": [{"field", "value", "limit"}]}`."""

import reprlib
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic_core import ErrorDetails
from starlette.exceptions import HTTPException

from app.http.schemas import ErrorBody, FieldError
from app.live.control import NothingToSaveError, NotPausedError
from app.live.driver_lease import LeaseHeldError
from app.live.messages import NoResponseError
from app.work import NoFileError, UnknownWorkError, WorkUnavailableError
from walkcore.errors import InvalidValueError, WalkError

MAX_ERRORS = 20  # of one body that are reported
MAX_SHOWN = 100  # characters of a refused value that are sent back
LARGEST = 1e300  # of the numbers that are sent back as numbers: an integer may have thousands of digits
MAX_LIMIT = 2000  # characters of its limit, which may name all choices
# The core says reference.vx where the body is the reference: its name of the body, by the last part of the path.
BODIES = {
    "reference": "reference",
    "push": "push",
    "preview": "push",
    "parameters": "parameters",
    "world": "world",
    "speed": "speed",
    "random-pushes": "random_pushes",
    "runs": "scenario",
    "sweeps": "sweep",
}


STATUS: Mapping[type[Exception], int] = {
    WalkError: 422,
    NotPausedError: 409,
    NothingToSaveError: 409,
    NoFileError: 409,
    LeaseHeldError: 409,
    UnknownWorkError: 404,
    NoResponseError: 503,
    WorkUnavailableError: 503,
}
"""Status by which each error of ours is refused."""


def install(app: FastAPI) -> None:
    """Give the refusals of all routes the one shape."""
    app.add_exception_handler(HTTPException, _refuse_request)
    app.add_exception_handler(RequestValidationError, _refuse_body)
    app.add_exception_handler(InvalidValueError, _refuse_value)
    for kind, status in STATUS.items():
        app.add_exception_handler(kind, partial(_refuse, status))


def field_errors(errors: Sequence[Any], outermost: int = 0) -> list[FieldError]:
    """Errors of Pydantic in our shape.

    Args:
        errors: as `ValidationError.errors()` gives them.
        outermost: number of leading parts of a field's path to leave out.
    """
    return [_field_error(error, outermost) for error in errors[:MAX_ERRORS]]


def summary(errors: Sequence[FieldError]) -> str:
    """One line for a person: each field, its value and its limit."""
    return "; ".join(f"{error.field} = {error.value!r}: {error.limit}" for error in errors)


def _field_error(error: ErrorDetails, outermost: int) -> FieldError:
    path = _readable(".".join(str(part) for part in error["loc"][outermost:]))
    if error["type"] == "json_invalid":
        return FieldError(field="body", value=None, limit=f"is not JSON: {error.get('ctx', {}).get('error', '')}")
    if error["type"] == "missing":
        return FieldError(field=path or "body", value=None, limit="is missing")
    if error["type"] == "extra_forbidden":
        return FieldError(field=path, value=_shown(error["input"]), limit="is unknown")
    is_raw = isinstance(error["input"], bytes)
    limit = "must be JSON, sent as Content-Type: application/json" if is_raw else error["msg"]
    return FieldError(field=path or "body", value=_shown(error["input"]), limit=limit)


def _shown(value: Any) -> Any:
    """A refused value as JSON can carry it: NaN, infinities and all that is no plain value as text, none long."""
    is_number = isinstance(value, (int, float)) and abs(value) < LARGEST
    # reprlib, as the text of a deeply nested value is more than Python can write
    text = value if isinstance(value, str) else reprlib.repr(value)
    return value if value is None or is_number else _readable(text)


def _readable(text: str, length: int = MAX_SHOWN) -> str:
    """Text from outside as JSON can carry it, not long."""
    return text[:length].encode(errors="replace").decode()


def _response(
    status: int, detail: str, errors: Sequence[FieldError] = (), headers: Mapping[str, str] | None = None
) -> JSONResponse:
    return JSONResponse(ErrorBody(detail=detail, errors=list(errors)).model_dump(), status, headers)


async def _refuse_request(_: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    if error.status_code == 400:  # only from FastAPI, for JSON that no parser can take: nested or digits beyond limit
        return _response(
            422, error.detail, [FieldError(field="body", value=None, limit="is not JSON that can be read")]
        )
    return _response(error.status_code, error.detail, headers=error.headers)


async def _refuse_body(_: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    errors = field_errors(error.errors(), outermost=1)  # "body" or "query"
    return _response(422, summary(errors), errors)


async def _refuse_value(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, InvalidValueError)
    body = BODIES.get(request.url.path.rpartition("/")[2], "")
    field = _readable(error.field.removeprefix(f"{body}."))
    errors = [FieldError(field=field, value=_shown(error.value), limit=_readable(error.limit, MAX_LIMIT))]
    return _response(422, summary(errors), errors)


async def _refuse(status: int, _: Request, error: Exception) -> JSONResponse:
    headers = {"Retry-After": str(error.RETRY_AFTER)} if isinstance(error, WorkUnavailableError) else None
    return _response(status, _readable(str(error), MAX_LIMIT), headers=headers)
