"""The commands of `walk` around sweeps: run one, and compare two."""

import json
import sys
from dataclasses import dataclass
from pathlib import Path

import tyro
from tqdm import tqdm

from app.settings import usable_cores
from app.tables import text_table
from walkcore.analysis.sweep import Sweep, load_sweep, sweep_names
from walkcore.errors import InvalidValueError

INTERRUPTED = 130
"""Exit code after Ctrl-C, as of a shell."""
BAR = "{l_bar}{bar}| {n_fmt}/{total_fmt} cells [{elapsed}<{postfix}]"


@dataclass(frozen=True, slots=True)
class SweepCommand:
    """Find how hard a robot can be pushed: by direction and phase of the step, over every combination of some choices.

    Stopped in whatever way, the same command goes on where it was. Without FILE it lists the sweeps that ship.
    """

    file: tyro.conf.Positional[str] = ""
    """Name of a sweep that ships, or a file."""
    out: Path | None = None
    """Folder for cells.parquet, sweep.json, figures and the page."""
    workers: int | None = None
    """Processes; by default one for each core, or all that the scheduler has."""
    scheduler: str | None = None
    """Address of a Dask scheduler whose workers do the work, such as tcp://host:8786."""
    bound: bool = False
    """Draw what any such controller could survive at most into the roses."""
    replay: tuple[int, ...] = ()
    """Numbers of cells to be shown in 3-D, one push survived and one not."""
    dry_run: bool = False
    """Tell the number of cells and what they would cost, and walk none."""
    schema: bool = False
    """Print the JSON schema of a sweep file instead."""

    def __call__(self) -> int:
        """Walk, write and tell."""
        if self.schema:
            from app.http.sweep_schemas import sweep_schema

            print(json.dumps(sweep_schema(), indent=2))
            return 0
        if not self.file:
            _list_sweeps()
            return 0
        if self.workers is not None and not 1 <= self.workers <= 10_000:
            raise InvalidValueError("workers", self.workers, "must lie in [1, 10000]")
        sweep = load_sweep(self.file)
        if self.dry_run:
            self._tell_cost(sweep)
            return 0
        if self.out is None:
            raise InvalidValueError("out", None, "is missing: name the folder for the results, --out DIR")
        return self._run(sweep, self.out)

    def _tell_cost(self, sweep: Sweep) -> None:
        from app.sweeps.engine import estimate

        cost, nb_workers = estimate(sweep), self.workers or usable_cores()
        print(
            f"{sweep.name}: {cost.nb_cells} cells of {len(sweep.walks)} walks, {cost.nb_trials} trials and those of"
            f" islands; about {_duration(cost.seconds)} of processor time, {_duration(cost.seconds / nb_workers)} with"
            f" {nb_workers} {'process' if nb_workers == 1 else 'processes'}"
        )

    def _run(self, sweep: Sweep, out: Path) -> int:
        from app.sweeps.cells import CellStore
        from app.sweeps.engine import SweepProgress, lowest_bounds, run_sweep, sweep_versions
        from app.sweeps.results import write_results
        from app.sweeps.summary import summary_rows

        store = CellStore(out, sweep, sweep_versions(sweep))
        interval = 0.5 if sys.stderr.isatty() else 30.0  # a log gets a line now and then
        with tqdm(total=sweep.nb_cells, desc=sweep.name, bar_format=BAR, mininterval=interval) as bar:

            def show(progress: SweepProgress) -> None:
                left = progress.time_left
                bar.set_postfix_str("?" if left is None else _duration(left) + " left", refresh=False)
                bar.update(progress.nb_done - bar.n)

            try:
                run_sweep(sweep, store, self.workers, self.scheduler, show)
            except KeyboardInterrupt:
                bar.close()
                kept = f"{len(store.outcomes)} of {sweep.nb_cells} cells are kept in {out}"
                print(f"walk: stopped; {kept}, and the same command goes on from there", file=sys.stderr)
                return INTERRUPTED
        table = store.write_table()
        bounds = lowest_bounds(sweep, self.workers, self.scheduler) if self.bound else ()
        print(text_table(summary_rows(write_results(out, bounds, self.replay))))
        print(f"{sweep.name}: {sweep.nb_cells} cells written to {table}, and a page to see them: {out / 'sweep.html'}")
        return 0


def _list_sweeps() -> None:
    for name in sweep_names():
        sweep = load_sweep(name)
        print(f"{name:24} {sweep.nb_cells:6} cells  {sweep.description}")


def _duration(seconds: float) -> str:
    """A duration in the largest unit that suits it."""
    if seconds < 99.5:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 99.5 * 60 else f"{seconds / 3600:.1f} h"


@dataclass(frozen=True, slots=True)
class SweepCompareCommand:
    """Put two sweeps side by side: which cells became better, which worse, and by how much.

    Walks of the same robot, parameters and reference belong together; those that are left, in their order, where robot
    and reference are the same.
    """

    before: tyro.conf.Positional[Path]
    """Folder that `walk sweep` wrote."""
    after: tyro.conf.Positional[Path]
    """Another one."""

    def __call__(self) -> None:
        """Read, compare and print."""
        from app.sweeps.cells import read_cells
        from app.sweeps.comparison import comparison_rows, extremes, paired

        one, other = (read_cells(folder)[:2] for folder in (self.before, self.after))
        tolerance = max(sweep.pushes.scan.tolerance for sweep, _ in (one, other))
        pairs = paired(one, other)
        print(text_table(comparison_rows(pairs, tolerance)))
        for line in extremes(pairs, tolerance):
            print(line)
