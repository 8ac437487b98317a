"""Runs on a disk that is full, read-only or broken: told, never lost, and taken up again when it can be."""

import errno
import json
import shutil
import sqlite3
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import pytest
from conftest import add_finished, ended, ended_run, runs_in, serving, wait_for
from disks import fill, small_disk
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, initialize, invariant, rule
from test_broken_database import SHORT, garbage

from app.live.session_log import SessionLog
from app.runs import Runs
from app.runs.recovery import FILES_GONE, SERVER_DIED
from app.runs.store import RunStore
from app.work import UnknownWorkError, WorkUnavailableError
from walkcore import Command, Simulation, load_robot
from walkcore.scenario.recording import Recording, record
from walkcore.scenario.scenario import scenario_from_mapping

FULL = sqlite3.OperationalError("database or disk is full")


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record(scenario_from_mapping(SHORT))


@contextmanager
def full_disk() -> Iterator[None]:
    """No row can be written."""
    with patch("app.runs.database.RunDatabase.write", side_effect=FULL):
        yield


def state_of(runs: Runs) -> dict[str, tuple[str, str]]:
    return {run.id: (run.status, run.reason) for run in runs.list()}


def test_a_full_disk_takes_no_run_says_so_and_takes_them_again(tmp_path):
    with runs_in(tmp_path) as runs:
        with full_disk():
            with pytest.raises(WorkUnavailableError, match="disk is full"):
                runs.submit(SHORT)
            assert runs.list() == [] and "disk is full" in runs.problem
        run = runs.submit(SHORT)
        assert runs.problem == "" and [known.id for known in runs.list()] == [run.id]


def test_changes_that_a_full_disk_does_not_take_hold_and_are_written_later(tmp_path, recording):
    with runs_in(tmp_path) as runs:
        removed, kept = add_finished(runs, recording).id, add_finished(runs, recording).id
        cancelled = runs.submit(SHORT).id
        with full_disk():
            runs.delete(cancelled)
            runs.delete(removed)
            assert not (tmp_path / "done" / removed).exists(), "its space is free"
            assert state_of(runs) == {kept: ("done", ""), cancelled: ("cancelled", "cancelled on request")}
            assert "disk is full" in runs.problem
        before = state_of(runs)
    with runs_in(tmp_path) as runs:
        assert state_of(runs) == before and runs.problem == runs.notice == ""


def test_a_disk_that_took_no_run_is_tried_again_without_another_request(tmp_path):
    with runs_in(tmp_path) as runs:
        runs.start()
        with full_disk(), pytest.raises(WorkUnavailableError):
            runs.submit(SHORT)
        wait_for(lambda: runs.problem == "")


def test_trouble_of_a_queue_that_has_nothing_to_do_is_over_when_the_disk_takes_more(tmp_path):
    with runs_in(tmp_path) as runs:
        runs.start()
        time.sleep(0.1)  # until the queue waits
        with full_disk(), pytest.raises(WorkUnavailableError):
            runs.store.add(SHORT, "hrp2", 2.0)
        wait_for(lambda: runs.problem == "")


def test_queued_runs_wait_for_space_and_go_on_when_there_is(tmp_path):
    with runs_in(tmp_path) as runs:
        with patch("shutil.disk_usage", return_value=SimpleNamespace(free=500_000)):
            runs.start()
            run = runs.submit(SHORT)
            wait_for(lambda: "wait for space" in runs.problem and "0.5 MB are free" in runs.problem)
            assert runs.get(run.id).status == "queued"
        assert ended_run(runs, run.id).status == "done" and runs.problem == ""


NO_SPACE = OSError(errno.ENOSPC, "No space left on device")
NO_PROCESS = OSError(errno.EAGAIN, "Resource temporarily unavailable")


@pytest.mark.parametrize(
    ("fails", "error"),
    [("app.runs.store._sync", NO_SPACE), ("app.work.queue.JobProcess", NO_PROCESS)],
    ids=["files", "process"],
)
def test_a_run_without_space_or_process_fails_with_the_reason_and_the_next_is_kept(tmp_path, fails, error):
    with runs_in(tmp_path) as runs:
        runs.start()
        with patch(fails, side_effect=error):
            run = ended_run(runs, runs.submit(SHORT).id)
        assert run.status == "failed" and error.strerror in run.reason
        assert not (tmp_path / "unfinished" / run.id).exists()
        assert ended_run(runs, runs.submit(SHORT).id).status == "done"


