"""A scripted walk, read from YAML or from its JSON equivalent: a robot, commands, and expectations."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from walkcore.command import Command, Push, Reference
from walkcore.errors import EmptyRegionError, InvalidValueError
from walkcore.mpc.regions import inset_vertices
from walkcore.named_files import named_file, shipped_files
from walkcore.parameters import Parameters
from walkcore.plain_yaml import load_yaml
from walkcore.plant.world import PERFECT, World
from walkcore.robot import Robot
from walkcore.robot_file import DEFAULT_ROBOT, load_robot
from walkcore.scenario.events import Event, commands
from walkcore.scenario.expectations import Expectation, expectations_from_mapping
from walkcore.state import SimulationState, state_from_mapping
from walkcore.values import check_keys, check_mapping, check_range, check_text, check_whole

MAX_DURATION = 3600.0  # [s]
MAX_SOLVES = 1000  # of one tick: there are fewer than ten
MAX_EVENTS = 20_000  # more than a minute of live walking has ticks
KEYS = {"name", "description", "robot", "duration", "parameters", "world", "initial_state", "events", "expect"}


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """A robot, its parameters, and the commands to it."""

    name: str
    robot: Robot
    duration: float
    """[s]."""
    parameters: Parameters
    """Parameters at the beginning."""
    events: tuple[Event, ...]
    """Events in the order of their times, which count from the beginning of the scenario."""
    source: Mapping[str, Any]
    """The mapping that it was read from."""
    description: str = ""
    initial_state: SimulationState | None = None
    """State in which the walk begins; None at rest at the origin, at tick 0."""
    expectations: tuple[Expectation, ...] = ()
    world: World = PERFECT
    """World that a plant with contact physics stands in."""

    @property
    def nb_ticks(self) -> int:
        """Ticks that the scenario lasts."""
        return round(self.duration / self.parameters.control_period)

    def commands(self) -> Iterator[Command]:
        """One command a tick. Of several pushes within one tick, all are given, one a tick."""
        return commands(self.events, self.nb_ticks, self.parameters.control_period)

    def parameter_changes(self) -> tuple[tuple[int, Parameters], ...]:
        """Ticks, counted from the beginning of the scenario, before which other parameters come into force."""
        period = self.parameters.control_period
        return tuple((event.tick(period), event.parameters) for event in self.events if event.parameters is not None)

    def solves_in_time(self) -> dict[int, int]:
        """Solves that ticks of a live walk had the time for, where not all, by the tick from the beginning."""
        period = self.parameters.control_period
        solves = ((event.tick(period), event.solves_in_time) for event in self.events)
        return {tick: nb for tick, nb in solves if nb is not None}

    def on_plant(self, plant: str, twin: bool = False) -> "Scenario":
        """The same scenario on another plant, with the dynamic filter, which contact physics needs.

        Args:
            plant: a name of `parameters.PLANTS`.
            twin: whether an ideal robot walks beside it.
        """
        changed = {"plant": plant, "twin": twin} | ({} if plant == "ideal" else {"dynamic_filter": True})
        world = {} if plant == "ideal" else {"world": self.source.get("world", {})}
        kept = {key: value for key, value in self.source.items() if key != "world"}
        return scenario_from_mapping(kept | world | {"parameters": {**self.source.get("parameters", {}), **changed}})

    def without_body(self) -> "Scenario":
        """The same scenario of the point mass with feet: the decisions are the same, but for falls of the body."""
        state = self.initial_state
        return replace(
            self,
            robot=replace(self.robot, body=None),
            parameters=replace(self.parameters, plant="ideal", twin=False),
            world=PERFECT,
            initial_state=None if state is None else replace(state, driver=None, twin=None),
        )


def scenario_names() -> list[str]:
    """Names of the scenarios that ship."""
    return list(shipped_files("scenarios"))


def load_scenario(name_or_path: str | Path) -> Scenario:
    """A scenario that ships, by its name, or one from a YAML or JSON file.

    Raises:
        UnknownNameError: if there is neither a file nor a shipped scenario of that name.
        InvalidValueError: if the file does not describe a scenario.
    """
    file = named_file("scenario", name_or_path, shipped_files("scenarios"))
    return scenario_from_mapping(load_yaml(file, "scenario"))


def scenario_from_mapping(data: Any) -> Scenario:
    """A scenario from plain values, as YAML or JSON gives them.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
        UnknownNameError: if there is no such robot.
    """
    data = check_mapping("scenario", data)
    check_keys("scenario", data, KEYS)
    for key in ("name", "description"):
        check_text(key, data.get(key, ""))
    robot = load_robot(str(data.get("robot", DEFAULT_ROBOT)))  # a value that is no name is refused as an unknown one
    values = check_mapping("parameters", _given(data, "parameters", {}))
    parameters = _parameters(values, robot)
    duration = check_range("duration", data.get("duration"), parameters.control_period, MAX_DURATION)
    listed: Any = _given(data, "events", [])
    if not isinstance(listed, list):
        raise InvalidValueError("events", listed, "must be a list")
    if len(cast(list[Any], listed)) > MAX_EVENTS:
        raise InvalidValueError("events", len(cast(list[Any], listed)), f"must be at most {MAX_EVENTS}")
    state = data.get("initial_state")
    return Scenario(
        name=data.get("name", "unnamed"),
        robot=robot,
        duration=duration,
        parameters=parameters,
        events=_events(cast(list[Any], listed), robot, parameters, duration),
        source=data,
        description=data.get("description", ""),
        initial_state=None if state is None else state_from_mapping(state, robot, parameters),
        expectations=expectations_from_mapping(_given(data, "expect", {})),
        world=_world(_given(data, "world", {}), parameters),
    )


def _world(data: Any, parameters: Parameters) -> World:
    world = World.from_mapping(check_mapping("world", data))
    if world != PERFECT and parameters.plant == "ideal":
        raise InvalidValueError(
            "world", data, "needs parameters.plant: mujoco; the ideal plant knows the perfect world"
        )
    return world


def _given(data: Mapping[str, Any], key: str, default: Any) -> Any:
    """The value of a key; a key with nothing behind it, which YAML reads as null, has the default."""
    value = data.get(key)
    return default if value is None else value


def _fitting(parameters: Parameters, robot: Robot) -> Parameters:
    """The parameters, if their margin leaves something of the robot's soles, and it has the body that they need."""
    if robot.body is None and parameters.plant != "ideal":
        raise InvalidValueError("plant", parameters.plant, f"needs a body; {robot.name} is a point mass with feet")
    try:
        inset_vertices(robot.sole, parameters.cop_margin)
    except EmptyRegionError as error:
        raise InvalidValueError("cop_margin", parameters.cop_margin, f"leaves nothing of the sole: {error}") from error
    return parameters


