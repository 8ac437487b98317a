"""Runs on a disk that is full, read-only or broken: told, never lost, and taken up again when it can be."""

import errno
import json
import shutil
import sqlite3
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
from conftest import add_finished, serving, wait_for
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, initialize, invariant, rule

from app.live.session_log import SessionLog
from app.runs import RunLimits, Runs
from app.runs.database import ROW_BROKEN
from app.runs.recovery import FILES_GONE, SERVER_DIED
from app.runs.store import RunStore
from app.work import UnknownWorkError, WorkUnavailableError
from walkcore import Command, Simulation, load_robot
from walkcore.scenario.recording import Recording, record
from walkcore.scenario.scenario import scenario_from_mapping

SHORT = {"name": "short", "robot": "hrp2", "duration": 2.0, "parameters": {"control_period": 0.1}}
FULL = sqlite3.OperationalError("database or disk is full")


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record(scenario_from_mapping(SHORT))


@contextmanager
def opened(folder: Path) -> Iterator[Runs]:
    runs = Runs(folder, nb_workers=1, nb_queued=9, nb_kept=99, bytes_kept=10**9, limits=RunLimits())
    try:
        yield runs
    finally:
        runs.stop()


@contextmanager
def full_disk() -> Iterator[None]:
    """No row can be written."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("app.runs.database.RunDatabase.write", lambda *_: (_ for _ in ()).throw(FULL))
        yield


def state_of(runs: Runs) -> dict[str, tuple[str, str]]:
    return {run.id: (run.status, run.reason) for run in runs.list()}


# Full


def test_a_full_disk_takes_no_run_says_so_and_takes_them_again(tmp_path):
    with opened(tmp_path) as runs:
        with full_disk():
            with pytest.raises(WorkUnavailableError, match="disk is full"):
                runs.submit(SHORT)
            assert runs.list() == [] and "disk is full" in runs.problem
        run = runs.submit(SHORT)
        assert runs.problem == "" and [known.id for known in runs.list()] == [run.id]


def test_changes_that_a_full_disk_does_not_take_hold_and_are_written_later(tmp_path, recording):
    with opened(tmp_path) as runs:
        removed, kept = add_finished(runs, recording).id, add_finished(runs, recording).id
        cancelled = runs.submit(SHORT).id
        with full_disk():
            runs.delete(cancelled)
            runs.delete(removed)
            assert not (tmp_path / "done" / removed).exists(), "its space is free"
            assert state_of(runs) == {kept: ("done", ""), cancelled: ("cancelled", "cancelled on request")}
            assert "disk is full" in runs.problem
        before = state_of(runs)
    with opened(tmp_path) as runs:
        assert state_of(runs) == before and runs.problem == runs.notice == ""


def test_a_disk_that_took_no_run_is_tried_again_without_another_request(tmp_path):
    with opened(tmp_path) as runs:
        runs.start()
        with full_disk(), pytest.raises(WorkUnavailableError):
            runs.submit(SHORT)
        wait_for(lambda: runs.problem == "")


def test_trouble_of_a_queue_that_has_nothing_to_do_is_over_when_the_disk_takes_more(tmp_path):
    with opened(tmp_path) as runs:
        runs.start()
        time.sleep(0.1)  # until the queue waits
        with full_disk(), pytest.raises(WorkUnavailableError):
            runs.store.add(SHORT, "hrp2", 2.0)
        wait_for(lambda: runs.problem == "")


def test_queued_runs_wait_for_space_and_go_on_when_there_is(tmp_path, monkeypatch):
    real = shutil.disk_usage
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=500_000))
    with opened(tmp_path) as runs:
        runs.start()
        run = runs.submit(SHORT)
        wait_for(lambda: "wait for space" in runs.problem and "0.5 MB are free" in runs.problem)
        assert runs.get(run.id).status == "queued"
        monkeypatch.setattr("shutil.disk_usage", real)
        wait_for(lambda: runs.get(run.id).has_ended)
        assert runs.get(run.id).status == "done" and runs.problem == ""


def test_a_run_whose_files_the_disk_does_not_take_fails_with_the_reason_and_the_next_is_kept(tmp_path, monkeypatch):
    def no_space(path: Path) -> int:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    with opened(tmp_path) as runs:
        runs.start()
        with monkeypatch.context() as patch:
            patch.setattr("app.runs.store._sync", no_space)
            run = runs.submit(SHORT)
            wait_for(lambda: runs.get(run.id).has_ended)
        assert runs.get(run.id).status == "failed" and "No space left" in runs.get(run.id).reason
        assert not (tmp_path / "unfinished" / run.id).exists()
        following = runs.submit(SHORT)
        wait_for(lambda: runs.get(following.id).has_ended)
        assert runs.get(following.id).status == "done"


def test_a_queue_whose_processes_cannot_start_goes_on(tmp_path, monkeypatch):
    def no_process(*_: object) -> None:
        raise OSError(errno.EAGAIN, "Resource temporarily unavailable")

    with opened(tmp_path) as runs:
        runs.start()
        with monkeypatch.context() as patch:
            patch.setattr("app.work.queue.JobProcess", no_process)
            run = runs.submit(SHORT)
            wait_for(lambda: runs.get(run.id).has_ended)
            assert runs.get(run.id).status == "failed" and "unavailable" in runs.get(run.id).reason
        following = runs.submit(SHORT)
        wait_for(lambda: runs.get(following.id).has_ended)
        assert runs.get(following.id).status == "done"
        with monkeypatch.context() as patch:
            patch.setattr("app.jobs.JobProcess", no_process)
            with pytest.raises(WorkUnavailableError, match="unavailable"):
                runs.file(following.id, "recording.parquet")
        assert runs.file(following.id, "recording.parquet").is_file()


@pytest.mark.parametrize("fails", ["app.runs.store._sync", "app.runs.store.RunStore.unfinished"])
def test_a_live_walk_that_the_disk_does_not_take_is_refused_and_is_no_run_under_way(tmp_path, monkeypatch, fails):
    def no_space(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    simulation = Simulation(load_robot("hrp2"))
    log = SessionLog(simulation)
    for _ in range(40):
        log.begin()
        log.end(Command(), simulation.step(Command()))
    with opened(tmp_path) as runs:
        with monkeypatch.context() as patch:
            patch.setattr(fails, no_space)
            with pytest.raises(WorkUnavailableError, match="No space left"):
                runs.add_session(log.last_minute(), "driven", simulation.robot)
        assert all(run.status == "failed" and "No space left" in run.reason for run in runs.list())
        assert runs.add_session(log.last_minute(), "driven", simulation.robot).status == "done"


@contextmanager
def small_disk(folder: Path, size: str) -> Iterator[Path]:
    """A real file system of some megabytes, where the tests may mount one."""
    folder.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder], capture_output=True)
    if mounted.returncode:
        pytest.skip("file systems can be mounted by root only")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", folder], check=True)


def fill(folder: Path) -> Path:
    """A file that leaves no space on the disk."""
    file = folder / "filling"
    with file.open("wb", buffering=0) as stream:
        try:
            while stream.write(bytes(4096)):
                pass
        except OSError as error:
            assert error.errno == errno.ENOSPC
    return file


def test_a_server_on_a_full_disk_says_so_frees_space_by_delete_and_goes_on(tmp_path):
    with (
        small_disk(tmp_path / "disk", "8m") as disk,
        serving("--robot", "hrp2", WALK_DATA=str(disk / "data")) as server,
    ):
        with server.client() as api:
            done = [api.post("runs", json=SHORT).json()["id"] for _ in range(3)]
            wait_for(lambda: all(api.get(f"runs/{run_id}").json()["status"] == "done" for run_id in done))
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
            wait_for(lambda: api.get(f"runs/{run_id}").json()["status"] not in ("queued", "running"))
            assert api.get(f"runs/{run_id}").json()["status"] == "done"
            assert api.get("health").json()["runs"] == ""


def test_a_read_only_disk_shows_its_runs_and_takes_new_ones_once_it_can_be_written_to(tmp_path, recording):
    with small_disk(tmp_path / "disk", "8m") as disk:
        with opened(disk / "data") as runs:
            done = add_finished(runs, recording).id
        subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
        with opened(disk / "data") as runs:
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
    with opened(in_the_way / "data") as runs:
        assert str(in_the_way) in runs.problem and runs.list() == []
        with pytest.raises(WorkUnavailableError):
            runs.submit(SHORT)
        in_the_way.unlink()
        run = runs.submit(SHORT)
        assert runs.problem == ""
    with opened(in_the_way / "data") as runs:
        assert [known.id for known in runs.list()] == [run.id]


# Broken


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
    with opened(tmp_path) as runs:
        before = [add_finished(runs, recording) for _ in range(3)]
        runs.submit(SHORT)
    database = tmp_path / "runs.sqlite"
    damage(database)
    broken = database.read_bytes()
    with opened(tmp_path) as runs:
        found = {run.id: run for run in runs.list() if run.size}
        assert set(found) == {run.id for run in before}
        for run in before:
            again = found[run.id]
            assert (again.status, again.name, again.robot, again.duration) == ("done", "short", "hrp2", 2.0)
            assert again.metrics == run.metrics and again.size == run.size
        (aside,) = tmp_path.glob("runs.broken-*.sqlite")
        assert aside.read_bytes() == broken and aside.name in runs.notice and runs.problem == ""
        runs.submit(SHORT)
    with opened(tmp_path) as runs:
        assert len(runs.list()) >= 4 and runs.notice == ""


@pytest.mark.parametrize("damage", [garbage, Path.unlink, other_table])
def test_a_database_that_breaks_while_the_server_runs_loses_nothing(tmp_path, recording, damage):
    with opened(tmp_path) as runs:
        ids = [add_finished(runs, recording).id, runs.submit(SHORT).id]
        damage(tmp_path / "runs.sqlite")
        ids.append(runs.submit(SHORT).id)
        assert {run.id for run in runs.list()} == set(ids)
    with opened(tmp_path) as runs:
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
    with opened(tmp_path) as runs:
        done, other = add_finished(runs, recording), add_finished(runs, recording)
        waiting = runs.submit(SHORT)
    with sqlite3.connect(tmp_path / "runs.sqlite") as db:
        db.execute(f"UPDATE runs SET {change} WHERE id IN (?, ?)", (done.id, waiting.id))
    db.close()
    with opened(tmp_path) as runs:
        known = {run.id: run for run in runs.list()}
        assert set(known) == {done.id, other.id, waiting.id}
        assert known[done.id].status == "done" and known[done.id].metrics == done.metrics
        assert (known[waiting.id].status, known[waiting.id].reason) == ("failed", ROW_BROKEN)
        runs.delete(waiting.id)
    with opened(tmp_path) as runs:
        assert {run.id for run in runs.list()} == {done.id, other.id}


def test_a_server_with_a_broken_database_starts_and_says_so(tmp_path):
    garbage(tmp_path / "runs.sqlite")
    with serving("--robot", "hrp2", "--scene", "light", WALK_DATA=str(tmp_path)) as server, server.client() as api:
        health = api.get("health").json()
        assert "set aside as runs.broken-" in health["runs"]
        assert api.get("runs").json() == [] and api.post("runs", json=SHORT).status_code == 202


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
        self.patch: pytest.MonkeyPatch | None = None

    def teardown(self) -> None:
        self.free_disk()
        self.store.close()
        shutil.rmtree(self.root)

    @rule()
    def fill_disk(self) -> None:
        if self.patch is None:
            self.patch = pytest.MonkeyPatch()
            self.patch.setattr("app.runs.database.RunDatabase.write", lambda *_: (_ for _ in ()).throw(FULL))

    @rule()
    def free_disk(self) -> None:
        if self.patch is not None:
            self.patch.undo()
            self.patch = None

    @rule(target=runs)
    def add(self) -> str:
        try:
            run_id = self.store.add(SHORT, "hrp2", 2.0).id
        except WorkUnavailableError:
            assert self.patch is not None
            return ""
        self.status[run_id] = "queued"
        return run_id

    @rule()
    def start(self) -> None:
        run = self.store.start_next()
        waiting = [run_id for run_id, status in self.status.items() if status == "queued"]
        if run is None:
            assert not waiting or self.patch is not None
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
        before, is_full = self.store, self.patch is not None
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
        deadline=None,
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
