"""Sweeps give the same bytes whoever walks their cells, and lose nothing however they are stopped."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest
import yaml
from conftest import PATIENCE
from distributed import Client, LocalCluster

from app.commands import cli
from app.sweeps import engine
from app.sweeps.cells import MAX_PARTS, CellStore, cells_table, read_cells, write_table
from app.sweeps.engine import run_sweep, sweep_versions, walk_cells
from walkcore import WalkError
from walkcore.analysis.cell_outcome import CellOutcome, outcome
from walkcore.analysis.sweep import Sweep, sweep_from_mapping

SOURCE = {
    "name": "small",
    "robots": ["hrp2"],
    "parameters": [{"control_period": 0.05, "stepping_in_place": True, "solver": "daqp"}],
    "references": [{}, {"vx": 0.1}],
    "pushes": {"directions": 3, "phases": 2, "max_impulse": 40.0, "coarse": 10.0, "tolerance": 5.0},
}
SWEEP = sweep_from_mapping(SOURCE)
COLUMNS = (
    "robot parameters vx vy yaw_rate direction phase largest_impulse delta_v islands success_low success_high"
).split()


def opened(folder: Path, sweep: Sweep = SWEEP) -> CellStore:
    return CellStore(folder, sweep, sweep_versions(sweep))


@pytest.fixture(scope="module")
def outcomes() -> list[CellOutcome]:
    return [outcome(SWEEP, SWEEP.cell(index)) for index in range(SWEEP.nb_cells)]


@pytest.fixture(scope="module")
def expected(outcomes: list[CellOutcome], tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The table of a sweep whose cells were walked one by one."""
    file = tmp_path_factory.mktemp("expected") / "cells.parquet"
    write_table(file, cells_table(SWEEP, dict(enumerate(outcomes))))
    return file.read_bytes()


def test_the_table_has_the_columns_of_the_contract_in_their_order(outcomes):
    table = cells_table(SWEEP, dict(enumerate(outcomes)))
    assert table.column_names == COLUMNS and table.num_rows == 12
    rows = table.to_pylist()
    assert [row["vx"] for row in rows] == [0.0] * 6 + [0.1] * 6
    assert json.loads(rows[0]["parameters"]) == SOURCE["parameters"][0]
    assert len({row["largest_impulse"] for row in rows}) > 2 and rows[0]["success_low"] is None


@pytest.mark.parametrize("nb_workers", [1, 2, pytest.param(3, marks=pytest.mark.exhaustive)])
def test_any_number_of_workers_gives_the_same_bytes(tmp_path, expected, nb_workers):
    store, seen = opened(tmp_path), []
    run_sweep(SWEEP, store, nb_workers, on_progress=lambda progress: seen.append(progress.nb_done))
    assert store.write_table().read_bytes() == expected
    assert seen[0] == 0 and seen[-1] == 12 and seen == sorted(seen)
    assert read_cells(tmp_path)[0].source == SOURCE


def test_any_order_and_any_cut_into_tasks_gives_the_same_bytes(tmp_path, expected, outcomes):
    store = opened(tmp_path)
    for first, end in ((9, 12), (0, 1), (4, 9), (1, 4)):
        store.add(first, outcomes[first:end])
    assert store.write_table().read_bytes() == expected


def test_a_folder_goes_on_where_it_was(tmp_path, expected, outcomes, monkeypatch):
    first = opened(tmp_path)
    first.add(2, outcomes[2:5])
    (tmp_path / "parts" / "00000000-2.half").write_bytes(b"PAR1")  # as a kill leaves it
    again, walked = opened(tmp_path), []
    assert again.missing == [0, 1, *range(5, 12)]
    monkeypatch.setattr(engine, "outcome", lambda sweep, cell: walked.append(cell.index) or outcomes[cell.index])
    run_sweep(SWEEP, again, 1)
    assert sorted(walked) == [0, 1, *range(5, 12)]
    assert again.write_table().read_bytes() == expected
    assert opened(tmp_path).missing == []


def test_many_parts_are_joined_and_nothing_is_lost(tmp_path):
    sweep = sweep_from_mapping(SOURCE | {"pushes": SOURCE["pushes"] | {"directions": 60}})
    store = opened(tmp_path, sweep)
    for index in range(2 * MAX_PARTS + 10):
        store.add(index, [CellOutcome(float(index), 1.0, ((1.0, 2.0),))])
    assert len(list((tmp_path / "parts").iterdir())) <= MAX_PARTS + 1
    assert opened(tmp_path, sweep).outcomes == store.outcomes and len(store.outcomes) == 2 * MAX_PARTS + 10


