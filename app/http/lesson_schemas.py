"""Lessons as JSON, their Markdown as HTML."""

from collections.abc import Mapping
from functools import cache
from typing import Any

from markdown_it import MarkdownIt
from pydantic import BaseModel, Field

from walkcore.scenario.expectations import METRICS
from walkcore.scenario.lesson import Lesson


class LessonWalk(BaseModel):
    """One walk of a lesson's experiment."""

    name: str
    scenario: dict[str, Any] = Field(description="What `POST /api/v1/runs` takes; its name is the walk's title.")


class LessonChoice(BaseModel):
    """One answer to guess."""

    name: str
    text: str


class LessonBody(BaseModel):
    """A lesson as it is read before the guess: without its answer."""

    name: str
    title: str
    before: str = Field(description="What to read before the guess; HTML.")
    question: str
    choices: list[LessonChoice]
    walks: list[LessonWalk]


class LessonVerdict(BaseModel):
    """An expectation of a choice, and what was measured."""

    walk: str
    expectation: str
    bound: float | bool
    measured: float | bool | None
    holds: bool


class LessonMeasurement(BaseModel):
    """A metric of all walks of a lesson."""

    metric: str
    meaning: str
    values: dict[str, float | None] = Field(description="By the name of the walk.")


class LessonOutcome(BaseModel):
    """Outcome of the experiment of a lesson."""

    right: list[str] = Field(description="Names of the choices all of whose expectations hold.")
    answer: str = Field(description="The choice that the text explains.")
    verdicts: dict[str, list[LessonVerdict]] = Field(description="By the name of the choice.")
    measured: list[LessonMeasurement]
    after: str = Field(description="What to read after the experiment; HTML.")


def lesson_body(lesson: Lesson) -> LessonBody:
    """A lesson before the guess."""
    return LessonBody(
        name=lesson.name,
        title=lesson.title,
        before=_html(lesson.before),
        question=lesson.question,
        choices=[LessonChoice(name=choice.name, text=choice.text) for choice in lesson.choices.values()],
        walks=[LessonWalk(name=name, scenario=dict(walk.source)) for name, walk in lesson.walks.items()],
    )


def lesson_outcome(lesson: Lesson, metrics: Mapping[str, Mapping[str, Any]]) -> LessonOutcome:
    """Outcome of the walks of a lesson.

    Args:
        lesson: that was tried.
        metrics: of each walk, by its name.
    """
    return LessonOutcome(
        right=lesson.right(metrics),
        answer=lesson.answer,
        verdicts={
            name: [
                LessonVerdict(walk=walk, expectation=v.name, bound=v.bound, measured=v.measured, holds=v.holds)
                for walk, verdicts in choice.verdicts(metrics).items()
                for v in verdicts
            ]
            for name, choice in lesson.choices.items()
        },
        measured=[
            LessonMeasurement(
                metric=each, meaning=METRICS[each], values={walk: of[each] for walk, of in metrics.items()}
            )
            for each in lesson.show
        ],
        after=_html(lesson.after),
    )


@cache
def _html(markdown: str) -> str:
    # HTML within the Markdown is shown as text, and links to scripts are none: files may come from anybody.
    return MarkdownIt("commonmark", {"html": False}).render(markdown)
