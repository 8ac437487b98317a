"""The cost of a tick, everything measured in one run: by stage, by solver, and against real time.

Stages and solvers are measured in processor time of their thread: on a shared machine, wall-clock time has a tail of
milliseconds that is not theirs.
"""

import gc
import math
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from itertools import repeat
from typing import Any

import numpy as np

from app.bench.solvers import CLOCK, Durations, SolverResult, compare, problems_of
from app.tables import text_table
from walkcore import Command, Push, Reference, Scenario, Simulation, load_scenario
from walkcore.mpc.plan import Status
from walkcore.mpc.qp import SOLVERS
from walkcore.stages import Stopwatch

MOTION = "herdt-2010-section-6"
NB_QPS = 500
PLANNING = ("assemble", "solve", "check")  # stages: from the state of the robot to a decision that holds
COMPARING = "timing"  # stage: the comparison of touchdowns, by adaptive step timing alone
PUSHES = (22.0, 30.0, 38.0)  # [N s] in each of 8 directions, at phases of the step that follow each other
RECOVERY_TICKS = 60  # that each push is followed for
PERIODS = (0.1, 0.005)  # [s]: the paper's, and that of the live walk
STEADY_WALKS = {"straight": Reference(vx=0.3), "circle": Reference(vx=0.2, yaw_rate=0.2)}
STEADY_TICKS = 2400  # per round: 12 s at the live walk's 200 ticks a second
ROUNDS = 3  # in which the cases take turns: a machine that is busy is so for all of them


@dataclass(frozen=True, slots=True)
class WalkSpeed:
    """The speed at which a walk was simulated."""

    control_period: float
    """Time from one tick to the next [s]."""
    has_body: bool
    real_time_factor: float
    """Simulated over real time."""


@dataclass(frozen=True, slots=True)
class SteadyWalk:
    """Cost of a tick of the point mass that walks without end, with one solver."""

    walk: str
    """Key of STEADY_WALKS."""
    solver: str
    step: Durations
    """The whole tick: gait, QP, plan, swing foot and snapshot."""
    assemble_and_solve: Durations
    """The QP's share of it, the check of the solution included."""
    fastest: Durations
    """Assembling and solving where each tick counts once, by the fastest of its rounds. The work is the same in each,
    so this is the cost of the code; what the rounds differ by is the machine's."""


@dataclass(frozen=True, slots=True)
class Bench:
    """The whole result."""

    machine: Mapping[str, Any]
    scenario: str
    stages: Mapping[str, Durations]
    """Stages of a tick with the body and the dynamic filter, as in the live walk."""
    tick: Durations
    assemble_and_solve: Durations
    """Assembling and solving for the point mass, the check of the solution included."""
    solver_itself: Durations
    """The solver's share of that, measured between other work, so with colder caches than in a loop of QPs."""
    around_solver: Durations
    """The rest of that: building the QP, reading the solution, checking where it leads."""
    solvers: Mapping[str, SolverResult]
    steady_walks: tuple[SteadyWalk, ...]
    recovering_tick: Durations
    """The ticks of the point mass after pushes at which adaptive step timing gives up margins or the schedule."""
    recovering_planning: Durations
    """Planning's share of them: assembling and solving, the check, and the comparison of touchdowns."""
    recovering_fastest: Durations
    """The same by the fastest of each tick's rounds, see `SteadyWalk.fastest`."""
    speeds: tuple[WalkSpeed, ...]

    def to_mapping(self) -> dict[str, Any]:
        """The result as plain values, for JSON."""
        return asdict(self)


