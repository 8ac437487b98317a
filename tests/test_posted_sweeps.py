"""Sweeps over REST: queued as runs are, walked by a process, kept, and gone on with after the end of a server."""

import json
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from conftest import ended, wait_for
from playwright.sync_api import expect

from app.jobs import JobProcess
from app.robot_choices import RobotChoices
from app.sweeps.cells import CellStore, cells_table
from app.sweeps.engine import sweep_versions
from app.sweeps.posted_sweep import STATE, PostedSweepStore, WalkSweep
from app.sweeps.posted_sweeps import PostedSweeps, SweepLimits, admitted_sweep
from app.work import NoFileError, WorkQueue, WorkUnavailableError, queue
from walkcore.analysis.cell_outcome import outcome
from walkcore.analysis.sweep import sweep_from_mapping
from walkcore.errors import InvalidValueError, UnknownNameError

SMALL = {
    "name": "small",
    "robots": ["hrp2"],
    "parameters": [{"stepping_in_place": True, "control_period": 0.1}],
    "pushes": {"directions": 2, "phases": 2, "max_impulse": 16.0, "coarse": 8.0, "tolerance": 4.0},
}


pytestmark = pytest.mark.server("hrp2")


def table_of(sweep):
    return cells_table(sweep, {k: outcome(sweep, sweep.cell(k)) for k in range(sweep.nb_cells)})


def test_a_posted_sweep_is_followed_to_its_end_and_has_the_cells_of_the_command_line(api, tmp_path):
    response = api.post("sweeps", json=SMALL)
    assert response.status_code == 202, response.text
    sweep_id, body = response.json()["id"], response.json()
    assert response.headers["location"] == f"/api/v1/sweeps/{sweep_id}"
    assert (body["sweep"], body["nb_cells"], body["files"]) == (SMALL, 4, {})
    assert api.get(f"sweeps/{sweep_id}/cells.parquet").status_code == 409
    with api.stream("GET", f"sweeps/{sweep_id}/events", timeout=None) as stream:
        told = [json.loads(line[6:]) for line in stream.iter_lines() if line.startswith("data: ")]
    done = [state["nb_done"] for state in told]
    assert told[-1]["status"] == "done" and told[-1]["reason"] == "" and done == sorted(done) and done[-1] == 4
    (tmp_path / "cells.parquet").write_bytes(api.get(f"sweeps/{sweep_id}/cells.parquet").content)
    assert pq.read_table(tmp_path / "cells.parquet").equals(table_of(sweep_from_mapping(SMALL)))
    page = api.get(f"sweeps/{sweep_id}/sweep.html")
    assert "small" in page.text and page.headers["content-security-policy"].startswith("sandbox allow-scripts")
    assert [state["id"] for state in api.get("sweeps").json()] == [sweep_id]
    assert api.delete(f"sweeps/{sweep_id}").status_code == 204
    assert api.get(f"sweeps/{sweep_id}").status_code == 404


@pytest.mark.exhaustive
def test_a_click_on_a_cell_of_a_listed_sweep_leads_to_that_walk_in_3d(api, server, visit):
    sweep_id = api.post("sweeps", json=SMALL).json()["id"]
    assert ended(api, f"sweeps/{sweep_id}")["status"] == "done"
    page = visit(f"{server.url}static/sweeps.html", scene=None)
    page.get_by_role("link", name="what came of it").click()
    page.locator("#map .cell").first.click()
    with page.expect_popup() as opened:
        page.get_by_role("link", name="in 3-D, survived").click()
    again = opened.value
    expect(again.locator("#what")).to_contain_text("hrp2 walks for")
    assert api.get("runs").json() == [], "nothing is simulated before somebody asks for it here"
    again.get_by_test_id("walk").click()
    again.wait_for_url("**/recording.html")
    (run,) = api.get("runs").json()
    assert (run["name"], run["status"]) == ("small-0", "done")


def test_a_sweep_under_way_is_cancelled_with_its_process_and_the_next_one_begins(api):
    long = SMALL | {"pushes": SMALL["pushes"] | {"directions": 36, "phases": 16, "tolerance": 0.1}}
    first, second = (api.post("sweeps", json=data).json()["id"] for data in (long, SMALL))
    wait_for(lambda: api.get(f"sweeps/{first}").json()["nb_done"] > 0)
    assert api.get(f"sweeps/{second}").json()["status"] == "queued"
    cancelled = api.delete(f"sweeps/{first}")
    assert cancelled.status_code == 200 and cancelled.json()["status"] == "cancelled"
    assert ended(api, f"sweeps/{second}")["status"] == "done"
    assert api.get(f"sweeps/{first}/cells.parquet").status_code == 409


@pytest.mark.parametrize(
    ("changed", "field"),
    [
        ({"moon": 1}, "sweep.moon"),
        ({"robots": [str(files("walkcore") / "robots" / "hrp2.yaml")]}, "robot"),
        ({"references": [{"vx": 0.001 * k} for k in range(51)]}, "combinations of robots, parameters and references"),
        ({"pushes": SMALL["pushes"] | {"directions": 3600, "phases": 100}}, "ticks of all trials"),
    ],
)
def test_what_is_no_sweep_or_too_much_work_is_refused_with_its_field(changed, field):
    with pytest.raises((InvalidValueError, UnknownNameError)) as refusal:
        admitted_sweep(SMALL | changed, SweepLimits(), RobotChoices())
    assert getattr(refusal.value, "field", "robot") == field


