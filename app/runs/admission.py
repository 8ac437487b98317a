"""Admission of scenarios from outside: what one may request, before anything of it is simulated.

The core says whether something is a scenario. Here it is only made sure that judging, storing and simulating it takes
no more than the server can give.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from walkcore import robot_names
from walkcore.errors import InvalidValueError
from walkcore.scenario.scenario import Scenario, scenario_from_mapping
from walkcore.values import check_range, check_text

MAX_NESTING = 16  # lists and mappings within each other; a scenario has five
MAX_TEXT = 1000  # characters of a name
MAX_ITEMS = 20_000  # values and keys of a scenario, of whatever kind


@dataclass(frozen=True, slots=True)
class RunLimits:
    """Limits of one run."""

    duration: float = 600.0
    """Simulated time [s]."""
    ticks: int = 120_000
    """Rows of the recording: each takes 3 kB of memory while it is simulated, and 3 kB on the disk."""
    events: int = 1000


def admitted_scenario(data: Mapping[str, Any], limits: RunLimits) -> Scenario:
    """The scenario of a mapping, if it is one and within the limits.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
    """
    _check_size(data)
    events = data.get("events")
    if isinstance(events, list):
        _check_at_most("events", len(events), limits.events)
    robot = data.get("robot", "talos")
    if robot not in robot_names():  # a file on our disk would be one to the core
        raise InvalidValueError("robot", robot, f"must be one of {', '.join(robot_names())}")
    scenario = scenario_from_mapping(data)
    check_range("duration", scenario.duration, 0.0, limits.duration)
    _check_at_most("ticks (duration / control_period)", scenario.nb_ticks, limits.ticks)
    return scenario


def _check_at_most(field: str, count: int, limit: int) -> None:
    if count > limit:
        raise InvalidValueError(field, count, f"must be at most {limit}")


def _check_size(data: Mapping[str, Any]) -> None:
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
            _check_length(text)
        level = [item for item in items if isinstance(item, (Mapping, list))]
    raise InvalidValueError("scenario", "nested values", f"must not be nested more than {MAX_NESTING} deep")


def _items(value: Any) -> list[Any]:
    return [*value.keys(), *value.values()] if isinstance(value, Mapping) else list(value)


def _check_length(text: str) -> None:
    if len(text) > MAX_TEXT:
        raise InvalidValueError("text", text[:20] + "...", f"must be at most {MAX_TEXT} characters")
    check_text("text", text)