def test_a_format_that_no_process_can_make_is_refused_and_made_once_one_can(tmp_path, recording):
    with runs_in(tmp_path) as runs:
        run = add_finished(runs, recording)
        with patch("app.jobs.JobProcess", side_effect=NO_PROCESS):
            with pytest.raises(WorkUnavailableError, match="unavailable"):
                runs.file(run.id, "recording.parquet")
        assert runs.file(run.id, "recording.parquet").is_file()


@pytest.mark.parametrize("fails", ["app.runs.store._sync", "app.runs.store.RunStore.unfinished"])
def test_a_live_walk_that_the_disk_does_not_take_is_refused_and_is_no_run_under_way(tmp_path, fails):
    simulation = Simulation(load_robot("hrp2"))
    log = SessionLog(simulation)
    for _ in range(40):
        log.begin()
        log.end(Command(), simulation.step(Command()))
    with runs_in(tmp_path) as runs:
        with patch(fails, side_effect=NO_SPACE), pytest.raises(WorkUnavailableError, match="No space left"):
            runs.add_session(log.last_minute(), "driven", simulation.robot)
        assert all(run.status == "failed" and "No space left" in run.reason for run in runs.list())
        assert runs.add_session(log.last_minute(), "driven", simulation.robot).status == "done"


@pytest.fixture
def disk(tmp_path) -> Iterator[Path]:
    with small_disk(tmp_path / "disk", "8m") as disk:
        if disk is None:
            pytest.skip("file systems can be mounted by root only")
        yield disk


def test_a_server_on_a_full_disk_says_so_frees_space_by_delete_and_goes_on(disk):
    with serving("--robot", "hrp2", WALK_DATA=str(disk / "data")) as server, server.client() as api:
        done = [api.post("runs", json=SHORT).json()["id"] for _ in range(3)]
        assert {ended(api, f"runs/{run_id}")["status"] for run_id in done} == {"done"}
        filling = fill(disk)
        health = api.get("health").json()
        assert health["status"] == "degraded" and str(disk) in health["reason"] and health["runs"]
        refused = [api.post("runs", json=SHORT | {"name": "x" * 900}) for _ in range(20)]
        assert 503 in {answer.status_code for answer in refused}, "the last blocks of the disk take a few rows"
        assert {answer.status_code for answer in refused} <= {202, 503}
        assert [run["status"] for run in api.get("runs").json()[-3:]] == ["done"] * 3
        assert api.delete(f"runs/{done[0]}").status_code == 204
        assert api.get("live").json()["running"]
        filling.unlink()
        run_id = api.post("runs", json=SHORT).json()["id"]
        assert ended(api, f"runs/{run_id}")["status"] == "done"
        assert api.get("health").json()["runs"] == ""


def test_a_read_only_disk_shows_its_runs_and_takes_new_ones_once_it_can_be_written_to(disk, recording):
    with runs_in(disk / "data") as runs:
        done = add_finished(runs, recording).id
    subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
    with runs_in(disk / "data") as runs:
        assert state_of(runs) == {done: ("done", "")} and "Read-only" in runs.problem
        for change in (lambda: runs.submit(SHORT), lambda: runs.delete(done)):
            with pytest.raises(WorkUnavailableError, match="Read-only"):
                change()
        assert runs.file(done, "recording.csv").read_bytes()
        subprocess.run(["mount", "-o", "remount,rw", disk], check=True)
        run = runs.submit(SHORT)
        assert [known.id for known in runs.list()] == [run.id, done] and runs.problem == ""


def test_a_folder_that_cannot_be_made_is_told_and_tried_again(tmp_path):
    in_the_way = tmp_path / "file"
    in_the_way.write_text("no folder")
    with runs_in(in_the_way / "data") as runs:
        assert str(in_the_way) in runs.problem and runs.list() == []
        with pytest.raises(WorkUnavailableError):
            runs.submit(SHORT)
        in_the_way.unlink()
        run = runs.submit(SHORT)
        assert runs.problem == ""
    with runs_in(in_the_way / "data") as runs:
        assert [known.id for known in runs.list()] == [run.id]


# Whatever happens, in whatever order


