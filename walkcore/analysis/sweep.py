"""Sweep: how hard a robot can be pushed, over directions, phases of the step, and every combination of some choices.

A sweep is read from YAML or its JSON equivalent. Every combination of its robots, parameters and references is a walk;
a cell is a walk with one direction and one phase. Cells are counted in the order of the file, the phase running
fastest. `cell_outcome` decides them.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from walkcore.analysis.survival import OBSERVED, ImpulseScan
from walkcore.errors import InvalidValueError
from walkcore.named_files import named_file, shipped_files
from walkcore.plain_yaml import load_yaml
from walkcore.robot_file import DEFAULT_ROBOT
from walkcore.scenario.scenario import Scenario, scenario_from_mapping
from walkcore.values import (
    Vector,
    check_flag,
    check_keys,
    check_list,
    check_mapping,
    check_range,
    check_text,
    check_whole,
)

KEYS = ("name", "description", "robots", "parameters", "references", "pushes", "seeds", "world", "body")
PUSH_KEYS = ("directions", "phases", "duration", "max_impulse", "coarse", "tolerance")
MAX_WALKS = 2000
MAX_CELLS = 10_000_000
MAX_DIRECTIONS = 3600
MAX_PHASES = 1000
MAX_SEEDS = 1000
MAX_TRIES = 10_000  # impulses of a scan, and bisections of one of its intervals
NB_COARSE = 8  # intervals of a scan that is given no width of them
LONGEST = 3600.0  # [s] of a walk, as of any scenario


@dataclass(frozen=True, slots=True)
class PushGrid:
    """Pushes on each walk."""

    directions: int
    """Directions, evenly spaced from straight ahead counter-clockwise, in the heading frame."""
    phases: int
    """Phases of the step, evenly spaced from the touchdown of the left foot on."""
    duration: float
    """Duration of a push [s]; zero gives it within one tick."""
    scan: ImpulseScan


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """One walk, one direction and one phase."""

    index: int
    """Number of the cell in the order of the file."""
    walk: int
    """Number of its walk."""
    direction: float
    """Direction of the push in the heading frame, counter-clockwise [rad]."""
    phase: float
    """Fraction of the step that has passed since the touchdown, in [0, 1)."""

    @property
    def unit_vector(self) -> Vector:
        """Direction of the push in the heading frame, shape (2,)."""
        return np.array([math.cos(self.direction), math.sin(self.direction)])


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """Walks, pushes on them, and the number of seeds."""

    name: str
    description: str
    walks: tuple[Scenario, ...]
    """Every combination of robot, parameters and reference, each as the scenario of its nominal walk."""
    pushes: PushGrid
    seeds: int
    """Seeds of the noise for each impulse."""
    has_body: bool
    """Whether whole bodies walk with the ideal plant; else the point mass with feet does."""
    source: Mapping[str, Any]
    """The mapping that it was read from."""

    @property
    def nb_cells(self) -> int:
        """Number of cells."""
        return len(self.walks) * self.pushes.directions * self.pushes.phases

    def cell(self, index: int) -> Cell:
        """A cell by its number."""
        rest, phase = divmod(index, self.pushes.phases)
        walk, direction = divmod(rest, self.pushes.directions)
        angle = 2 * math.pi * direction / self.pushes.directions
        return Cell(index, walk, angle, phase / self.pushes.phases)

    @property
    def nb_trials(self) -> int:
        """Simulated pushes of a cell without islands."""
        scan = self.pushes.scan
        coarse = max(1, math.ceil(scan.max_impulse / scan.coarse - 1e-9))
        halvings = math.ceil(math.log2(max(scan.max_impulse / coarse / scan.tolerance, 1.0)))
        return (coarse + halvings) * self.seeds


def sweep_names() -> list[str]:
    """Names of the sweeps that ship."""
    return list(shipped_files("sweeps"))


def load_sweep(name_or_path: str | Path) -> Sweep:
    """A sweep that ships, by its name, or one from a YAML or JSON file.

    Raises:
        UnknownNameError: if there is neither a file nor a shipped sweep of that name.
        InvalidValueError: if the file does not describe a sweep.
    """
    return sweep_from_mapping(load_yaml(named_file("sweep", name_or_path, shipped_files("sweeps")), "sweep"))


def sweep_from_mapping(data: Any) -> Sweep:
    """A sweep from plain values, as YAML or JSON gives them.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
        UnknownNameError: if there is no such robot.
    """
    values = check_mapping("sweep", data)
    check_keys("sweep", values, set(KEYS))
    for key in ("name", "description"):
        check_text(key, values.get(key, ""))
    pushes = _pushes(values.get("pushes"))
    walks = _walks(values, pushes)
    nb_cells = len(walks) * pushes.directions * pushes.phases
    if nb_cells > MAX_CELLS:
        raise InvalidValueError("number of cells", nb_cells, f"must be at most {MAX_CELLS}")
    return Sweep(
        name=values.get("name", "unnamed"),
        description=values.get("description", ""),
        walks=walks,
        pushes=pushes,
        seeds=_seeds(values.get("seeds", 1), walks),
        has_body=check_flag("body", values.get("body", False)),
        source=values,
    )


def _pushes(data: Any) -> PushGrid:
    values = check_mapping("pushes", data)
    check_keys("pushes", values, set(PUSH_KEYS))
    given = {"duration": 0.0, "tolerance": 1.0} | values
    for key in ("directions", "phases", "max_impulse"):
        if key not in given:
            raise InvalidValueError(f"pushes.{key}", None, "is missing")
    highest = check_range("pushes.max_impulse", given["max_impulse"], 1e-3, 1e4)
    least = highest / MAX_TRIES
    coarse = check_range("pushes.coarse", given.get("coarse", highest / NB_COARSE), least, highest)
    return PushGrid(
        directions=check_whole("pushes.directions", given["directions"], 1, MAX_DIRECTIONS),
        phases=check_whole("pushes.phases", given["phases"], 1, MAX_PHASES),
        duration=check_range("pushes.duration", given["duration"], 0.0, OBSERVED / 2),
        scan=ImpulseScan(highest, coarse, check_range("pushes.tolerance", given["tolerance"], least, highest)),
    )


def _walks(values: Mapping[str, Any], pushes: PushGrid) -> tuple[Scenario, ...]:
    """Every combination of the lists, judged as the scenario of its nominal walk with the hardest push."""
    lists: dict[str, list[Any]] = {"robots": [DEFAULT_ROBOT], "parameters": [{}], "references": [{}]}
    for key, default in lists.items():
        lists[key] = check_list(key, values.get(key, default), MAX_WALKS)
        if not lists[key]:
            raise InvalidValueError(key, [], "must have at least one item")
    nb_walks = math.prod(map(len, lists.values()))
    if nb_walks > MAX_WALKS:
        raise InvalidValueError("combinations of robots, parameters and references", nb_walks, f"at most {MAX_WALKS}")
    walks = tuple(
        _walk(robot, parameters, reference, values, pushes, (i, k))
        for robot in (check_text(f"robots[{j}]", robot) for j, robot in enumerate(lists["robots"]))
        for i, parameters in enumerate(lists["parameters"])
        for k, reference in enumerate(lists["references"])
    )
    if "world" in values and all(walk.parameters.plant == "ideal" for walk in walks):
        raise InvalidValueError("world", values["world"], "needs plant: mujoco in some of the parameters")
    return walks


def _walk(
    robot: str, parameters: Any, reference: Any, values: Mapping[str, Any], pushes: PushGrid, at: tuple[int, int]
) -> Scenario:
    """The scenario of a nominal walk; a refusal names the field of the sweep, not that of the scenario."""
    where = {"parameters": f"parameters[{at[0]}]", "events[0].reference": f"references[{at[1]}]"}
    try:
        given, towards = check_mapping("parameters", parameters), check_mapping("events[0].reference", reference)
        plant = given.get("plant", "ideal")
        scenario = {
            "robot": robot,
            "duration": LONGEST,
            "parameters": given,
            "events": [
                {"t": 0.0, "reference": towards},
                {"t": 0.0, "push": {"impulse": [pushes.scan.max_impulse, 0.0], "duration": pushes.duration}},
            ],
        }
        world = {"world": values["world"]} if plant != "ideal" and "world" in values else {}
        return scenario_from_mapping(scenario | world)
    except InvalidValueError as error:
        if error.field.startswith("events[1].push"):
            key = "duration" if "duration" in error.field else "max_impulse"
            limit = f"{error.limit}, the limit of {robot}"
            raise InvalidValueError(f"pushes.{key}", error.value, limit) from error
        field = error.field
        for inner, outer in where.items():
            field = field.replace(inner, outer, 1) if field.startswith(inner) else field
        raise InvalidValueError(field, error.value, error.limit) from error


def _seeds(data: Any, walks: tuple[Scenario, ...]) -> int:
    seeds = check_whole("seeds", data, 1, MAX_SEEDS)
    if seeds > 1 and not all(is_noisy(walk) for walk in walks):
        limit = (
            "must be 1 where nothing is random: it needs plant: mujoco in all parameters and world: {sensors: noisy}"
        )
        raise InvalidValueError("seeds", seeds, limit)
    return seeds


def is_noisy(walk: Scenario) -> bool:
    """Whether something of a walk is random."""
    return walk.parameters.plant != "ideal" and walk.world.sensors == "noisy"
