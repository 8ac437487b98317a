"""Lessons: what they ask, and what their experiments say."""

import logging
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, HTTPException, Query
from fastapi import Path as InPath

from app.http.lesson_schemas import LessonBody, LessonOutcome, lesson_body, lesson_outcome
from app.http.schemas import ErrorBody
from app.routes.dependencies import AllRuns, LessonFolder
from app.work import NoFileError
from walkcore.errors import InvalidValueError, WalkError
from walkcore.scenario.lesson import MAX_WALKS, Lesson, lesson_files, read_lesson

logger = logging.getLogger(__name__)
Name = Annotated[str, InPath(max_length=100)]
RunIds = Annotated[list[str], Query(max_length=MAX_WALKS, description="Runs of the lesson's walks, in their order.")]

router = APIRouter(prefix="/api/v1/lessons", tags=["lessons"], responses={422: {"model": ErrorBody}})


@router.get("")
def lessons(folder: LessonFolder) -> list[LessonBody]:
    """All lessons in their order, without the answers; a file that is no lesson is left out, and named in the log."""
    found: list[Lesson] = []
    for name, file in _files(folder).items():
        try:
            found.append(read_lesson(name, file))
        except (WalkError, OSError) as error:
            logger.warning("%s is no lesson: %s", name, error)
    return [lesson_body(lesson) for lesson in found]


@router.get(
    "/{name}/outcome",
    responses={
        404: {"model": ErrorBody, "description": "There is no such lesson, or no such run."},
        409: {"model": ErrorBody, "description": "A run is not done."},
    },
)
def outcome(name: Name, run: RunIds, runs: AllRuns, folder: LessonFolder) -> LessonOutcome:
    """Outcome of an experiment by the metrics of its runs: which choices are right, and why."""
    files = _files(folder)
    if name not in files:
        raise HTTPException(404, f"no lesson {name!r}; there are: {', '.join(files)}")
    lesson = read_lesson(name, files[name])
    if len(run) != len(lesson.walks):
        raise InvalidValueError("run", len(run), f"must be {len(lesson.walks)} runs, one for each walk")
    metrics: dict[str, Any] = {}
    for (walk, scenario), run_id in zip(lesson.walks.items(), run, strict=True):
        done = runs.get(run_id)
        if done.source != scenario.source:
            raise InvalidValueError("run", run_id, f"must be a run of the walk {walk}, as the lesson has it")
        if done.metrics is None:
            raise NoFileError(f"run {run_id} is {done.status}: it has no metrics")
        metrics[walk] = done.metrics
    return lesson_outcome(lesson, metrics)


def _files(folder: Path | None) -> dict[str, Any]:
    try:
        return lesson_files(folder)
    except OSError as error:
        logger.warning("no further lessons: %s", error)
        return lesson_files()
