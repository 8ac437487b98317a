"""One HTML page of a sweep that opens from disk: its map, where a click on a cell shows numbers and scenario."""

import html
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from app.formats import FORMATS
from app.report.pages import embedded_figure
from app.sweeps.cells import write_whole
from app.sweeps.summary import WalkCells, summary_rows
from walkcore.analysis.cell_outcome import CellOutcome, nominal_walk, replay
from walkcore.analysis.survival import OBSERVED
from walkcore.analysis.sweep import Sweep
from walkcore.errors import InvalidValueError
from walkcore.scenario.recording import record
from walkcore.scenario.scenario import scenario_from_mapping

TEMPLATE = Path(__file__).with_name("page.html")
PAGE, REPLAYS = "sweep.html", "replays"
MAX_CELLS_SHOWN = 50_000  # of a page that a browser opens at once
MAX_FIGURES = 8  # inside of the page; the others lie beside it


def write_page(
    folder: Path,
    sweep: Sweep,
    outcomes: Sequence[CellOutcome],
    walks: Sequence[WalkCells],
    figures: Sequence[str],
) -> Path:
    """Write the page.

    Args:
        folder: of the sweep, where its figures and replays lie.
        sweep: to be shown.
        outcomes: of its cells.
        walks: of the sweep.
        figures: names of the figures' files.

    Raises:
        InvalidValueError: if it has more cells than a page can show.
    """
    if sweep.nb_cells > MAX_CELLS_SHOWN:
        raise InvalidValueError("cells of the page", sweep.nb_cells, f"must be at most {MAX_CELLS_SHOWN}")
    drawings = "\n".join(
        f"<figure>{embedded_figure(folder / name, Path(name).stem)}</figure>" for name in figures[:MAX_FIGURES]
    )
    data = json.dumps(_data(folder, sweep, outcomes, walks)).replace("<", "\\u003c")
    page = TEMPLATE.read_text(encoding="utf-8")
    for mark, text in (("TITLE", html.escape(sweep.name)), ("FIGURES", drawings), ("DATA", data)):
        page = page.replace(f">{mark}<", f">{text}<", 1)
    write_whole(folder / PAGE, page)
    return folder / PAGE


def _data(folder: Path, sweep: Sweep, outcomes: Sequence[CellOutcome], walks: Sequence[WalkCells]) -> dict[str, Any]:
    pushes = sweep.pushes
    return {
        "name": sweep.name,
        "description": sweep.description,
        "directions": pushes.directions,
        "phases": pushes.phases,
        "duration": pushes.duration,
        "max_impulse": pushes.scan.max_impulse,
        "tolerance": pushes.scan.tolerance,
        "observed": OBSERVED,
        "walks": [_walk(sweep, outcomes, walk) for walk in walks],
        "rows": summary_rows(walks),
        "replays": _replays(folder),
    }


def _walk(sweep: Sweep, outcomes: Sequence[CellOutcome], walk: WalkCells) -> dict[str, Any]:
    """The cells of a walk by direction and phase, and the beginning of the scenario that walks one again."""
    nb, source = walk.largest.size, walk.scenario.source
    cells = outcomes[walk.number * nb : (walk.number + 1) * nb]
    first = walk.number * nb
    has_fallen = bool(cells[0].largest_impulse is None)
    phases = [sweep.cell(first + k) for k in range(sweep.pushes.phases)]
    times = [] if has_fallen else [replay(sweep, cell, 0.0)["events"][1]["t"] for cell in phases]
    return {
        "name": walk.name,
        "cells": [[c.largest_impulse, c.delta_v, c.islands, c.success_low, c.success_high] for c in cells],
        "push_times": times,
        "walk_before": {key: source[key] for key in ("robot", "parameters", "world") if key in source}
        | {"reference": source["events"][0]},
    }


def write_replays(folder: Path, sweep: Sweep, outcomes: Sequence[CellOutcome], chosen: Iterable[int]) -> None:
    """Write replays in 3-D of chosen cells: their largest impulse, and one that was lethal.

    Raises:
        InvalidValueError: if there is no such cell, or its walk falls without a push.
    """
    for index in chosen:
        if not 0 <= index < sweep.nb_cells:
            raise InvalidValueError("replay", index, f"must be a cell, in [0, {sweep.nb_cells - 1}]")
        cell, largest = sweep.cell(index), outcomes[index].largest_impulse
        if largest is None or nominal_walk(sweep, cell.walk).has_fallen:
            raise InvalidValueError("replay", index, "must be a cell whose walk does not fall without a push")
        (folder / REPLAYS).mkdir(exist_ok=True)
        for word, impulse in (("survived", largest), ("lethal", largest + sweep.pushes.scan.tolerance)):
            if word == "lethal" and impulse > sweep.pushes.scan.max_impulse:
                continue
            recording = record(scenario_from_mapping(replay(sweep, cell, impulse)))
            FORMATS["html"].write(recording, recording.run_json(), folder / REPLAYS / f"{index}-{word}.html")


def _replays(folder: Path) -> Mapping[str, dict[str, str]]:
    """Words and address of the replays that lie beside the page, by the number of their cell."""
    found: dict[str, dict[str, str]] = {}
    for file in sorted((folder / REPLAYS).glob("*-*.html")):
        index, word = file.stem.split("-", 1)
        found.setdefault(index, {})[f"see it {word}"] = f"{REPLAYS}/{file.name}"
    return found
