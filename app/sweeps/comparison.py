"""Two sweeps side by side: which cells became better, which worse, and by how much."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import degrees

import numpy as np

from app.sweeps.summary import walk_names
from walkcore.analysis.cell_outcome import CellOutcome
from walkcore.analysis.sweep import Sweep
from walkcore.errors import InvalidValueError

NB_EXTREMES = 5  # cells that changed most, told one by one on each side


@dataclass(frozen=True, slots=True, eq=False)
class WalkPair:
    """A walk of one sweep and its counterpart of another."""

    name: str
    before: Mapping[tuple[float, float], float]
    """Largest impulse by direction [rad] and phase, of the cells that both have [N s]."""
    after: Mapping[tuple[float, float], float]

    @property
    def changes(self) -> dict[tuple[float, float], float]:
        """Change of the largest impulse by direction and phase [N s]."""
        return {cell: self.after[cell] - self.before[cell] for cell in self.before}


def comparison_rows(pairs: Sequence[WalkPair], tolerance: float) -> list[list[str]]:
    """A table of all pairs, its head first.

    Args:
        pairs: of the two sweeps.
        tolerance: change that counts as none [N s].
    """
    rows = [["walk", "cells", "better", "worse", "same", "worst N s", "median N s", "mean change"]]
    for pair in pairs:
        changes = np.array(list(pair.changes.values()))
        before, after = (np.array(list(side.values())) for side in (pair.before, pair.after))
        better, worse = int((changes > tolerance).sum()), int((changes < -tolerance).sum())
        both = [f"{total(before):.1f} -> {total(after):.1f}" for total in (np.min, np.median)]
        counts = [str(n) for n in (len(changes), better, worse, len(changes) - better - worse)]
        rows.append([pair.name, *counts, *both, f"{changes.mean():+.1f} N s"])
    return rows


def extremes(pairs: Sequence[WalkPair], tolerance: float) -> Iterator[str]:
    """A line for each of the cells that changed most, the losses first."""
    cells = [(change, pair.name, *cell) for pair in pairs for cell, change in pair.changes.items()]
    cells.sort()
    told = [cell for cell in cells[:NB_EXTREMES] if cell[0] < -tolerance]
    told += [cell for cell in cells[::-1][:NB_EXTREMES] if cell[0] > tolerance]
    for change, name, direction, phase in told:
        yield f"{change:+6.1f} N s  {name}, at {degrees(direction):g} degrees, phase {phase:g}"


def paired(one: tuple[Sweep, Sequence[CellOutcome]], other: tuple[Sweep, Sequence[CellOutcome]]) -> list[WalkPair]:
    """The walks of two sweeps that belong together: the same ones, then those of the same robot and reference.

    Raises:
        InvalidValueError: if they have no cell in common.
    """
    left = {k: other[0].walks[k].source for k in range(len(other[0].walks))}
    names, other_names = walk_names(one[0]), walk_names(other[0])
    pairs: list[WalkPair] = []
    for exact in (True, False):
        for k, walk in enumerate(one[0].walks):
            if names[k] == "":
                continue
            match = next((j for j, source in left.items() if _belong(walk.source, source, exact=exact)), None)
            if match is None:
                continue
            del left[match]
            name = names[k] if exact else f"{names[k]} -> {other_names[match]}"
            names[k] = ""
            before, after = _cells(*one, k), _cells(*other, match)
            common = [cell for cell in before if cell in after]
            if common:
                pairs.append(WalkPair(name, {c: before[c] for c in common}, {c: after[c] for c in common}))
    if not pairs:
        raise InvalidValueError("sweeps", [one[0].name, other[0].name], "have no cell in common")
    return pairs


def _belong(one: Mapping[str, object], other: Mapping[str, object], *, exact: bool) -> bool:
    same = one["robot"] == other["robot"] and one["events"][0] == other["events"][0]  # pyright: ignore[reportIndexIssue]
    return same and (not exact or one["parameters"] == other["parameters"])


def _cells(sweep: Sweep, outcomes: Sequence[CellOutcome], walk: int) -> dict[tuple[float, float], float]:
    """Largest impulse of the cells of a walk, by direction and phase; none where it falls without a push."""
    nb = sweep.pushes.directions * sweep.pushes.phases
    found: dict[tuple[float, float], float] = {}
    for index in range(walk * nb, (walk + 1) * nb):
        cell, largest = sweep.cell(index), outcomes[index].largest_impulse
        if largest is not None:
            found[round(cell.direction, 9), round(cell.phase, 9)] = largest
    return found
