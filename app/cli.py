"""The `walk` command."""

import os

# The matrices of the walk are small: threads of the algebra library only fight with each other over them.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import logging
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro
from pydantic import ValidationError

from app.settings import Settings
from walkcore import WalkError, load_robot, robot_names
from walkcore.recording import record
from walkcore.scenario import load_scenario, scenario_names


@dataclass(frozen=True, slots=True)
class Serve:
    """Serve the page, the scene and the API on one port."""

    host: str = field(default_factory=lambda: Settings().host)
    """Address to listen on (environment: HOST)."""
    port: int = field(default_factory=lambda: Settings().port)
    """Port to listen on, 0 for a free one (environment: PORT)."""
    robot: str = field(default_factory=lambda: Settings().robot)
    """Robot that walks on the page (environment: ROBOT)."""
    scene: Literal["full", "light"] = field(default_factory=lambda: Settings().scene)
    """Light for browsers that render without a graphics card (environment: SCENE)."""

    def __call__(self) -> None:
        """Serve until interrupted."""
        from app.serve import serve  # the server's libraries take a second to load; the other commands need none

        serve(Settings(host=self.host, port=self.port, robot=self.robot, scene=self.scene))


@dataclass(frozen=True, slots=True)
class Run:
    """Simulate a scenario as fast as the machine can, and write its recording."""

    scenario: tyro.conf.Positional[str]
    """Name of one that ships (see `walk scenarios`), or a file."""
    out: Path
    """Folder for recording.npz, recording.csv and run.json."""

    def __call__(self) -> None:
        """Simulate and write."""
        scenario = load_scenario(self.scenario)
        recording = record(scenario, progress=_show_progress if sys.stderr.isatty() else None)
        recording.write(self.out)
        print(f"{scenario.name}: {scenario.nb_ticks} ticks of {scenario.robot.name} written to {self.out}")


@dataclass(frozen=True, slots=True)
class Scenarios:
    """List the scenarios that ship."""

    def __call__(self) -> None:
        """Print name, robot and duration of each."""
        for name in scenario_names():
            scenario = load_scenario(name)
            print(f"{name:32} {scenario.robot.name:8} {scenario.duration:g} s")


@dataclass(frozen=True, slots=True)
class Robots:
    """List the robots that ship."""

    def __call__(self) -> None:
        """Print name and limits of each."""
        for name in robot_names():
            robot = load_robot(name)
            limits = ", ".join(f"{key} {low:g} to {high:g}" for key, (low, high) in robot.max_reference.items())
            print(f"{name:8} {robot.mass:.1f} kg; {limits}; push {robot.max_push:g} N s")


SubCommand = (
    Annotated[Serve, tyro.conf.subcommand("serve")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Scenarios, tyro.conf.subcommand("scenarios")]
    | Annotated[Robots, tyro.conf.subcommand("robots")]
)


def main() -> None:
    """Run the command; what the user can correct is one line on stderr and exit code 2."""
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    try:
        command = tyro.cli(SubCommand, prog="walk", description=__doc__, config=(tyro.conf.OmitArgPrefixes,))
        command()
    except ValidationError as error:
        problems = "; ".join(f"{'.'.join(map(str, e['loc']))} = {e['input']!r}: {e['msg']}" for e in error.errors())
        _give_up(problems)
    except (WalkError, OSError) as error:
        _give_up(str(error))
    except KeyboardInterrupt:
        sys.exit(130)


def _give_up(reason: str) -> None:
    print(f"walk: {reason}", file=sys.stderr)
    sys.exit(2)


def _show_progress(fraction: float) -> None:
    print(f"\r{fraction:4.0%}", end="\n" if fraction >= 1.0 else "", file=sys.stderr, flush=True)
