"""Recorded runs as something to look at in the live scene: poses and decisions, no states to go on from."""

import asyncio
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.formats.stored_run import StoredRun, as_written, read_run
from app.http.schemas import MarkBody, TimelineBody
from app.runs import Runs
from app.runs.restore import why_not
from walkcore import Parameters, Robot, Snapshot
from walkcore.analysis.columns import push_rows
from walkcore.errors import InvalidValueError
from walkcore.mpc.plan import Status
from walkcore.plant.world import World
from walkcore.scenario.replay import replayed

PERIOD = 1 / 60  # [s] between frames
MAX_FRAMES = 3600  # longer walks are shown with fewer frames a second


def run_timeline(run: StoredRun) -> TimelineBody:
    """The ticks of a recorded run, with marks at its pushes and its fall."""
    ticks, period = run["tick"], float(run.parameters["control_period"])
    marks: list[MarkBody] = []
    for first, end in push_rows(run):
        strength = float(np.hypot(run["push_x"][first:end].sum(), run["push_y"][first:end].sum()))
        marks.append(MarkBody(tick=int(ticks[first]), kind="push", text=f"push of {strength:.1f} N s"))
    fallen = np.flatnonzero(run["status"] == Status.FALLEN)
    if len(fallen):
        marks.append(MarkBody(tick=int(ticks[fallen[0]]), kind="fall", text=f"fall: {run.reason}"[:200]))
    return TimelineBody(
        walk=0,
        first_tick=int(ticks[0]),
        last_tick=int(ticks[-1]),
        control_period=period,
        marks=marks,
        no_fork=why_not(run.run),
    )


def check_robot(name: str, robot: Robot) -> None:
    """Refuse a run of another robot.

    Args:
        name: of the robot that walked.
        robot: in the scene.

    Raises:
        InvalidValueError: if it is another one.
    """
    if name != robot.name:
        raise InvalidValueError("run", name, f"must be a run of {robot.name}, which is in the scene")


@dataclass(frozen=True, slots=True, eq=False)
class RunTicks:
    """Frames of a recorded run, all of them in memory."""

    run_id: str
    first_tick: int
    every: int
    """Ticks from one frame to the next."""
    frames: Sequence[Snapshot]
    parameters: Sequence[Parameters]
    """In force at each frame."""
    world: World

    @classmethod
    async def opened(cls, run_id: str, runs: Runs, robot: Robot) -> "RunTicks":
        """The frames of a run, read in a thread.

        Raises:
            InvalidValueError: if it is a run of another robot than the one of the scene, or cannot be read.
        """
        return await asyncio.to_thread(cls._read, run_id, runs, robot)

    @classmethod
    def _read(cls, run_id: str, runs: Runs, robot: Robot) -> "RunTicks":
        folder = runs.file(run_id, "run.json").parent
        with as_written(folder):
            recording = read_run(folder).recording()
            scenario = recording.scenario
            check_robot(scenario.robot.name, robot)
            period = float(recording.parameters["control_period"])
            every = max(1, round(PERIOD / period), -(-len(recording.rows) // MAX_FRAMES))
            changes = scenario.parameter_changes()
            values, rows = [scenario.parameters, *(value for _, value in changes)], [row for row, _ in changes]
            frames = list(replayed(recording, every))
            in_force = [values[bisect_right(rows, row)] for row in range(0, len(recording.rows), every)]
        return cls(run_id, frames[0].tick, every, frames, in_force, scenario.world)

    async def at(self, tick: int) -> tuple[Snapshot, Parameters, World]:
        """The frame that is nearest to a tick."""
        index = min(max(round((tick - self.first_tick) / self.every), 0), len(self.frames) - 1)
        return self.frames[index], self.parameters[index], self.world

    async def before(self, tick: int, nb_ticks: int, every: int) -> Sequence[Snapshot]:
        """Frames of the time before a tick, as `PastTicks.before` has them."""
        step = max(1, every // self.every)
        return [frame for frame in self.frames if tick - nb_ticks <= frame.tick <= tick][::-step][::-1]
