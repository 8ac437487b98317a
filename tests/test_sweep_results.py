"""Results of a sweep: sums, figures, the page from disk, and two sweeps side by side."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from app.commands import cli
from app.sweeps.cells import CellStore, cells_table, write_table
from app.sweeps.comparison import comparison_rows, extremes, paired
from app.sweeps.engine import lowest_bounds, sweep_versions
from app.sweeps.results import write_results
from app.sweeps.summary import summary_rows, walk_names, walks_of
from walkcore import WalkError
from walkcore.analysis.cell_outcome import CellOutcome, cell_bound, replay
from walkcore.analysis.sweep import Sweep, sweep_from_mapping

FAST = {"control_period": 0.05, "stepping_in_place": True, "solver": "daqp"}
SOURCE = {
    "name": "small & <quick>",
    "robots": ["hrp2"],
    "parameters": [FAST, FAST | {"step_timing": "adaptive"}],
    "references": [{}, {"vx": 0.1}],
    "pushes": {"directions": 4, "phases": 2, "max_impulse": 40.0, "tolerance": 1.0},
}
SWEEP = sweep_from_mapping(SOURCE)


def outcomes_of(sweep: Sweep, offset: float = 0.0) -> list[CellOutcome]:
    """Outcomes that somebody made up: each cell its own, one with an island, and one that is capped."""
    impulses = [min(5.0 + index + offset, 40.0) for index in range(sweep.nb_cells)]
    found = [CellOutcome(impulse, impulse / 56.0) for impulse in impulses]
    found[3] = CellOutcome(8.0, 8.0 / 56.0, ((20.0, 24.5),))
    found[-1] = CellOutcome(40.0, 40.0 / 56.0)
    return found


def written(folder: Path, sweep: Sweep, outcomes: list[CellOutcome]) -> Path:
    CellStore(folder, sweep, sweep_versions(sweep))
    write_table(folder / "cells.parquet", cells_table(sweep, dict(enumerate(outcomes))))
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = written(tmp_path_factory.mktemp("sweep"), SWEEP, outcomes_of(SWEEP))
    write_results(folder, bounds=[np.full(4, 50.0)] * 4)
    return folder


def test_names_tell_the_walks_apart():
    assert walk_names(SWEEP) == ["hrp2, in place", "hrp2, 0.1 m/s ahead"] + [
        "hrp2, in place, adaptive",
        "hrp2, 0.1 m/s ahead, adaptive",
    ]


def test_a_walk_backwards_and_to_the_right_is_called_so():
    references = [{"vx": -0.2, "vy": -0.1, "yaw_rate": 0.25}]
    sweep = sweep_from_mapping(SOURCE | {"parameters": [FAST], "references": references})
    assert walk_names(sweep) == ["hrp2, 0.2 m/s back and 0.1 m/s to the right and 0.25 rad/s to the left"]


def test_sums_are_those_of_the_cells(folder):
    walks = json.loads((folder / "sweep.json").read_text())["walks"]
    assert walks[0]["largest_impulse"] == {"worst": 5.0, "median": 8.5, "mean": 8.5}
    assert walks[1]["delta_v"]["worst"] == pytest.approx(13.0 / 56.0)
    assert [walk["cells_with_islands"] for walk in walks] == [1, 0, 0, 0]
    assert [walk["cells_capped"] for walk in walks] == [0, 0, 0, 1]


def test_a_walk_that_falls_without_a_push_is_told():
    outcomes = [CellOutcome(None, None)] * 8 + outcomes_of(SWEEP)[8:]
    walks = walks_of(SWEEP, outcomes)
    assert walks[0].summary()["largest_impulse"]["worst"] is None
    assert summary_rows(walks)[1][1] == "falls without a push"


def test_there_are_figures_of_every_walk_and_the_same_sweep_draws_the_same_bytes(folder, tmp_path):
    drawn = {file.name for file in folder.glob("*.svg")}
    assert drawn == {f"{kind}-{k}.svg" for kind in ("rose", "map") for k in range(4)} | {"speed.svg"} | {
        "roses-0.svg",
        "roses-1.svg",
    }
    assert "bound in the worst phase" in (folder / "rose-0.svg").read_text()
    assert "bound" not in (write_again(tmp_path) / "rose-0.svg").read_text()
    assert (tmp_path / "map-0.svg").read_bytes() == (folder / "map-0.svg").read_bytes()
    assert (tmp_path / "speed.svg").read_bytes() == (folder / "speed.svg").read_bytes()


def write_again(folder: Path) -> Path:
    write_results(written(folder, SWEEP, outcomes_of(SWEEP)))
    return folder


def test_a_click_on_a_cell_shows_its_numbers_and_a_scenario_that_walks_it_again(folder, visit):
    page = visit((folder / "sweep.html").as_uri())
    assert page.locator("h1").inner_text() == SOURCE["name"]
    page.locator("#map .cell").nth(3).click()  # to the left, in the middle of the step
    told = page.locator("#cell").inner_text()
    assert "8.0 N s" in told and "20.0 to 24.5 N s" in told and "90.0" in told
    page.locator("#map").press("ArrowUp")
    assert "7.0 N s" in page.locator("#cell").inner_text()
    page.locator("#walk").select_option(index=3)
    page.locator("#map .cell").nth(7).click()
    shown = json.loads(page.locator("#cell pre").inner_text())
    expected = replay(SWEEP, SWEEP.cell(31), 40.0)
    assert shown["events"][1]["push"].pop("impulse") == pytest.approx(expected["events"][1]["push"].pop("impulse"))
    del expected["description"]
    assert shown == expected and "at least 40.0" in page.locator("#cell").inner_text()


@pytest.mark.exhaustive
def test_a_replay_is_written_beside_the_page_and_linked(tmp_path):
    folder = written(tmp_path, SWEEP, outcomes_of(SWEEP))
    with pytest.raises(WalkError, match="replay = 32: must be a cell"):
        write_results(folder, replays=[32])
    write_results(folder, replays=[0])
    assert (folder / "replays" / "0-survived.html").stat().st_size > 100_000
    assert '"see it lethal": "replays/0-lethal.html"' in (folder / "sweep.html").read_text()


@pytest.mark.exhaustive
def test_the_rose_has_the_lowest_bound_of_the_phases():
    sweep = sweep_from_mapping(
        SOURCE | {"parameters": [FAST], "references": [{}], "pushes": SOURCE["pushes"] | {"directions": 1}}
    )
    (bounds,) = lowest_bounds(sweep, 1)
    assert bounds[0] == min(cell_bound(sweep, sweep.cell(index)) for index in range(2)) > 10.0


def test_the_same_walks_are_compared_and_then_those_of_the_same_robot_and_reference():
    alone = sweep_from_mapping(SOURCE | {"parameters": [FAST | {"alpha": 1e-5}]})
    first, second = paired((SWEEP, outcomes_of(SWEEP)), (alone, outcomes_of(alone, 2.5)))
    assert first.name == "hrp2, in place -> hrp2, in place" and second.name.startswith("hrp2, 0.1 m/s ahead")
    assert comparison_rows([first], 1.0)[1][1:5] == ["8", "7", "0", "1"]  # the one with the island has not changed
    assert comparison_rows([first], 3.0)[1][1:5] == ["8", "0", "0", "8"]
    reordered = sweep_from_mapping(SOURCE | {"references": [{"vx": 0.1}, {}]})
    outcomes = outcomes_of(SWEEP)
    turned = [*outcomes[8:16], *outcomes[:8], *outcomes[24:], *outcomes[16:24]]
    pairs = paired((SWEEP, outcomes), (reordered, turned))
    assert len(pairs) == 4 and all(set(pair.changes.values()) == {0.0} for pair in pairs)
    swapped = sweep_from_mapping(SOURCE | {"parameters": SOURCE["parameters"][::-1]})
    pairs = paired((SWEEP, outcomes), (swapped, [*outcomes[16:], *outcomes[:16]]))
    assert all(set(pair.changes.values()) == {0.0} for pair in pairs), "the same parameters belong together"
    worse = paired((SWEEP, outcomes_of(SWEEP, 5.0)), (SWEEP, outcomes_of(SWEEP)))
    assert next(extremes(worse, 1.0)).startswith("  -5.0 N s")
    with pytest.raises(WalkError, match="have no cell in common"):
        other = sweep_from_mapping(SOURCE | {"robots": ["talos"]})
        paired((SWEEP, outcomes_of(SWEEP)), (other, outcomes_of(other)))


def test_the_command_compares_two_folders(folder, tmp_path, monkeypatch, capsys):
    written(tmp_path, SWEEP, outcomes_of(SWEEP, 3.0))
    monkeypatch.setattr("sys.argv", ["walk", "sweep-compare", str(folder), str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    told = capsys.readouterr().out
    assert ended.value.code in (0, None) and re.search(r"hrp2, in place +8 +7 +0 +1 ", told)
