"""How hard a robot can be pushed by each method of the paper: the shipped sweep `methods`, drawn method by method."""

from pathlib import Path

import numpy as np
from matplotlib.ticker import MultipleLocator

from app.drawing import palette
from app.drawing.axes import figure, ink
from app.sweeps.cells import CellStore
from app.sweeps.engine import run_sweep, sweep_versions
from app.sweeps.summary import WalkCells, walks_of
from app.tables import markdown_table
from walkcore.analysis.sweep import Sweep, load_sweep, sweep_from_mapping

SWEEP = "methods"


def methods_sweep(robot: str) -> Sweep:
    """The shipped sweep of all methods for one robot.

    Args:
        robot: its name.
    """
    return sweep_from_mapping({**load_sweep(SWEEP).source, "robots": [robot]})


def walk_methods(folder: Path, sweep: Sweep) -> list[WalkCells]:
    """The cells of each method, walked on all cores unless the folder holds them.

    Args:
        folder: for the table of cells, as `walk sweep` has it.
        sweep: of the methods.

    Raises:
        InvalidValueError: if the folder holds another sweep.
        OSError: if it cannot be written to.
    """
    store = CellStore(folder, sweep, sweep_versions(sweep))
    run_sweep(sweep, store)
    store.write_table()
    return walks_of(sweep, [store.outcomes[index] for index in range(sweep.nb_cells)])


def draw_methods(path: Path, formats: tuple[str, ...], title: str, walks: list[WalkCells]) -> None:
    """Draw worst to best cell, the middle half and the median of each method, the one that survives most on top.

    Args:
        path: of the figure, without its ending.
        formats: endings: svg, pdf, png.
        title: of the figure.
        walks: one for each method; it may fall without a push.
    """
    walks = sorted(walks, key=lambda walk: -float(np.median(walk.largest)))
    magenta = ink(palette.PUSH)
    with figure(path, formats, 0.9 + 0.32 * len(walks)) as axes:
        for y, walk in enumerate(walks):
            worst, low, median, high, best = np.percentile(walk.largest, [0, 25, 50, 75, 100])
            axes.plot([worst, best], [y, y], color=magenta, linewidth=1.0)
            axes.plot([low, high], [y, y], color=magenta, linewidth=7.0, alpha=0.3, solid_capstyle="butt")
            axes.plot(worst, y, "|", color="#16121e", markersize=9)
            axes.plot(median, y, "o", color=magenta, markersize=5)
            if walk.nb_capped:
                axes.plot(best, y, ">", color=magenta, markersize=4)
        axes.set_yticks(range(len(walks)), [walk.scenario.parameters.formulation.label for walk in walks])
        axes.invert_yaxis()
        axes.xaxis.set_major_locator(MultipleLocator(10.0))
        axes.set(xlabel="largest push survived [N s]: worst cell, middle half, median, best cell", xlim=(0.0, None))
        axes.set_title(title)


def table_of_methods(walks: list[WalkCells]) -> str:
    """A Markdown table of what each method survives, in the order of the sweep."""
    rows = [["method", "worst", "median", "mean [N s]", "worst", "median [m/s]", "beyond what was tried"]]
    for walk in walks:
        found = walk.summary()
        impulse, delta_v = found["largest_impulse"], found["delta_v"]
        numbers = [f"{impulse[key]:.1f}" for key in ("worst", "median", "mean")]
        numbers += [f"{delta_v[key]:.2f}" for key in ("worst", "median")]
        capped = f"{walk.nb_capped} of {walk.largest.size}"
        rows.append([walk.scenario.parameters.formulation.label, *numbers, capped])
    title = "Largest pushes survived, by all methods on the same pushes, steps of fixed duration:"
    return f"{title}\n\n{markdown_table(rows)}\n"
