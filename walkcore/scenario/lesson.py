"""Lessons: a question, a choice of answers, and the walks whose metrics decide between them.

A lesson is a file `NAME.md`: YAML between two lines of `---`, then Markdown. What comes before a line
`## What happened` is read before the guess, the rest after it. The right answer is not the one that the file says, but
that whose expectations all hold for the metrics of the walks.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, cast

from walkcore.errors import InvalidValueError, WalkError
from walkcore.named_files import named_file, shipped_files
from walkcore.plain_yaml import parse_yaml
from walkcore.scenario.expectations import METRICS, Expectation, Verdict, expectations_from_mapping
from walkcore.scenario.scenario import Scenario, scenario_from_mapping
from walkcore.values import check_choice, check_keys, check_mapping, check_text

MAX_BYTES = 50_000  # of a file
MAX_WALKS, MAX_CHOICES = 4, 6
FENCE = "---"
AFTER = "## What happened"
KEYS = {"title", "question", "walks", "choices", "answer", "show"}


@dataclass(frozen=True, slots=True)
class Choice:
    """One answer to guess, and what has to be measured for it to be right."""

    name: str
    text: str
    expectations: Mapping[str, tuple[Expectation, ...]]
    """Expectations of each walk, by its name."""

    def verdicts(self, metrics: Mapping[str, Mapping[str, Any]]) -> dict[str, list[Verdict]]:
        """The verdicts on its expectations, by the name of the walk.

        Args:
            metrics: of each walk of the lesson, by its name.
        """
        return {walk: [each.verdict(metrics[walk]) for each in of] for walk, of in self.expectations.items()}

    def holds(self, metrics: Mapping[str, Mapping[str, Any]]) -> bool:
        """Whether it is right, by the metrics of each walk; see `verdicts`."""
        return all(verdict.holds for of in self.verdicts(metrics).values() for verdict in of)


@dataclass(frozen=True, slots=True, eq=False)
class Lesson:
    """A question that an experiment answers."""

    name: str
    """Name of its file without the ending, by which lessons are sorted."""
    title: str
    question: str
    before: str
    """Markdown to be read before the guess."""
    after: str
    """Markdown to be read once the walks have been judged."""
    walks: Mapping[str, Scenario]
    """The experiment: scenarios by their names in the lesson, each with a title for its name."""
    choices: Mapping[str, Choice]
    answer: str
    """Name of the choice that the text explains. The metrics decide; a test holds the text to them."""
    show: tuple[str, ...]
    """Metrics that are shown once the walks have been judged."""

    def right(self, metrics: Mapping[str, Mapping[str, Any]]) -> list[str]:
        """Names of the choices that the metrics of the walks prove right; see `Choice.verdicts`."""
        return [name for name, choice in self.choices.items() if choice.holds(metrics)]


def lesson_files(folder: Path | None = None) -> dict[str, Traversable]:
    """File of each lesson by its name, in the order of the names.

    Args:
        folder: of further lessons, one of which takes the place of a shipped one of its name.
    """
    found = shipped_files("lessons")
    if folder is not None:
        found |= {path.stem: path for path in folder.expanduser().iterdir() if path.suffix == ".md"}
    return dict(sorted(found.items()))


def load_lesson(name_or_path: str | Path) -> Lesson:
    """A lesson that ships, by its name, or one from a file.

    Raises:
        UnknownNameError: if there is neither a file nor a shipped lesson of that name.
        InvalidValueError: if the file does not describe a lesson.
        OSError: if it cannot be read.
    """
    file = named_file("lesson", name_or_path, lesson_files())
    return read_lesson(Path(str(file)).stem, file)


def read_lesson(name: str, file: Traversable) -> Lesson:
    """The lesson of a file.

    Args:
        name: that it gets.
        file: to be read.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
        OSError: if it cannot be read.
    """
    with file.open("rb") as stream:
        content = stream.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise InvalidValueError("lesson", str(file), f"must be at most {MAX_BYTES} bytes")
    try:
        text = content.decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise InvalidValueError("lesson", str(file), f"must be UTF-8: {error.reason}") from error
    opening, _, rest = text.partition("\n")
    front, end, markdown = rest.partition(f"\n{FENCE}\n")
    if opening != FENCE or not end:
        raise InvalidValueError("lesson", str(file), f"must begin with YAML between two lines of {FENCE}")
    before, there_is, after = markdown.partition(f"{AFTER}\n")
    if not there_is:
        raise InvalidValueError("lesson", str(file), f"must have a line {AFTER!r} in its Markdown")
    return _lesson(name, parse_yaml(front.encode(), "lesson", str(file)), before.strip(), after.strip())


def _lesson(name: str, data: Any, before: str, after: str) -> Lesson:
    data = check_mapping("lesson", data)
    check_keys("lesson", data, KEYS)
    walks = {walk: _walk(walk, of) for walk, of in _some("walks", data, 1, MAX_WALKS).items()}
    choices = {key: _choice(key, of, set(walks)) for key, of in _some("choices", data, 2, MAX_CHOICES).items()}
    return Lesson(
        name=name,
        title=_text("title", data.get("title")),
        question=_text("question", data.get("question")),
        before=before,
        after=after,
        walks=walks,
        choices=choices,
        answer=check_choice("answer", data.get("answer"), choices),
        show=_metrics(data.get("show") or []),
    )


def _metrics(value: Any) -> tuple[str, ...]:
    names = tuple(cast(list[Any], value)) if isinstance(value, list) else ("",)
    if not all(name in tuple(METRICS) for name in names):  # a tuple takes what a dictionary cannot hash
        raise InvalidValueError("show", cast(object, value), f"must be a list of {', '.join(METRICS)}")
    return names


def _some(field: str, data: Mapping[str, Any], least: int, most: int) -> dict[str, Any]:
    values = check_mapping(field, data.get(field))
    if not least <= len(values) <= most:
        raise InvalidValueError(field, len(values), f"must be {least} to {most}")
    return values


def _text(field: str, value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise InvalidValueError(field, value, "must be a text")
    check_text(field, value)
    return value


def _walk(walk: str, data: Any) -> Scenario:
    values = check_mapping(f"walks.{walk}", data)
    _text(f"walks.{walk}.name", values.get("name"))
    try:
        return scenario_from_mapping(values)
    except InvalidValueError as error:
        raise InvalidValueError(f"walks.{walk}.{error.field}", error.value, error.limit) from error
    except WalkError as error:  # there is no such robot
        raise InvalidValueError(f"walks.{walk}", values.get("robot"), str(error)) from error


def _choice(name: str, data: Any, walks: set[str]) -> Choice:
    where = f"choices.{name}"
    values = check_mapping(where, data)
    check_keys(where, values, {"text", "expect"})
    expect = check_mapping(f"{where}.expect", values.get("expect"))
    check_keys(f"{where}.expect", expect, walks)
    try:
        expectations = {walk: expectations_from_mapping(of) for walk, of in expect.items()}
    except InvalidValueError as error:
        raise InvalidValueError(f"{where}.{error.field}", error.value, error.limit) from error
    if not any(expectations.values()):
        raise InvalidValueError(f"{where}.expect", expect, "must bound a metric of a walk, or any walk would prove it")
    return Choice(name, _text(f"{where}.text", values.get("text")), expectations)
