"""The largest impulse that the robot survives, by direction and phase of the step, with both step timings.

    python benchmarks/push_survival.py                    # all rows: 8 directions, 8 phases in place and 4 walking
    python benchmarks/push_survival.py "talos in place" --timing adaptive --phases 4
    python benchmarks/push_survival.py --timing adaptive --bound    # beside what any controller could survive

Survival is not monotonic in the impulse, so each direction is scanned in coarse steps up to the first fall, and
the interval before it is bisected. A push is survived if the robot is on its feet 8 s later, or has walked by the
paper's QP for 2.4 s without a break: from there on it repeats itself.
"""

import argparse
import math
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.analysis.push_bound import StepClass, largest_impulse
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status
from walkcore.state import SimulationState

IN_PLACE = {"stepping_in_place": True}
ROWS = {
    "talos in place": ("talos", IN_PLACE, Reference()),
    "talos 0.3 m/s": ("talos", IN_PLACE, Reference(vx=0.3)),
    "talos standing": ("talos", {}, Reference()),
    "hrp2 in place": ("hrp2", IN_PLACE, Reference()),
    "hrp2 0.3 m/s": ("hrp2", IN_PLACE, Reference(vx=0.3)),
}
COARSE, TOLERANCE, LARGEST = 8.0, 2.0, 160.0  # [N s]
DURATION, QUIET = 8.0, 2.4  # [s]
STEADY = 8.0  # [s] of walking before the push


@dataclass(frozen=True)
class Cell:
    """One direction and one phase of a row."""

    row: str
    timing: str
    direction: float
    """[rad], in the world."""
    phase: float
    """Fraction of the step that has passed since the touchdown."""
    period: float
    """Duration of a tick [s]."""
    solver: str


def main() -> None:
    """Print worst, median and mean of each row."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="*", default=list(ROWS))
    parser.add_argument("--timing", nargs="*", default=["fixed", "adaptive"])
    parser.add_argument("--directions", type=int, default=8)
    parser.add_argument("--phases", type=int)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--period", type=float, default=0.005, help="duration of a tick [s]")
    parser.add_argument("--solver", default="piqp")
    parser.add_argument("--bound", action="store_true", help="print what any controller could survive, too")
    parser.add_argument("--cells", action="store_true", help="print each cell")
    options = parser.parse_args()
    with ProcessPoolExecutor(options.workers) as pool:
        for row in options.rows:
            for timing in options.timing:
                cells = list(_cells(row, timing, options))
                found = np.array(list(pool.map(largest_survived, cells)))
                print(f"{row:16} {timing:9} {_summary(found)}", flush=True)
                if options.cells:
                    print(found.reshape(-1, options.directions).astype(int), flush=True)
            if options.bound:
                found = np.array(list(pool.map(bound, _cells(row, "fixed", options))))
                print(f"{row:16} bound     {_summary(found)}", flush=True)


def _cells(row: str, timing: str, options: argparse.Namespace) -> Iterator[Cell]:
    nb_phases = 1 if "standing" in row else options.phases or (8 if "in place" in row else 4)
    nb_directions = options.directions
    for phase in range(nb_phases):
        for k in range(nb_directions):
            angle = 2 * math.pi * k / nb_directions
            yield Cell(row, timing, angle, phase / nb_phases, options.period, options.solver)


def _summary(found: np.ndarray) -> str:
    return f"worst {found.min():.0f}  median {np.median(found):.0f}  mean {found.mean():.1f}"


def largest_survived(cell: Cell) -> float:
    """The largest impulse that is survived with all smaller ones that were tried [N s]."""
    simulation, reference, state = _before_push(cell.row, cell.timing, cell.phase, cell.period, cell.solver)
    direction = np.array([math.cos(cell.direction), math.sin(cell.direction)])

    def survives(impulse: float) -> bool:
        simulation.restore(state)
        return _survives(simulation, reference, impulse * direction)

    low, high = 0.0, COARSE
    while high < LARGEST and survives(high):
        low, high = high, high + COARSE
    while high - low > TOLERANCE:
        middle = (low + high) / 2
        low, high = (middle, high) if survives(middle) else (low, middle)
    return low


def bound(cell: Cell) -> float:
    """The largest impulse that any controller of the class could survive [N s]."""
    simulation, reference, state = _before_push(cell.row, "fixed", cell.phase, cell.period, cell.solver)
    direction = np.array([math.cos(cell.direction), math.sin(cell.direction)])
    simulation.restore(state)
    before = simulation.preview(Command(reference))
    T = simulation.parameters.double_support_duration
    return largest_impulse(before, simulation.robot, T, direction, StepClass())


def _survives(simulation: Simulation, reference: Reference, impulse: np.ndarray) -> bool:
    period = simulation.parameters.control_period
    solved_for = 0
    snapshot = simulation.step(Command(reference, Push(impulse)))
    for _ in range(round(DURATION / period)):
        snapshot = simulation.step(Command(reference))
        if snapshot.status is Status.FALLEN:
            return False
        solved_for = solved_for + 1 if snapshot.status is Status.SOLVED else 0
        if solved_for * period > QUIET:
            return True
    return True


@lru_cache(maxsize=32)
def _before_push(
    row: str, timing: str, phase: float, period: float, solver: str
) -> tuple[Simulation, Reference, SimulationState]:
    """A steady walk of the point mass, as far into a step as the phase says."""
    name, values, reference = ROWS[row]
    chosen = {"step_timing": timing, "control_period": period, "solver": solver}
    parameters = Parameters.from_mapping(values | chosen)
    simulation = Simulation(replace(load_robot(name), body=None), parameters)
    before = simulation.step(Command(reference))
    for _ in range(round(STEADY / parameters.control_period)):
        before = simulation.step(Command(reference))
    if before.phase is not Phase.STANDING:
        while (
            simulation.preview(Command(reference)).phase is not Phase.DOUBLE_SUPPORT
            or before.phase is not Phase.SINGLE_SUPPORT
        ):
            before = simulation.step(Command(reference))
        for _ in range(round(phase * parameters.step_duration / parameters.control_period)):
            simulation.step(Command(reference))
    return simulation, reference, simulation.state


if __name__ == "__main__":
    main()
