"""Make a humanoid walk by linear MPC: serve it on a page, or simulate scenarios."""

from app.settings import Settings  # first: it sets what numpy reads when it loads

# isort: split

import logging
import os
import signal
import sys
from dataclasses import dataclass, field
from json import dumps
from pathlib import Path
from typing import Annotated, Literal

import tyro
from pydantic import ValidationError

from app.commands.lesson_commands import LessonsCommand
from app.commands.robot_commands import FootholdsCommand, ImportCommand, RobotsCommand
from app.commands.run_commands import CompareCommand, ReportCommand, RunCommand, ScenariosCommand
from app.commands.sweep_commands import SweepCommand, SweepCompareCommand
from walkcore import Parameters, WalkError


@dataclass(frozen=True, slots=True)
class ServeCommand:
    """Serve the page, the scene and the API on one port."""

    host: str = field(default_factory=lambda: Settings().host)
    """Address to listen on (environment: HOST)."""
    port: int = field(default_factory=lambda: Settings().port)
    """Port to listen on, 0 for a free one (environment: PORT)."""
    robot: str = field(default_factory=lambda: Settings().robot)
    """Robot that walks on the page, by name or by the path of its file (environment: ROBOT)."""
    plant: Literal["auto", "ideal", "mujoco"] = field(default_factory=lambda: Settings().walk_plant)
    """Plant that the joints move: auto takes contact physics where this machine keeps up (environment: WALK_PLANT)."""
    scene: Literal["full", "light"] = field(default_factory=lambda: Settings().scene)
    """Light for browsers that render without a graphics card (environment: SCENE)."""

    def __call__(self) -> None:
        """Serve until interrupted."""
        from app.main import serve  # loads the server's libraries, which takes a second; other commands need none

        serve(Settings(host=self.host, port=self.port, robot=self.robot, walk_plant=self.plant, scene=self.scene))


@dataclass(frozen=True, slots=True)
class FiguresCommand:
    """Make the paper's figures, and a report of its claims beside what was measured."""

    out: Path
    """Folder for a folder of figures of each robot, and for report.md."""
    robots: tuple[str, ...] = ()
    """Robots whose figures are made; by default all whose sample motion ships."""
    formats: tuple[Literal["svg", "pdf", "png"], ...] = ("svg", "pdf")
    """Endings of their files."""
    control_period: float = Parameters().control_period
    """Time from one tick to the next [s]; 0.1 is exactly the paper's scheme."""

    def __call__(self) -> None:
        """Simulate, draw and measure."""
        from app.figures import make_figures  # the plotting library takes a second to load

        make_figures(self.out, self.robots, self.formats, self.control_period, report=print)


@dataclass(frozen=True, slots=True)
class BenchCommand:
    """Measure what a tick costs: by stage, by solver, and against real time."""

    json: bool = False
    """Print JSON."""

    def __call__(self) -> None:
        """Measure and print."""
        from app.bench import bench, table  # the other commands need none of the solvers it compares

        result = bench(report=lambda what: print(f"measuring {what} ...", file=sys.stderr))
        print(dumps(result.to_mapping(), indent=2) if self.json else table(result), end="\n" if self.json else "")


SubCommand = (
    Annotated[ServeCommand, tyro.conf.subcommand("serve")]
    | Annotated[RunCommand, tyro.conf.subcommand("run")]
    | Annotated[CompareCommand, tyro.conf.subcommand("compare")]
    | Annotated[ReportCommand, tyro.conf.subcommand("report")]
    | Annotated[BenchCommand, tyro.conf.subcommand("bench")]
    | Annotated[FiguresCommand, tyro.conf.subcommand("figures")]
    | Annotated[ScenariosCommand, tyro.conf.subcommand("scenarios")]
    | Annotated[LessonsCommand, tyro.conf.subcommand("lessons")]
    | Annotated[RobotsCommand, tyro.conf.subcommand("robots")]
    | Annotated[FootholdsCommand, tyro.conf.subcommand("footholds")]
    | Annotated[SweepCommand, tyro.conf.subcommand("sweep")]
    | Annotated[SweepCompareCommand, tyro.conf.subcommand("sweep-compare")]
    | Annotated[ImportCommand, tyro.conf.subcommand("import")]
)


def main() -> None:
    """Run the command, whose exit code is what it returns; what the user can correct is one line on stderr and 2."""
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    try:
        command = tyro.cli(SubCommand, prog="walk", description=__doc__, config=(tyro.conf.OmitArgPrefixes,))
        code = command()
        sys.stdout.flush()
    except ValidationError as error:
        problems = "; ".join(f"{'.'.join(map(str, e['loc']))} = {e['input']!r}: {e['msg']}" for e in error.errors())
        _give_up(problems)
    except BrokenPipeError:  # whoever reads has read enough, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python complains when it ends
        sys.exit(128 + signal.SIGPIPE)
    except (WalkError, OSError) as error:
        _give_up(str(error))
    except KeyboardInterrupt:
        sys.exit(130)
    else:
        sys.exit(code)


def _give_up(reason: str) -> None:
    print(f"walk: {reason}", file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()
