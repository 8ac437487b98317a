"""The largest impulse that the robot survives, by direction and phase of the step, with both step timings.

    python benchmarks/push_survival.py                    # all rows: 8 directions, 8 phases in place and 4 walking
    python benchmarks/push_survival.py "talos in place" --timing adaptive --phases 4
    python benchmarks/push_survival.py --timing adaptive --bound    # beside what any controller could survive

Walks, trials and the scan are those of a sweep, `walkcore.analysis.survival`; impulses go beyond the robots' limits.
"""

import argparse
import math
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from walkcore import Parameters, Push, Reference, load_robot
from walkcore.analysis.survival import ImpulseScan, NominalWalk, survived_impulses

IN_PLACE = {"stepping_in_place": True}
ROWS = {
    "talos in place": ("talos", IN_PLACE, Reference()),
    "talos 0.3 m/s": ("talos", IN_PLACE, Reference(vx=0.3)),
    "talos standing": ("talos", {}, Reference()),
    "hrp2 in place": ("hrp2", IN_PLACE, Reference()),
    "hrp2 0.3 m/s": ("hrp2", IN_PLACE, Reference(vx=0.3)),
}
SCAN = ImpulseScan(max_impulse=160.0, coarse=8.0, tolerance=2.0)  # [N s]


@dataclass(frozen=True)
class Cell:
    """One direction and one phase of a row."""

    row: str
    timing: str
    direction: float
    """[rad], in the heading frame."""
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
    walk = _walk(cell.row, cell.timing, cell.period, cell.solver)
    return survived_impulses(lambda impulse: walk.survives(cell.phase, Push(impulse * _unit(cell))), SCAN).largest


def bound(cell: Cell) -> float:
    """The largest impulse that any controller of the class could survive [N s]."""
    return _walk(cell.row, "fixed", cell.period, cell.solver).bound(cell.phase, _unit(cell))


def _unit(cell: Cell) -> np.ndarray:
    return np.array([math.cos(cell.direction), math.sin(cell.direction)])


@lru_cache(maxsize=4)
def _walk(row: str, timing: str, period: float, solver: str) -> NominalWalk:
    """The steady walk of a row."""
    name, values, reference = ROWS[row]
    chosen = {"step_timing": timing, "control_period": period, "solver": solver}
    return NominalWalk(load_robot(name), Parameters.from_mapping(values | chosen), reference)


if __name__ == "__main__":
    main()
