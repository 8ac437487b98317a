"""A scripted walk: references and pushes at given times, read from YAML or from its JSON equivalent."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, cast

import yaml

from walkcore.command import Command, Push, Reference
from walkcore.errors import InvalidValueError, UnknownNameError
from walkcore.parameters import Parameters
from walkcore.robot import Robot, load_robot
from walkcore.values import check_keys, check_range

SCENARIOS = files("walkcore") / "scenarios"
MAX_DURATION = 3600.0  # [s]


@dataclass(frozen=True, slots=True, eq=False)
class Event:
    """What changes at one time. The reference holds until the next event that has one."""

    t: float
    """[s]."""
    reference: Reference | None = None
    push: Push | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """A robot, its parameters, and what is asked of it."""

    name: str
    robot: Robot
    duration: float
    """[s]."""
    parameters: Parameters
    events: tuple[Event, ...]
    source: Mapping[str, Any]
    """The mapping that it was read from."""

    @property
    def nb_ticks(self) -> int:
        """Ticks that the scenario lasts."""
        return round(self.duration / self.parameters.control_period)

    def commands(self) -> Iterator[Command]:
        """One command a tick. Of several pushes within one tick, all are given, one a tick."""
        reference, waiting = Reference(), list(self.events)
        pushes: list[Push] = []
        for tick in range(self.nb_ticks):
            while waiting and self._tick(waiting[0].t) <= tick:
                event = waiting.pop(0)
                reference = event.reference or reference
                pushes += [event.push] if event.push is not None else []
            yield Command(reference, pushes.pop(0) if pushes else None)

    def _tick(self, t: float) -> int:
        """The first tick that is not before `t`."""
        return math.ceil(t / self.parameters.control_period - 1e-6)


def scenario_names() -> list[str]:
    """Names of the scenarios that ship."""
    return sorted(Path(str(entry)).stem for entry in SCENARIOS.iterdir() if str(entry).endswith(".yaml"))


def load_scenario(name_or_path: str | Path) -> Scenario:
    """A scenario that ships, by its name, or one from a YAML or JSON file.

    Raises:
        UnknownNameError: if there is neither a file nor a shipped scenario of that name.
        InvalidValueError: if the file does not describe a scenario.
    """
    path = Path(name_or_path)
    if str(name_or_path) in scenario_names():
        text = (SCENARIOS / f"{name_or_path}.yaml").read_text(encoding="utf-8")
    elif path.is_file():
        text = path.read_text(encoding="utf-8")
    else:
        raise UnknownNameError("scenario", str(name_or_path), scenario_names())
    try:
        return scenario_from_mapping(yaml.load(text, Loader=_Loader))  # noqa: S506 (a SafeLoader)
    except yaml.YAMLError as error:
        raise InvalidValueError("scenario", str(name_or_path), f"is not YAML: {error}") from error


def scenario_from_mapping(data: Any) -> Scenario:
    """A scenario from plain values, as YAML or JSON gives them.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
        UnknownNameError: if there is no such robot.
    """
    data = _mapping("scenario", data)
    check_keys("scenario", data, {"name", "robot", "duration", "parameters", "events"})
    if not isinstance(data.get("name", "unnamed"), str):
        raise InvalidValueError("name", data["name"], "must be text")
    robot = load_robot(str(data.get("robot", "talos")))
    parameters = Parameters.from_mapping(_mapping("parameters", data.get("parameters") or {}))
    duration = check_range("duration", data.get("duration"), parameters.control_period, MAX_DURATION)
    listed: Any = data.get("events") or []
    if not isinstance(listed, list):
        raise InvalidValueError("events", listed, "must be a list")
    events = [_event(f"events[{i}]", item, robot, duration) for i, item in enumerate(cast(list[Any], listed))]
    return Scenario(
        name=data.get("name", "unnamed"),
        robot=robot,
        duration=duration,
        parameters=parameters,
        events=tuple(sorted(events, key=lambda event: event.t)),
        source=data,
    )


def _event(where: str, data: Any, robot: Robot, duration: float) -> Event:
    data = _mapping(where, data)
    check_keys(where, data, {"t", "reference", "push"})
    t = check_range(f"{where}.t", data.get("t"), 0.0, duration)
    reference = push = None
    try:
        if "reference" in data:
            values = _mapping("reference", data["reference"])
            check_keys("reference", values, {"vx", "vy", "yaw_rate"})
            reference = robot.check_reference(Reference(**values))
        if "push" in data:
            values = _mapping("push", data["push"])
            check_keys("push", values, {"impulse", "duration", "frame"})
            if not isinstance(values.get("impulse"), list):
                raise InvalidValueError("push.impulse", values.get("impulse"), "must be a list of two numbers")
            push = robot.check_push(Push(**values))
    except InvalidValueError as error:
        raise InvalidValueError(f"{where}.{error.field}", error.value, error.limit) from error
    return Event(t, reference, push)


def _mapping(where: str, data: Any) -> dict[str, Any]:
    if not isinstance(data, Mapping):
        raise InvalidValueError(where, data, "must be a mapping")
    return {str(key): value for key, value in cast(Mapping[Any, Any], data).items()}


class _Loader(yaml.SafeLoader):
    """PyYAML follows YAML 1.1, for which 1e-6 is text; here it is a number, as in JSON."""


_Loader.add_implicit_resolver(  # pyright: ignore[reportUnknownMemberType] (not in its stubs)
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"),
    list("-+.0123456789"),
)