def _events(listed: list[Any], robot: Robot, parameters: Parameters, duration: float) -> tuple[Event, ...]:
    """The events in the order of their times; each change of parameters adds to those before it."""
    found: list[tuple[str, dict[str, Any], float]] = []
    for i, item in enumerate(listed):
        where = f"events[{i}]"
        data = check_mapping(where, item)
        check_keys(where, data, {"t", "reference", "over", "push", "parameters", "solves_in_time"})
        found.append((where, data, check_range(f"{where}.t", data.get("t"), 0.0, duration)))
    events: list[Event] = []
    for where, data, t in sorted(found, key=lambda event: event[2]):
        try:
            event = _event(data, t, robot, parameters)
        except InvalidValueError as error:
            raise InvalidValueError(f"{where}.{error.field}", error.value, error.limit) from error
        parameters = event.parameters or parameters
        events.append(event)
    return tuple(events)


def _event(data: dict[str, Any], t: float, robot: Robot, parameters: Parameters) -> Event:
    reference = push = changed = None
    if "reference" in data:
        values = check_mapping("reference", data["reference"])
        check_keys("reference", values, {"vx", "vy", "yaw_rate"})
        reference = robot.check_reference(Reference(**values))
    over = check_range("over", data.get("over", 0.0), 0.0, MAX_DURATION)
    if "over" in data and reference is None:
        raise InvalidValueError("over", over, "needs a reference beside it")
    if "push" in data:
        values = check_mapping("push", data["push"])
        check_keys("push", values, {"impulse", "duration", "frame", "link", "point"})
        if not isinstance(values.get("impulse"), list):
            raise InvalidValueError("push.impulse", values.get("impulse"), "must be a list of two numbers")
        push = robot.check_push(Push(**values))
    if "parameters" in data:
        changed = _changed(parameters, check_mapping("parameters", data["parameters"]), robot)
    solves = data.get("solves_in_time")
    if solves is not None:
        check_whole("solves_in_time", solves, 0, MAX_SOLVES)
    return Event(t, reference, over, push, changed, solves)


def _parameters(values: dict[str, Any], robot: Robot) -> Parameters:
    try:
        return _fitting(robot.parameters.changed(values), robot)
    except InvalidValueError as error:
        raise _of_parameters(error) from error


def _changed(parameters: Parameters, values: dict[str, Any], robot: Robot) -> Parameters:
    try:
        changed = parameters.check_change(parameters.changed(values))
        return changed if changed.cop_margin == parameters.cop_margin else _fitting(changed, robot)
    except InvalidValueError as error:
        raise _of_parameters(error) from error


def _of_parameters(error: InvalidValueError) -> InvalidValueError:
    """The error with the whole path of its field."""
    field = error.field.removeprefix("parameters.")
    return InvalidValueError(f"parameters.{field}", error.value, error.limit)
