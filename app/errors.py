"""Refusals in one shape: `{"detail": "...", "errors": [{"field", "value", "limit"}]}`."""

import math
from collections.abc import Sequence
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic_core import ErrorDetails
from starlette.exceptions import HTTPException

from app.runner import NoAnswerError, NotPausedError
from app.schemas import ErrorBody, FieldError
from walkcore.errors import InvalidValueError, WalkError

MAX_SHOWN = 100  # characters of a refused value that are sent back


def install(app: FastAPI) -> None:
    """Give every refusal the one shape."""
    app.add_exception_handler(HTTPException, _refuse_request)
    app.add_exception_handler(RequestValidationError, _refuse_body)
    app.add_exception_handler(InvalidValueError, _refuse_value)
    app.add_exception_handler(WalkError, _refuse_walk)
    app.add_exception_handler(NotPausedError, _refuse_now)
    app.add_exception_handler(NoAnswerError, _cannot_answer)


def field_errors(errors: Sequence[Any], outermost: int = 0) -> list[FieldError]:
    """Pydantic's errors as ours.

    Args:
        errors: as `ValidationError.errors()` gives them.
        outermost: how many of the first parts of a field's path to leave out.
    """
    return [_field_error(error, outermost) for error in errors]


def summary(errors: Sequence[FieldError]) -> str:
    """For a person: each field, its value and its limit."""
    return "; ".join(f"{error.field} = {error.value!r}: {error.limit}" for error in errors)


def _field_error(error: ErrorDetails, outermost: int) -> FieldError:
    path = ".".join(str(part) for part in error["loc"][outermost:])
    if error["type"] == "json_invalid":
        return FieldError(field="body", value=None, limit=f"is not JSON: {error.get('ctx', {}).get('error', '')}")
    if error["type"] == "missing":
        return FieldError(field=path or "body", value=None, limit="is missing")
    if error["type"] == "extra_forbidden":
        return FieldError(field=path, value=_shown(error["input"]), limit="is unknown")
    is_unread = isinstance(error["input"], bytes)
    limit = "must be JSON, sent as Content-Type: application/json" if is_unread else error["msg"]
    return FieldError(field=path or "body", value=_shown(error["input"]), limit=limit)


def _shown(value: Any) -> Any:
    """A refused value as JSON can carry it: NaN, infinities and what is not a plain value as text, none long."""
    is_number = isinstance(value, (int, float)) and abs(value) < math.inf
    return value if value is None or is_number else str(value)[:MAX_SHOWN]


def _answer(status: int, detail: str, errors: Sequence[FieldError] = ()) -> JSONResponse:
    return JSONResponse(ErrorBody(detail=detail, errors=list(errors)).model_dump(), status_code=status)


async def _refuse_request(_: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    return _answer(error.status_code, error.detail)


async def _refuse_body(_: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    errors = field_errors(error.errors(), outermost=1)  # "body" or "query"
    return _answer(422, summary(errors), errors)


async def _refuse_value(_: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, InvalidValueError)
    # The core says reference.vx; here the body is the reference.
    field = error.field.partition(".")[2] or error.field
    errors = [FieldError(field=field, value=_shown(error.value), limit=error.limit)]
    return _answer(422, summary(errors), errors)


async def _refuse_walk(_: Request, error: Exception) -> JSONResponse:
    return _answer(422, str(error))


async def _cannot_answer(_: Request, error: Exception) -> JSONResponse:
    return _answer(503, str(error))


async def _refuse_now(_: Request, error: Exception) -> JSONResponse:
    return _answer(409, str(error))
