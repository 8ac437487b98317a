"""Everything measured in one run, on one core."""

import gc
import platform
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from typing import Any

from app.bench.durations import Durations
from app.bench.solvers import SolverResult, compare, problems_of
from walkcore import Scenario, Simulation, load_scenario
from walkcore.mpc.qp import SOLVERS
from walkcore.stages import Stopwatch

MOTION = "herdt-2010-section-6"
NB_QPS = 500
PLANNING = ("assemble", "solve", "check")  # stages: from the state of the robot to a decision that holds
PERIODS = (0.1, 0.005)  # [s]: the paper's, and that of the live walk


@dataclass(frozen=True, slots=True)
class Pace:
    """How much faster than real time a walk was simulated."""

    control_period: float
    """[s]."""
    has_body: bool
    real_time_factor: float


@dataclass(frozen=True, slots=True)
class Bench:
    """The whole result; durations in microseconds."""

    machine: Mapping[str, Any]
    scenario: str
    stages: Mapping[str, Durations]
    """Of a tick with the body and the dynamic filter, as in the live walk."""
    tick: Durations
    assemble_and_solve: Durations
    """Of the point mass, as the next two."""
    solver_itself: Durations
    """Its share of that, where it happens: between other things, so with colder caches than in a loop of QPs."""
    around_solver: Durations
    """The rest of it: building the QP, reading the solution, checking where it leads."""
    solvers: Mapping[str, SolverResult]
    paces: tuple[Pace, ...]

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return asdict(self)


def bench(tell: Callable[[str], None], motion: Scenario | None = None) -> Bench:
    """Measure; takes half a minute.

    Args:
        tell: is told what is being measured.
        motion: of a robot with a body; the paper's if none is given.
    """
    motion = load_scenario(MOTION) if motion is None else motion
    tell("the stages of a tick")
    live = replace(motion, parameters=replace(motion.parameters, dynamic_filter=True))
    ticks = laps(live)
    tell("the QP")
    point_mass = motion.without_body()
    planning = laps(point_mass)
    problems = problems_of(point_mass, NB_QPS)
    tell("the solvers")
    solvers = compare(problems, motion.parameters.horizon_samples)
    tell("walks against real time")
    walks = [(period, has_body) for period in PERIODS for has_body in (False, True)]
    return Bench(
        machine=_machine(),
        scenario=motion.name,
        stages=by_stage(ticks),
        tick=Durations.of(sum(tick.values()) for tick in ticks),
        assemble_and_solve=Durations.of(map(planning_time, planning)),
        solver_itself=Durations.of(tick["solve"] for tick in planning),
        around_solver=Durations.of(planning_time(tick) - tick["solve"] for tick in planning),
        solvers=solvers,
        paces=tuple(_pace(motion, period, has_body) for period, has_body in walks),
    )


def laps(scenario: Scenario) -> list[dict[str, float]]:
    """Durations of the stages of each tick of a scenario [s]."""
    stopwatch = Stopwatch(time.perf_counter)
    simulation = Simulation(scenario.robot, scenario.parameters, stopwatch)
    ticks: list[dict[str, float]] = []
    with _no_collection():
        for command in scenario.commands():
            simulation.step(command)
            ticks.append(stopwatch.laps)
    return ticks


@contextmanager
def _no_collection() -> Iterator[None]:
    """Without the garbage collector, which the live control process lets run between ticks only."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def planning_time(tick: Mapping[str, float]) -> float:
    """What assembling and solving took, the check of the solution included [s]."""
    return sum(tick[stage] for stage in PLANNING)


def by_stage(ticks: list[dict[str, float]]) -> dict[str, Durations]:
    """Summed up, in the order in which the stages come; a stage counts where it happens."""
    stages = dict.fromkeys(stage for tick in ticks for stage in tick)
    return {stage: Durations.of(tick[stage] for tick in ticks if stage in tick) for stage in stages}


def _pace(motion: Scenario, control_period: float, has_body: bool) -> Pace:
    parameters = replace(motion.parameters, control_period=control_period)
    scenario = replace(motion if has_body else motion.without_body(), parameters=parameters)
    simulation, commands = Simulation(scenario.robot, parameters), list(scenario.commands())
    begin = time.perf_counter()
    for command in commands:
        simulation.step(command)
    return Pace(control_period, has_body, scenario.duration / (time.perf_counter() - begin))


def _machine() -> dict[str, Any]:
    packages = ("walk", "numpy", *SOLVERS, "quadprog", "pin", "pin-pink")
    return {
        "processor": platform.processor() or platform.machine(),
        "python": platform.python_version(),
        "packages": {name: version(name) for name in packages},
    }
