"""What a scenario from a stranger may ask for, before anything of it is simulated."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from walkcore.errors import InvalidValueError, UnknownNameError
from walkcore.scenario.scenario import Scenario, scenario_from_mapping
from walkcore.values import check_range, check_text

MAX_NESTING = 16  # lists and mappings within each other; a scenario has five
MAX_TEXT = 1000  # characters of a name
MAX_ITEMS = 20_000  # values and keys of a scenario, of whatever kind


@dataclass(frozen=True, slots=True)
class Limits:
    """Of one run."""

    duration: float = 600.0
    """[s]."""
    ticks: int = 120_000
    """Rows of the recording: each takes 3 kB of memory while it is simulated, and 3 kB on the disk."""
    events: int = 1000


def checked_scenario(data: Mapping[str, Any], limits: Limits) -> Scenario:
    """The scenario, if it is one and not too much.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
    """
    _check_plain(data)
    events = data.get("events")
    if isinstance(events, list):
        _check_at_most("events", len(events), limits.events)
    try:
        scenario = scenario_from_mapping(data)
    except UnknownNameError as error:
        limit = f"must be one of {', '.join(error.choices)}"
        raise InvalidValueError(error.kind, error.name, limit) from error
    check_range("duration", scenario.duration, 0.0, limits.duration)
    _check_at_most("ticks (duration / control_period)", scenario.nb_ticks, limits.ticks)
    return scenario


def _check_at_most(field: str, count: int, limit: int) -> None:
    if count > limit:
        raise InvalidValueError(field, count, f"must be at most {limit}")


def _check_plain(data: Mapping[str, Any]) -> None:
    """Refuse what could not be stored, shown in a message or walked through later.

    Raises:
        InvalidValueError: for values nested too deeply, too many of them, text too long or not Unicode.
    """
    level: list[Any] = [data]
    nb_items = 0
    for _ in range(MAX_NESTING):
        if not level:
            return
        items = [item for value in level for item in _items(value)]
        nb_items += len(items)
        _check_at_most("number of values", nb_items, MAX_ITEMS)
        for text in (item for item in items if isinstance(item, str)):
            _check_text(text)
        level = [item for item in items if isinstance(item, (Mapping, list))]
    raise InvalidValueError("scenario", "nested values", f"must not be nested more than {MAX_NESTING} deep")


def _items(value: Any) -> list[Any]:
    return [*value.keys(), *value.values()] if isinstance(value, Mapping) else list(value)


def _check_text(text: str) -> None:
    if len(text) > MAX_TEXT:
        raise InvalidValueError("text", text[:20] + "...", f"must be at most {MAX_TEXT} characters")
    check_text("text", text)