def bench(report: Callable[[str], None], motion: Scenario | None = None, steady_ticks: int = STEADY_TICKS) -> Bench:
    """Measure for half a minute.

    Args:
        report: called with a name of what is measured next.
        motion: of a robot with a body; None takes the paper's.
        steady_ticks: ticks of each round of a steady walk.
    """
    motion = load_scenario(MOTION) if motion is None else motion
    report("the stages of a tick")
    live = replace(motion, parameters=replace(motion.parameters, dynamic_filter=True))
    ticks = laps(live)
    report("the QP")
    point_mass = motion.without_body()
    planning = laps(point_mass)
    problems = problems_of(point_mass, NB_QPS)
    report("the solvers")
    solvers = compare(problems, motion.parameters.horizon_samples)
    report("a whole step of the point mass")
    steady_walks = _steady_walks(point_mass, steady_ticks)
    report("recoveries from pushes")
    rounds = [_recoveries(point_mass) for _ in range(ROUNDS)]
    recovering = [tick for one_round in rounds for tick in one_round]
    report("walks against real time")
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
        steady_walks=steady_walks,
        recovering_tick=Durations.of(sum(tick.values()) for tick in recovering),
        recovering_planning=Durations.of(map(planning_time, recovering)),
        recovering_fastest=_fastest(rounds),
        speeds=tuple(_speed(motion, period, has_body) for period, has_body in walks),
    )


def laps(scenario: Scenario) -> list[dict[str, float]]:
    """Processor time of the stages of each tick of a scenario [s]."""
    return _laps(scenario, scenario.commands())


def _laps(scenario: Scenario, commands: Iterable[Command]) -> list[dict[str, float]]:
    stopwatch = Stopwatch(CLOCK)
    simulation = Simulation(scenario.robot, scenario.parameters, stopwatch)
    ticks: list[dict[str, float]] = []
    with _no_collection():
        for command in commands:
            simulation.step(command)
            ticks.append(stopwatch.laps)
    return ticks


def _steady_walks(point_mass: Scenario, nb_ticks: int) -> tuple[SteadyWalk, ...]:
    cases = [(walk, solver) for walk in STEADY_WALKS for solver in SOLVERS]
    rounds: dict[tuple[str, str], list[list[dict[str, float]]]] = {case: [] for case in cases}
    for _ in range(ROUNDS):
        for walk, solver in cases:
            scenario = replace(point_mass, parameters=replace(point_mass.parameters, solver=solver))
            rounds[walk, solver].append(_laps(scenario, repeat(Command(STEADY_WALKS[walk]), nb_ticks)))
    return tuple(_steady_walk(walk, solver, rounds[walk, solver]) for walk, solver in cases)


def _steady_walk(walk: str, solver: str, rounds: list[list[dict[str, float]]]) -> SteadyWalk:
    ticks = [tick for one_round in rounds for tick in one_round]
    return SteadyWalk(
        walk,
        solver,
        step=Durations.of(sum(tick.values()) for tick in ticks),
        assemble_and_solve=Durations.of(map(planning_time, ticks)),
        fastest=_fastest(rounds),
    )


def _fastest(rounds: list[list[dict[str, float]]]) -> Durations:
    """Planning's durations, each tick counted by the fastest of its rounds."""
    return Durations.of(min(map(planning_time, same)) for same in zip(*rounds, strict=True))