class DiskTrouble(RuleBasedStateMachine):
    """A store whose server dies and whose disk is full at times, against what must hold of its runs."""

    runs = Bundle("runs")
    template: Path

    @initialize()
    def begin(self) -> None:
        self.root = Path(self.template.parent / f"{id(self)}")
        self.nb_deaths = 0
        self.store = RunStore(self.root / "0")
        self.status: dict[str, str] = {}
        self.removed: set[str] = set()
        self.is_full = False
        self.disk = ExitStack()

    def teardown(self) -> None:
        self.free_disk()
        self.store.close()
        shutil.rmtree(self.root)

    @rule()
    def fill_disk(self) -> None:
        if not self.is_full:
            self.disk.enter_context(full_disk())
            self.is_full = True

    @rule()
    def free_disk(self) -> None:
        self.disk.close()
        self.is_full = False

    @rule(target=runs)
    def add(self) -> str:
        try:
            run_id = self.store.add(SHORT, "hrp2", 2.0).id
        except WorkUnavailableError:
            assert self.is_full
            return ""
        self.status[run_id] = "queued"
        return run_id

    @rule()
    def start(self) -> None:
        run = self.store.start_next()
        waiting = [run_id for run_id, status in self.status.items() if status == "queued"]
        if run is None:
            assert not waiting or self.is_full
        else:
            assert run.id == waiting[0]
            self.status[run.id] = "running"

    @rule(run_id=runs, is_done=st.booleans())
    def end(self, run_id: str, is_done: bool) -> None:
        if self.status.get(run_id) != "running":
            return
        if is_done:
            shutil.copytree(self.template, self.store.unfinished(run_id), dirs_exist_ok=True)
            assert self.store.finish(run_id, 1.0)
        else:
            self.store.fail(run_id, "why \ud800")
        self.status[run_id] = "done" if is_done else "failed"

    @rule(run_id=runs)
    def cancel(self, run_id: str) -> None:
        is_open = self.status.get(run_id) in ("queued", "running")
        assert self.store.cancel(run_id) is is_open
        if is_open:
            self.status[run_id] = "cancelled"

    @rule(run_id=runs)
    def remove(self, run_id: str) -> None:
        if self.status.get(run_id) in ("done", "failed", "cancelled"):
            self.store.remove(run_id)
            del self.status[run_id]
            self.removed.add(run_id)

    @rule(breaks=st.booleans())
    def die(self, breaks: bool) -> None:
        """The server is killed: the next one finds the files as they are, perhaps with a broken database."""
        before, is_full = self.store, self.is_full
        self.nb_deaths += 1
        folder = self.root / str(self.nb_deaths)
        shutil.copytree(before.folder, folder)
        self.free_disk()
        before.close()
        if breaks:
            for file in folder.glob("runs.sqlite*"):
                garbage(file)
        self.store = RunStore(folder)
        known = {run.id: run for run in self.store.list()}
        for run_id, status in self.status.items():
            if status == "done":
                assert known[run_id].status == "done", "no run that was done is ever lost"
            elif not breaks and not is_full:
                assert known[run_id].status == ("failed" if status == "running" else status)
        if not breaks and not is_full:
            assert set(known) == set(self.status)
        assert all(run.reason in (FILES_GONE, "") or run.id in self.status for run in known.values() if run.size == 0)
        self.status = {run.id: run.status for run in known.values()}

    @invariant()
    def agree(self) -> None:
        known = {run.id: run for run in self.store.list()}
        assert {run_id: run.status for run_id, run in known.items()} == self.status
        assert all((self.store.files(run_id) / "run.json").is_file() for run_id, run in known.items() if run.size)
        for run_id in self.removed - set(known):
            with pytest.raises(UnknownWorkError):
                self.store.get(run_id)


def test_whatever_happens_to_server_and_disk_no_run_is_lost(tmp_path, recording):
    recording.write(tmp_path / "template")
    machine = type("Machine", (DiskTrouble,), {"template": tmp_path / "template"})
    machine.TestCase.settings = settings(
        max_examples=25,
        stateful_step_count=20,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )
    machine.TestCase().runTest()


def test_a_run_under_way_when_the_server_died_says_so(tmp_path):
    store = RunStore(tmp_path / "data")
    run_id = store.add(SHORT, "hrp2", 2.0).id
    store.start_next()
    shutil.copytree(tmp_path / "data", tmp_path / "copy")
    after = RunStore(tmp_path / "copy")
    assert (after.get(run_id).status, after.get(run_id).reason) == ("failed", SERVER_DIED)
    assert json.dumps(after.get(run_id).source) == json.dumps(SHORT)
    after.close()
    store.close()
