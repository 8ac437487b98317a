"""A database of runs that is broken: set aside and told, while every run that has its files is found again."""

import sqlite3
from pathlib import Path

import pytest
from conftest import add_finished, runs_in, serving

from app.runs.database import ROW_BROKEN
from walkcore.scenario.recording import Recording, record
from walkcore.scenario.scenario import scenario_from_mapping

SHORT = {"name": "short", "robot": "hrp2", "duration": 2.0, "parameters": {"control_period": 0.1}}


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record(scenario_from_mapping(SHORT))


def garbage(file: Path) -> None:
    file.write_bytes(b"garbage " * 10_000)


def half(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def bad_page(file: Path) -> None:
    """Noise behind the header and the schema."""
    content = bytearray(file.read_bytes())
    content[4096:] = b"\xa5" * (len(content) - 4096)
    file.write_bytes(content)


def other_table(file: Path) -> None:
    with sqlite3.connect(file) as db:
        db.executescript("DROP TABLE runs; CREATE TABLE runs (id TEXT);")
    db.close()


BREAKAGES = [garbage, half, bad_page, other_table]


@pytest.mark.parametrize("damage", BREAKAGES)
def test_a_broken_database_is_set_aside_and_the_runs_in_folders_are_found(tmp_path, recording, damage):
    with runs_in(tmp_path) as runs:
        before = [add_finished(runs, recording) for _ in range(3)]
        runs.submit(SHORT)
    database = tmp_path / "runs.sqlite"
    damage(database)
    broken = database.read_bytes()
    with runs_in(tmp_path) as runs:
        found = {run.id: run for run in runs.list() if run.size}
        assert set(found) == {run.id for run in before}
        for run in before:
            again = found[run.id]
            assert (again.status, again.name, again.robot, again.duration) == ("done", "short", "hrp2", 2.0)
            assert again.metrics == run.metrics and again.size == run.size
        (aside,) = tmp_path.glob("runs.broken-*.sqlite")
        assert aside.read_bytes() == broken and aside.name in runs.notice and runs.problem == ""
        runs.submit(SHORT)
    with runs_in(tmp_path) as runs:
        assert len(runs.list()) >= 4 and runs.notice == ""


@pytest.mark.parametrize("damage", [garbage, Path.unlink, other_table])
def test_a_database_that_breaks_while_the_server_runs_loses_nothing(tmp_path, recording, damage):
    with runs_in(tmp_path) as runs:
        ids = [add_finished(runs, recording).id, runs.submit(SHORT).id]
        damage(tmp_path / "runs.sqlite")
        ids.append(runs.submit(SHORT).id)
        assert {run.id for run in runs.list()} == set(ids)
    with runs_in(tmp_path) as runs:
        assert {run.id for run in runs.list()} == set(ids)


@pytest.mark.parametrize(
    "change",
    [
        "scenario = substr(scenario, 1, 9)",
        "scenario = '[]'",
        "scenario = '{\"name\": 3}'",
        "scenario = x'ff00'",
        "status = 'asleep'",
        "metrics = '{\"a\": '",
        "duration = 'long'",
        "created = 'yesterday'",
    ],
)
def test_a_broken_row_is_one_run_that_is_told_of_or_found_in_its_folder(tmp_path, recording, change):
    with runs_in(tmp_path) as runs:
        done, other = add_finished(runs, recording), add_finished(runs, recording)
        waiting = runs.submit(SHORT)
    with sqlite3.connect(tmp_path / "runs.sqlite") as db:
        db.execute(f"UPDATE runs SET {change} WHERE id IN (?, ?)", (done.id, waiting.id))
    db.close()
    with runs_in(tmp_path) as runs:
        known = {run.id: run for run in runs.list()}
        assert set(known) == {done.id, other.id, waiting.id}
        assert known[done.id].status == "done" and known[done.id].metrics == done.metrics
        assert (known[waiting.id].status, known[waiting.id].reason) == ("failed", ROW_BROKEN)
        runs.delete(waiting.id)
    with runs_in(tmp_path) as runs:
        assert {run.id for run in runs.list()} == {done.id, other.id}


def test_a_server_with_a_broken_database_starts_and_says_so(tmp_path):
    garbage(tmp_path / "runs.sqlite")
    with serving("--robot", "hrp2", "--scene", "light", WALK_DATA=str(tmp_path)) as server, server.client() as api:
        health = api.get("health").json()
        assert "set aside as runs.broken-" in health["runs"]
        assert api.get("runs").json() == [] and api.post("runs", json=SHORT).status_code == 202
