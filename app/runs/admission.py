"""Admission of scenarios from outside: what one may request, before anything of it is simulated.

The core says whether something is a scenario. Here it is only made sure that judging, storing and simulating it takes
no more than the server can give.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.robot_choices import RobotChoices
from walkcore.errors import InvalidValueError
from walkcore.plain_yaml import check_size
from walkcore.scenario.scenario import Scenario, scenario_from_mapping
from walkcore.values import check_range

MAX_VALUES = 20_000  # values and keys of a scenario, of whatever kind


@dataclass(frozen=True, slots=True)
class RunLimits:
    """Limits of one run."""

    duration: float = 600.0
    """Simulated time [s]."""
    ticks: int = 120_000
    """Rows of the recording: each takes 3 kB of memory while it is simulated, and 3 kB on the disk."""
    events: int = 1000


def admitted_scenario(data: Mapping[str, Any], limits: RunLimits, choices: RobotChoices | None = None) -> Scenario:
    """The scenario of a mapping, if it is one and within the limits.

    Args:
        data: its mapping, with the name of a robot.
        limits: of a run.
        choices: robots that it may name, by default those that ship; in the scenario stands what `load_robot` takes.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
    """
    check_size("scenario", data, MAX_VALUES)
    events = data.get("events")
    if isinstance(events, list):
        _check_at_most("events", len(events), limits.events)
    if "robot" in data:  # as a name: a path would be one on our disk
        data = {**data, "robot": (choices or RobotChoices()).load(data["robot"]).source}
    scenario = scenario_from_mapping(data)
    check_range("duration", scenario.duration, 0.0, limits.duration)
    _check_at_most("ticks (duration / control_period)", scenario.nb_ticks, limits.ticks)
    return scenario


def _check_at_most(field: str, count: int, limit: int) -> None:
    if count > limit:
        raise InvalidValueError(field, count, f"must be at most {limit}")
