"""Everything that is told of a sweep once its cells are finished: table, summary, figures and page."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from app.sweeps.cells import read_cells
from app.sweeps.figures import draw_figures
from app.sweeps.page import MAX_CELLS_SHOWN, write_page, write_replays
from app.sweeps.summary import WalkCells, walks_of, write_info
from walkcore.values import Vector


def write_results(folder: Path, bounds: Sequence[Vector] = (), replays: Iterable[int] = ()) -> list[WalkCells]:
    """Write what is told of a sweep into the folder that has the table of its cells, and return its walks.

    Args:
        folder: that holds cells.parquet and sweep.json.
        bounds: for each walk, by direction, the impulse that no controller survives in the worst phase [N s].
        replays: numbers of cells to be shown in 3-D.

    Raises:
        InvalidValueError: if the folder holds no finished sweep, or a replay is of no cell.
    """
    sweep, outcomes, _ = read_cells(folder)
    walks = walks_of(sweep, outcomes)
    write_info(folder, walks)
    write_replays(folder, sweep, outcomes, replays)
    figures = draw_figures(folder, walks, bounds)
    if sweep.nb_cells <= MAX_CELLS_SHOWN:
        write_page(folder, sweep, outcomes, walks, figures)
    return walks
