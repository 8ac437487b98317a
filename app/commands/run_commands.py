"""The commands of `walk` around runs: run, compare, report, scenarios."""

import json
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro
from tqdm import tqdm

from app.formats import FORMATS, as_written, read_run
from app.jobs import JobPool, ProcessDiedError
from app.runs.run import RunProgress
from app.runs.run_jobs import Simulate, SimulationResult
from app.settings import usable_cores
from app.tables import text_table
from walkcore import WalkError, load_robot, load_scenario, scenario_names
from walkcore.errors import InvalidValueError, UnknownNameError
from walkcore.parameters import PLANTS
from walkcore.scenario.expectations import Verdict
from walkcore.scenario.scaling import scaled
from walkcore.scenario.scenario import Scenario

Ending = Literal[tuple(FORMATS)]
Plant = Literal[PLANTS]
BAR = "{l_bar}{bar}| {n:.0f}/{total:.0f} s [{elapsed}<{remaining}]"
BROKEN = 1
"""Exit code of a run that breaks an expectation of its scenario."""
FAILED = 2
"""Exit code where there is no run."""


@dataclass(frozen=True, slots=True)
class RunCommand:
    """Simulate scenarios as fast as the machine can, and write their recordings.

    Exit code: 0 if every expectation of the scenarios holds, 1 if one does not, 2 for bad input.
    """

    scenarios: tyro.conf.Positional[tuple[str, ...]]
    """Names of some that ship (see `walk scenarios`), or files."""
    out: Path
    """Folder for run.json and the recording; of several scenarios each gets a folder of its own in there."""
    formats: Annotated[tuple[Ending, ...], tyro.conf.arg(name="format")] = ("npz", "csv")  # pyright: ignore[reportInvalidTypeForm]  # the registry's names
    """Files of the recording: NumPy, CSV, Parquet, MCAP (Foxglove), a 3-D replay in a page."""
    robot: str = ""
    """Robot that walks instead of each scenario's: speeds, times and pushes are scaled to it, within its limits."""
    plant: Plant | None = None  # pyright: ignore[reportInvalidTypeForm]  # the core's names
    """Body that moves, instead of the scenario's: the ideal model, or contact physics in MuJoCo."""
    twin: bool = False
    """Let an ideal robot walk beside one in contact physics, on the same commands."""
    jobs: int = 0
    """Scenarios simulated at the same time; 0 for as many as there are cores."""

    def __call__(self) -> int:
        """Simulate, write, and print results and broken expectations."""
        if not self.scenarios:
            raise InvalidValueError("scenarios", [], "name at least one; `walk scenarios` lists those that ship")
        scenarios, problems = _read(self.scenarios)
        for problem in problems:
            print(f"walk: {problem}", file=sys.stderr)
        if problems:  # before anything runs
            return FAILED
        scenarios = [self._placed(scenario) for scenario in scenarios]
        jobs = [Simulate(s.source, folder, self.formats) for s, folder in zip(scenarios, self._folders(), strict=True)]
        code = 0
        for index, done in simulate_all(jobs, self.jobs or usable_cores(), sys.stderr.isatty()):
            try:
                result = done.result()
            except (WalkError, ProcessDiedError) as error:
                print(f"walk: {scenarios[index].name}: {error}", file=sys.stderr)
                code = FAILED
                continue
            print(
                f"{scenarios[index].name}: {result.nb_ticks} ticks of {result.robot} written to {jobs[index].folder}"
                f" ({result.real_time_factor:.3g} times real time)"
                + (f"; the robot fell: {result.reason}" if result.reason else "")
            )
            if result.twin_difference:
                print(f"  {result.twin_difference}")
            _print_verdicts(result.verdicts)
            if not all(verdict.holds for verdict in result.verdicts):
                code = max(code, BROKEN)
        return code

    def _placed(self, scenario: Scenario) -> Scenario:
        """The scenario for the robot and on the plant that are asked for."""
        if self.robot:
            scenario = scaled(scenario, load_robot(self.robot))
            print(f"{scenario.name}: {scenario.description}")
        if self.plant is None and not self.twin:
            return scenario
        return scenario.on_plant(self.plant or scenario.parameters.plant, self.twin)

    def _folders(self) -> Sequence[Path]:
        """A folder for each scenario."""
        names = [Path(source).stem if Path(source).is_file() else source for source in self.scenarios]
        if len(names) == 1:
            return [self.out]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise InvalidValueError("scenarios", twice, "is named twice: their folders would be the same")
        return [self.out / name for name in names]