def test_a_folder_with_another_sweep_or_of_other_versions_is_refused(tmp_path):
    opened(tmp_path)
    with pytest.raises(WalkError, match="holds another sweep"):
        opened(tmp_path, sweep_from_mapping(SOURCE | {"name": "other"}))
    with pytest.raises(WalkError, match="holds outcomes of other versions"):
        CellStore(tmp_path, SWEEP, sweep_versions(SWEEP) | {"numpy": "1.0"})


def test_a_worker_of_other_versions_is_refused():
    with pytest.raises(WalkError, match="versions of a worker"):
        walk_cells(json.dumps(SOURCE), {"numpy": "1.0"}, 0, 1, asker=0)


def test_a_folder_without_a_finished_sweep_is_told(tmp_path):
    with pytest.raises(WalkError, match="is no finished sweep"):
        read_cells(tmp_path)


def begun(tmp_path: Path) -> subprocess.Popen[str]:
    """A sweep in two workers, of which some cells are finished."""
    file = tmp_path / "small.yaml"
    file.write_text(yaml.safe_dump(SOURCE))
    process = subprocess.Popen(
        [Path(sys.executable).with_name("walk"), "sweep", file, "--out", tmp_path, "--workers", "2"],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    while not list((tmp_path / "parts").glob("*.parquet")):
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    return process


@pytest.mark.parametrize("kind", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.exhaustive)])
def test_a_sweep_that_was_stopped_goes_on_by_the_same_command(tmp_path, expected, kind):
    process = begun(tmp_path)
    process.send_signal(kind)
    process.wait(PATIENCE)
    if kind is signal.SIGINT:
        _, told = process.communicate()
        assert process.returncode == 130 and "cells are kept" in told and "Traceback" not in told, told
    kept = opened(tmp_path)
    assert 0 < len(kept.outcomes) < 12, "stopped too late to see anything"
    run_sweep(SWEEP, kept, 1)
    assert kept.write_table().read_bytes() == expected


def test_dask_gives_the_same_bytes_and_a_killed_worker_loses_nothing(tmp_path, expected):
    ports = {"dashboard_address": None, "host": "127.0.0.1"}
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, **ports) as cluster, Client(cluster) as client:
        workers = client.run(os.getpid)
        assert len(set(workers.values())) == 2
        killed: list[int] = []

        def kill_one(progress: engine.SweepProgress) -> None:
            if progress.nb_done > 0 and not killed:
                killed.append(next(iter(workers.values())))
                os.kill(killed[0], signal.SIGKILL)

        store = opened(tmp_path)
        run_sweep(SWEEP, store, None, cluster.scheduler_address, kill_one)
    assert killed and store.write_table().read_bytes() == expected


def test_a_scheduler_that_is_not_there_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(engine, "CONNECTION_TIMEOUT", 0.2)
    with pytest.raises(WalkError, match=r"scheduler = 'tcp://127.0.0.1:9': no Dask scheduler"):
        run_sweep(SWEEP, opened(tmp_path), None, "tcp://127.0.0.1:9")


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (["FILE", "--dry-run"], 0, "small: 12 cells of 2 walks, 60 trials"),
        (["FILE"], 2, "out = None: is missing"),
        (["FILE", "--out", "OUT", "--workers", "0"], 2, "workers = 0: must lie in"),
        (["nowhere"], 2, "no sweep 'nowhere'; there are: "),
        ([], 0, "talos-in-place"),
        (["--schema"], 0, '"title": "Sweep"'),
    ],
)
def test_the_command_tells_what_it_would_do_and_what_is_wrong(tmp_path, monkeypatch, capsys, arguments, code, told):
    file = tmp_path / "small.yaml"
    file.write_text(yaml.safe_dump(SOURCE))
    names = {"FILE": str(file), "OUT": str(tmp_path / "out")}
    monkeypatch.setattr("sys.argv", ["walk", "sweep", *(names.get(argument, argument) for argument in arguments)])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    output = capsys.readouterr()
    assert ended.value.code == code and told in output.out + output.err
    assert not (tmp_path / "out").exists()


def test_the_table_opens_in_other_readers(tmp_path, outcomes):
    polars = pytest.importorskip("polars")
    write_table(tmp_path / "cells.parquet", cells_table(SWEEP, dict(enumerate(outcomes))))
    frame = polars.read_parquet(tmp_path / "cells.parquet")
    assert frame.columns == COLUMNS and frame["largest_impulse"].to_list() == [o.largest_impulse for o in outcomes]
    assert pq.read_schema(tmp_path / "cells.parquet").field("islands").type.value_type.value_type == "double"