@pytest.fixture
def sweeps(tmp_path) -> Iterator[PostedSweeps]:
    """Sweeps without a server; none is walked."""
    sweeps = PostedSweeps(tmp_path, SweepLimits(queued=2, kept=1))
    yield sweeps
    sweeps.stop()


def test_so_many_sweeps_wait_and_no_more_until_one_is_cancelled(sweeps):
    first, _ = sweeps.submit(SMALL), sweeps.submit(SMALL)
    with pytest.raises(WorkUnavailableError, match="2 sweeps wait already"):
        sweeps.submit(SMALL)
    sweeps.delete(first.id)
    assert sweeps.get(first.id).status == "cancelled"
    sweeps.submit(SMALL)
    with pytest.raises(NoFileError):
        sweeps.file(sweeps.get(first.id), "cells.parquet")


def test_a_sweep_goes_on_with_the_missing_cells_after_its_server_was_killed(tmp_path):
    store, sweep = PostedSweepStore(tmp_path), sweep_from_mapping(SMALL)
    posted = store.add(SMALL, sweep.nb_cells)
    begun = store.start_next()
    assert begun is not None and begun.id == posted.id
    cells = CellStore(store.results(posted.id), sweep, sweep_versions(sweep))
    cells.add(0, [outcome(sweep, sweep.cell(0))])
    (tmp_path / "stray").mkdir()

    after = PostedSweepStore(tmp_path)  # nobody has closed the one before
    assert [(found.id, found.status) for found in after.list()] == [(posted.id, "queued")]
    assert not (tmp_path / "stray").exists()
    assert after.start_next() is not None
    told = []
    job = after.job(posted.id)
    assert isinstance(job, WalkSweep)
    job(told.append)
    after.keep(posted.id, None)
    assert told[0].nb_done == 1, "the finished cell is not walked again"
    assert pq.read_table(after.results(posted.id) / "cells.parquet").equals(table_of(sweep))
    assert (after.get(posted.id).status, after.get(posted.id).progress.nb_done) == ("done", 4)
    assert PostedSweepStore(tmp_path).get(posted.id).size > 0


def test_a_disk_that_lets_no_sweep_go_does_not_end_the_queue(tmp_path, monkeypatch):
    store = PostedSweepStore(tmp_path)
    ids = [store.add(SMALL, 4).id for _ in range(2)]
    for sweep_id in ids:
        store.cancel(sweep_id)

    def refuse(*_, **__):
        raise OSError("read-only")

    with monkeypatch.context() as disk:
        disk.setattr(Path, "unlink", refuse)
        store.trim(1)  # as the queue does after each sweep
    assert [sweep.id for sweep in store.list()] == ids[::-1]
    store.trim(1)
    assert [sweep.id for sweep in store.list()] == ids[1:]


def test_a_sweep_that_cannot_be_read_is_left_for_the_next_server(tmp_path, monkeypatch):
    sweep_id = PostedSweepStore(tmp_path).add(SMALL, 4).id

    def refuse(*_, **__):
        raise OSError(5, "Input/output error")

    with monkeypatch.context() as disk:
        disk.setattr(Path, "read_text", refuse)
        assert PostedSweepStore(tmp_path).list() == []
    assert [sweep.id for sweep in PostedSweepStore(tmp_path).list()] == [sweep_id]


def test_the_oldest_ended_sweeps_go_first_and_what_is_broken_goes_at_once(tmp_path):
    store = PostedSweepStore(tmp_path)
    ids = [store.add(SMALL, 4).id for _ in range(3)]
    for sweep_id in ids[:2]:
        store.cancel(sweep_id)
    store.trim(1)
    assert [sweep.id for sweep in store.list()] == [ids[2], ids[1]]
    (tmp_path / ids[1] / STATE).write_text("{")
    assert [sweep.id for sweep in PostedSweepStore(tmp_path).list()] == [ids[2]]
    assert not (tmp_path / ids[1]).exists()


@pytest.mark.parametrize("broken", [{"size": None}, {"size": "3"}, {"status": "paused"}])
def test_a_state_that_would_end_the_queue_or_wait_for_ever_is_none(broken, tmp_path):
    sweep_id = PostedSweepStore(tmp_path).add(SMALL, 4).id
    state = json.loads((tmp_path / sweep_id / STATE).read_text())
    (tmp_path / sweep_id / STATE).write_text(json.dumps(state | broken))
    assert PostedSweepStore(tmp_path).list() == []


def test_a_sweep_that_is_cancelled_before_its_process_is_there_leaves_no_results(tmp_path, monkeypatch):
    store = PostedSweepStore(tmp_path)
    sweep_id = store.add(SMALL, 4).id
    store.results(sweep_id).mkdir()  # as an earlier server has left them

    def process(*arguments):
        store.cancel(sweep_id)
        return JobProcess(*arguments)

    monkeypatch.setattr(queue, "JobProcess", process)
    sweeps = WorkQueue(store, 1, nb_queued=4, nb_kept=4)
    sweeps.start()
    wait_for(lambda: not store.results(sweep_id).exists())
    sweeps.stop()
    assert store.get(sweep_id).status == "cancelled"
