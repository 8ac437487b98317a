"""Outcome of a cell of a sweep: the impulses that its walk survives, and the scenario that walks there again.

Each cell is decided by itself: its outcome depends neither on the other cells nor on who computes it.
"""

import hashlib
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from walkcore.analysis.survival import OBSERVED, NominalWalk, survived_impulses
from walkcore.analysis.sweep import Cell, Sweep, is_noisy
from walkcore.command import Push
from walkcore.plant.world import MAX_SEED

WILSON_Z = 1.959963984540054  # of the 95 % interval


@dataclass(frozen=True, slots=True)
class CellOutcome:
    """The impulses that are survived in a cell."""

    largest_impulse: float | None
    """Survived with all smaller ones that were tried [N s]; None where the robot falls without any push."""
    delta_v: float | None
    """Velocity that this impulse gives to the robot's mass [m/s]."""
    islands: tuple[tuple[float, float], ...] = ()
    """Further intervals that are survived [N s]."""
    success_low: float | None = None
    """Least share of seeds that survive the largest impulse, by Wilson's interval; None with a single seed."""
    success_high: float | None = None
    """Largest share of them."""


def outcome(sweep: Sweep, cell: Cell) -> CellOutcome:
    """Outcome of a cell: the impulses that are survived, a function of the sweep and the cell alone."""
    walk = nominal_walk(sweep, cell.walk)
    if walk.has_fallen:
        return CellOutcome(None, None)
    nb_survived: dict[float, int] = {}
    seeds = list(cell_seeds(sweep, cell))

    def survives(impulse: float) -> bool:
        push = Push(impulse * cell.unit_vector, sweep.pushes.duration)
        nb_survived[impulse] = sum(walk.survives(cell.phase, push, seed) for seed in seeds)
        return 2 * nb_survived[impulse] >= len(seeds)  # with one seed: that one

    survived = survived_impulses(survives, sweep.pushes.scan)
    low = high = None
    if len(seeds) > 1 and survived.largest in nb_survived:
        low, high = wilson_interval(nb_survived[survived.largest], len(seeds))
    return CellOutcome(survived.largest, survived.largest / walk.robot.mass, survived.islands, low, high)


def cell_bound(sweep: Sweep, cell: Cell) -> float:
    """The largest impulse that any controller of the class of `push_bound` could survive in a cell [N s]."""
    walk = nominal_walk(sweep, cell.walk)
    return 0.0 if walk.has_fallen else walk.bound(cell.phase, cell.unit_vector)


def cell_seeds(sweep: Sweep, cell: Cell) -> Iterator[int | None]:
    """Seeds of the noise in a cell, derived from what the cell is and not from where it stands; None without noise."""
    scenario = sweep.walks[cell.walk]
    if not is_noisy(scenario):
        yield None
        return
    identity = {"walk": scenario.source, "direction": cell.direction, "phase": cell.phase}
    what = json.dumps(identity, sort_keys=True, separators=(",", ":"))
    for k in range(sweep.seeds):
        digest = hashlib.sha256(f"{what} {k}".encode()).digest()
        yield int.from_bytes(digest[:4], "little") & MAX_SEED


def wilson_interval(nb_successes: int, nb_trials: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a success rate.

    With p the share of successes of n and z the quantile of the normal distribution:

        (p + z^2/2n -+ z sqrt(p (1 - p) / n + z^2/4n^2)) / (1 + z^2/n)

    Args:
        nb_successes: of the trials.
        nb_trials: n, at least one.
    """
    n, p, z = nb_trials, nb_successes / nb_trials, WILSON_Z
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return max(0.0, middle - half), min(1.0, middle + half)


@lru_cache(maxsize=4)  # cells of a walk stand together
def nominal_walk(sweep: Sweep, walk: int) -> NominalWalk:
    """A walk of the sweep before any push.

    Args:
        sweep: with the walk.
        walk: its number.
    """
    scenario = sweep.walks[walk]
    reference = scenario.events[0].reference
    assert reference is not None
    return NominalWalk(scenario.robot, scenario.parameters, reference, scenario.world, has_body=sweep.has_body)


def replay(sweep: Sweep, cell: Cell, impulse: float) -> dict[str, Any]:
    """The scenario, for `walk run`, that walks from rest to a cell, pushes there, and goes on until all is decided.

    With noise the walk up to the push is that of the world's own seed.

    Args:
        sweep: with the cell.
        cell: to be walked.
        impulse: of the push [N s].
    """
    scenario = sweep.walks[cell.walk]
    walk, period = nominal_walk(sweep, cell.walk), scenario.parameters.control_period
    t = round(walk.push_tick(cell.phase) * period, 9)
    reference, _ = scenario.source["events"]
    degrees = round(math.degrees(cell.direction), 3)
    push = {"impulse": (impulse * cell.unit_vector).tolist(), "duration": sweep.pushes.duration}
    return {
        "name": f"{sweep.name}-{cell.index}",
        "description": f"Cell {cell.index} of the sweep {sweep.name}: {impulse:g} N s at {degrees:g} degrees,"
        f" phase {cell.phase:g}.",
        **{key: scenario.source[key] for key in ("robot", "parameters", "world") if key in scenario.source},
        "duration": round(t + OBSERVED, 9),
        "events": [reference, {"t": t, "push": push}],
    }