def _recoveries(point_mass: Scenario) -> list[dict[str, float]]:
    """Processor time of the stages of the ticks after pushes that adaptive step timing has to answer [s]."""
    stopwatch = Stopwatch(CLOCK)
    parameters = replace(point_mass.parameters, step_timing="adaptive", stepping_in_place=True)
    simulation = Simulation(point_mass.robot, parameters, stopwatch)
    ticks: list[dict[str, float]] = []
    for _ in range(4 * parameters.timing.ticks_per_step):
        simulation.step()
    with _no_collection():
        for strength in PUSHES:
            for k in range(8):
                state = simulation.state
                angle = k * math.pi / 4
                push = Push(strength * np.array([math.cos(angle), math.sin(angle)]))
                for command in (Command(push=push), *repeat(Command(), RECOVERY_TICKS)):
                    snapshot = simulation.step(command)
                    if snapshot.status is Status.RELAXED:
                        ticks.append(stopwatch.laps)
                simulation.restore(state)
                for _ in range(parameters.timing.ticks_per_step // 7):
                    simulation.step()
    return ticks


@contextmanager
def _no_collection() -> Iterator[None]:
    """Switch off the garbage collector, which the live control process lets run between ticks only."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def planning_time(tick: Mapping[str, float]) -> float:
    """Time for assembling and solving, the check of the solution included [s]."""
    return sum(tick.get(stage, 0.0) for stage in (*PLANNING, COMPARING))


def by_stage(ticks: list[dict[str, float]]) -> dict[str, Durations]:
    """Summary of each stage, in the order in which they come, over the ticks that have it."""
    stages = dict.fromkeys(stage for tick in ticks for stage in tick)
    return {stage: Durations.of(tick[stage] for tick in ticks if stage in tick) for stage in stages}


def _speed(motion: Scenario, control_period: float, has_body: bool) -> WalkSpeed:
    parameters = replace(motion.parameters, control_period=control_period)
    scenario = replace(motion if has_body else motion.without_body(), parameters=parameters)
    simulation, commands = Simulation(scenario.robot, parameters), list(scenario.commands())
    begin = time.perf_counter()
    for command in commands:
        simulation.step(command)
    return WalkSpeed(control_period, has_body, scenario.duration / (time.perf_counter() - begin))


def _machine() -> dict[str, Any]:
    packages = ("walk", "numpy", *SOLVERS, "quadprog", "pin", "pin-pink")
    return {
        "processor": platform.processor() or platform.machine(),
        "python": platform.python_version(),
        "packages": {name: version(name) for name in packages},
    }


def table(bench: Bench) -> str:
    """The result as text for a terminal."""
    return "\n\n".join([_stages(bench), _solvers(bench), _steady(bench), _speeds(bench)]) + "\n"


def _stages(bench: Bench) -> str:
    rows = [(stage, *_numbers(duration)) for stage, duration in bench.stages.items()]
    rows += [("whole tick", *_numbers(bench.tick))]
    rows += [
        ("assemble + solve *", *_numbers(bench.assemble_and_solve)),
        ("the solver itself *", *_numbers(bench.solver_itself)),
        ("around the solver *", *_numbers(bench.around_solver)),
    ]
    note = "* of the point mass, the check where the solution leads included"
    return text_table([("stage [us]", "median", "p99", "max"), *rows], str.rjust) + f"\n{note}"


def _solvers(bench: Bench) -> str:
    head = ("solver [us]", "median", "p99", "max", "ratio", "foothold error p95 [mm]", "max [mm]")
    rows = [
        (name, *_numbers(r.duration), f"{r.ratio:.2f}", f"{r.foothold_error_p95:.4f}", f"{r.foothold_error_max:.4f}")
        for name, r in bench.solvers.items()
    ]
    return text_table([head, *rows], str.rjust)


def _steady(bench: Bench) -> str:
    head = (
        "point mass [us]",
        "solver",
        "step",
        "p99",
        "max",
        "assemble + solve",
        "p99",
        "p99 / median",
        "p99 *",
        "ratio *",
    )
    rows = [
        (
            w.walk,
            w.solver,
            *_numbers(w.step),
            *_numbers(w.assemble_and_solve)[:2],
            f"{w.assemble_and_solve.tail:.1f}",
            _numbers(w.fastest)[1],
            f"{w.fastest.tail:.1f}",
        )
        for w in bench.steady_walks
    ]
    rows += [
        (
            "recovering",
            "piqp",
            *_numbers(bench.recovering_tick),
            *_numbers(bench.recovering_planning)[:2],
            f"{bench.recovering_planning.tail:.1f}",
            _numbers(bench.recovering_fastest)[1],
            f"{bench.recovering_fastest.tail:.1f}",
        )
    ]
    note = f"* the same, each tick counted by the fastest of its {ROUNDS} rounds"
    return f"{text_table([head, *rows], str.rjust)}\n{note}"


def _speeds(bench: Bench) -> str:
    rows = [
        ("with the body" if p.has_body else "point mass", f"{1e3 * p.control_period:g}", f"{p.real_time_factor:.1f}")
        for p in bench.speeds
    ]
    return text_table([(bench.scenario, "period [ms]", "times real time"), *rows], str.rjust)


def _numbers(duration: Durations) -> tuple[str, ...]:
    return tuple(f"{value:.0f}" for value in (duration.median, duration.p99, duration.max))