def _read(sources: Sequence[str]) -> tuple[list[Scenario], list[str]]:
    """The scenarios that can be read, and a line for each that cannot."""
    scenarios: list[Scenario] = []
    problems: list[str] = []
    for source in sources:
        try:
            scenarios.append(load_scenario(source))
        except UnknownNameError as error:
            problems.append(str(error))
        except (WalkError, OSError) as error:
            problems.append(f"{source}: {error}")
    return scenarios, problems


def simulate_all(
    jobs: Sequence[Simulate], nb_processes: int, shows_progress: bool
) -> Iterator[tuple[int, Future[SimulationResult]]]:
    """Simulate scenarios in several processes, with a progress bar on stderr.

    Args:
        jobs: whose scenarios can be read.
        nb_processes: scenarios that are simulated at once.
        shows_progress: whether there is a bar.

    Yields:
        The index of each job that has ended, and its future, which is done.
    """
    durations = [float(job.scenario["duration"]) for job in jobs]
    simulated = [0.0] * len(jobs)
    with tqdm(total=sum(durations), desc="simulated", disable=not shows_progress, bar_format=BAR) as bar:

        def show(index: int, progress: RunProgress) -> None:
            now = progress.fraction * durations[index]
            bar.update(min(now - simulated[index], bar.total - bar.n))  # rounding must not lead beyond the end
            simulated[index] = now

        with JobPool(nb_processes) as pool:
            yield from pool.run(jobs, show)


def _print_verdicts(verdicts: Sequence[Verdict]) -> None:
    """One line for all expectations that hold, and one for each that does not."""
    nb_kept = sum(verdict.holds for verdict in verdicts)
    if nb_kept:
        print(f"  {nb_kept} of {len(verdicts)} expectations hold")
    for verdict in verdicts:
        if not verdict.holds:
            measured = "not measured in this run" if verdict.measured is None else f"measured {verdict.measured:.4g}"
            print(f"  BROKEN: {verdict.name} = {verdict.bound}, {measured}")


@dataclass(frozen=True, slots=True)
class CompareCommand:
    """Put runs side by side: a table of their metrics and, with --out, figures that lay one over the other."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Two or more folders that `walk run` wrote."""
    out: Path | None = None
    """Folder for comparison.html, comparison.md and their figures; none prints the table only."""

    def __call__(self) -> None:
        """Print, and write where a folder is given."""
        from app.report import comparison_rows, write_comparison  # draws: takes a second to load

        if len(self.runs) < 2:
            raise InvalidValueError("runs", [str(run) for run in self.runs], "name at least two folders")
        runs, names = [read_run(folder) for folder in self.runs], _distinct_names(self.runs)
        with as_written(*self.runs):
            rows = comparison_rows(runs, names)
        print(text_table(rows))
        if self.out is not None:
            with as_written(*self.runs):
                _, page = write_comparison(runs, names, self.out)
            print(f"written to {page}")


def _distinct_names(folders: Sequence[Path]) -> list[str]:
    """The folders' own names, or their whole paths where those are the same."""
    names = [folder.resolve().name for folder in folders]
    return names if len(set(names)) == len(names) else [str(folder) for folder in folders]


@dataclass(frozen=True, slots=True)
class ReportCommand:
    """Write a report on a run: its metrics, expectations and figures."""

    run: tyro.conf.Positional[Path]
    """Folder that `walk run` wrote."""
    out: Path | None = None
    """Folder for report.html, report.md and their figures; the run's own if not given."""

    def __call__(self) -> None:
        """Read, draw, write."""
        from app.report import write_report  # draws: takes a second to load

        run = read_run(self.run)
        with as_written(self.run):
            _, page = write_report(run, self.run if self.out is None else self.out)
        print(f"written to {page}")


@dataclass(frozen=True, slots=True)
class ScenariosCommand:
    """List the scenarios that ship."""

    schema: bool = False
    """Print the JSON schema of a scenario file instead."""

    def __call__(self) -> None:
        """Print name, robot, duration and description of each, or the schema."""
        if self.schema:
            from app.http.scenario_schema import scenario_schema

            print(json.dumps(scenario_schema(), indent=2))
            return
        for name in scenario_names():
            scenario = load_scenario(name)
            print(f"{name:28} {scenario.robot.name:6} {scenario.duration:3g} s  {scenario.description}")
