"""Scripted runs: queued, simulated in other processes, stored, and served as `walk run` writes them."""

import json
import math
import shutil
import subprocess
import threading
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil
import pytest
from conftest import WALK, Server, serving, start_server, wait_for
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from app.formats import FORMATS, write_run
from app.runs import RunLimits, Runs
from app.runs.admission import admitted_scenario
from app.runs.recovery import SERVER_DIED
from app.runs.store import RunStore
from app.work import NoFileError, UnknownWorkError, WorkUnavailableError
from walkcore.errors import InvalidValueError
from walkcore.scenario.recording import record
from walkcore.scenario.scenario import scenario_from_mapping

PATIENCE = 280.0  # [s] after which something hangs
SHORT = {
    "name": "short",
    "robot": "hrp2",
    "duration": 2.0,
    "parameters": {"control_period": 0.1, "alpha": 1e-5},
    "events": [{"t": 0.3, "reference": {"vx": 0.2}}, {"t": 1, "push": {"impulse": [0, 2.5], "frame": "world"}}],
}
LONG = {"name": "long", "robot": "hrp2", "duration": 500.0}


@pytest.fixture(scope="module")
def server(tmp_path_factory) -> Iterator[Server]:
    """A server of its own, with room for few runs."""
    folder = tmp_path_factory.mktemp("server") / "runs"
    with serving("--robot", "hrp2", "--scene", "light", WALK_DATA=str(folder), RUNS_QUEUED="20") as server:
        yield server


@pytest.fixture
def api(server) -> Iterator[httpx.Client]:
    """A client of a server that has no runs."""
    with server.client() as client:
        while runs := client.get("runs").json():
            for run in runs:
                client.delete(f"runs/{run['id']}")
        yield client


@pytest.fixture(scope="module")
def started(tmp_path_factory) -> Iterator[Runs]:
    """Runs without a server, with a worker."""
    runs = service(tmp_path_factory.mktemp("started"))
    runs.start()
    yield runs
    runs.stop()


@pytest.fixture
def runs(tmp_path) -> Iterator[Runs]:
    """Runs without a server; nothing is simulated."""
    runs = service(tmp_path / "data")
    yield runs
    runs.stop()


def service(folder: Path, **changes: Any) -> Runs:
    sizes = {"nb_workers": 1, "nb_queued": 5, "nb_kept": 10, "bytes_kept": 10**9, "limits": RunLimits()}
    return Runs(folder, **(sizes | changes))


def ended(get: Any, run_id: str) -> Any:
    """A run, once nothing more will change."""
    wait_for(lambda: get(run_id).has_ended, PATIENCE)
    return get(run_id)


def ended_over_rest(api: httpx.Client, run_id: str) -> dict:
    wait_for(lambda: api.get(f"runs/{run_id}").json()["status"] not in ("queued", "running"), PATIENCE)
    return api.get(f"runs/{run_id}").json()


def wait_until_running(get: Any, run_id: str) -> None:
    wait_for(lambda: get(run_id).progress.fraction > 0.0 or get(run_id).has_ended, PATIENCE)
    assert not get(run_id).has_ended


def workers(server: int | None = None) -> list[psutil.Process]:
    """Processes that simulate, of a server or of this process; none that has ended."""
    children = [child for child in psutil.Process(server).children() if child.status() != psutil.STATUS_ZOMBIE]
    return [child for child in children if any("spawn_main" in word for word in child.cmdline())]


# Over REST


def test_a_posted_run_gives_the_same_bytes_as_the_command_line(api, tmp_path):
    response = api.post("runs", json=SHORT)
    assert response.status_code == 202
    location = response.headers["location"]
    assert location == f"/api/v1/runs/{response.json()['id']}"
    run = ended_over_rest(api, response.json()["id"])
    assert (run["status"], run["reason"], run["progress"]) == ("done", "", 1.0)
    assert run["scenario"] == SHORT and run["metrics"]["ticks"] == 20 and run["real_time_factor"] > 0.0
    assert run["created"] <= run["started"] <= run["ended"]

    file = tmp_path / "scenario.json"
    file.write_text(json.dumps(SHORT))
    subprocess.run([WALK, "run", file, "--out", tmp_path / "out"], check=True, capture_output=True)
    size = 0
    for name in ("recording.npz", "recording.csv", "run.json"):
        sent = httpx.get(f"{str(api.base_url).removesuffix('/api/v1/')}{location}/{name}")
        assert sent.content == (tmp_path / "out" / name).read_bytes(), name
        size += len(sent.content)
    assert run["size"] == size
    assert {address.rpartition("/")[2] for address in run["files"].values()} >= {"recording.npz", "run.json"}


def test_events_follow_a_run_to_its_end(api):
    run_id = api.post("runs", json={"name": "followed", "robot": "hrp2", "duration": 4.0}).json()["id"]
    reported = []
    with api.stream("GET", f"runs/{run_id}/events", timeout=PATIENCE) as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        for line in stream.iter_lines():  # ends with the run
            if line.startswith("data:"):
                reported.append(json.loads(line.removeprefix("data:")))
    assert [run["id"] for run in reported] == [run_id] * len(reported)
    assert reported[-1]["status"] == "done" and reported[-1]["progress"] == 1.0
    fractions = [run["progress"] for run in reported]
    assert fractions == sorted(fractions) and len(reported) >= 2
    assert all(reported[i] != reported[i + 1] for i in range(len(reported) - 1))


def test_runs_are_listed_latest_first(api):
    ids = [api.post("runs", json=SHORT | {"name": f"number {i}"}).json()["id"] for i in range(3)]
    listed = api.get("runs").json()
    assert [run["id"] for run in listed] == ids[::-1]
    assert [run["name"] for run in listed] == ["number 2", "number 1", "number 0"]


def test_delete_stops_a_running_run_and_removes_an_ended_one(api, server):
    run_id = api.post("runs", json=LONG).json()["id"]
    wait_for(lambda: api.get(f"runs/{run_id}").json()["progress"] > 0.0, PATIENCE)
    busy = workers(server.process.pid)
    assert busy
    assert api.get(f"runs/{run_id}/recording.npz").status_code == 409
    response = api.delete(f"runs/{run_id}")
    assert response.status_code == 200 and response.json()["status"] == "cancelled"
    assert workers(server.process.pid) == []
    assert api.get(f"runs/{run_id}").json()["status"] == "cancelled"
    assert api.get(f"runs/{run_id}/recording.npz").status_code == 409
    assert api.delete(f"runs/{run_id}").status_code == 204
    assert api.get(f"runs/{run_id}").status_code == 404 and api.delete(f"runs/{run_id}").status_code == 404
    assert ended_over_rest(api, api.post("runs", json=SHORT).json()["id"])["status"] == "done", "the next one is taken"


def test_a_hundred_at_once_are_queued_or_refused_and_the_live_robot_walks_on(api):
    api.post("live/reset")
    responses: list[httpx.Response] = []
    threads = [threading.Thread(target=lambda: responses.append(api.post("runs", json=SHORT))) for _ in range(100)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    counts = Counter(response.status_code for response in responses)
    assert set(counts) <= {202, 503} and sum(counts.values()) == 100 and counts[202] >= 20
    refused = [response for response in responses if response.status_code == 503]
    assert all(int(response.headers["retry-after"]) > 0 and response.json()["detail"] for response in refused)
    taken = {response.json()["id"] for response in responses if response.status_code == 202}
    assert {ended_over_rest(api, run_id)["status"] for run_id in taken} == {"done"}
    state = api.get("live").json()
    assert state["tick"] > 100 and state["running"] and not state["fault"] and state["status"] == 0


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ('{"robot": "hrp2", "duration": 1e308}', "duration"),
        ('{"robot": "hrp2", "duration": NaN}', "duration"),
        ('{"robot": "hrp2", "duration": 601}', "duration"),
        ('{"robot": "hrp2", "duration": 1' + "0" * 400 + "}", "duration"),
        ('{"robot": "hrp2", "duration": 1' + "0" * 5000 + "}", "body"),
        ('{"robot": "hrp2", "duration": 600, "parameters": {"control_period": 0.001}}', "ticks"),
        ('{"robot": "../../etc/passwd", "duration": 1}', "robot"),
        ('{"robot": ["hrp2"], "duration": 1}', "robot"),
        ('{"duration": 1, "parameters": {"scheme": ["full"]}}', "parameters.scheme"),
        ('{"duration": 1, "events": [' + ",".join(['{"t": 0}'] * 1001) + "]}", "events"),
        ('{"duration": 1, "events": [' + ",".join(["[]"] * 5000) + "]}", "events"),
        ('{"duration": 1, "events": [[]]}', "events[0]"),
        ('{"duration": 1, "events": [{"t": 0, "reference": {"vx": 1e308}}]}', "events[0].reference.vx"),
        ('{"duration": 1, "events": [{"t": 0, "push": {"impulse": [[1], 2]}}]}', "events[0].push.impulse[0]"),
        ('{"duration": 1, "events": [{"t": 0, "push": {"impulse": [1e308, 0]}}]}', "events[0].push.impulse"),
        ('{"duration": 1, "name": "' + "x" * 2000 + '"}', "text"),
        ('{"duration": 1, "name": "\\ud800"}', "text"),
        ('{"duration": 1, "\\ud800": 1}', "text"),
        ('{"duration": 1, "name": ' + "[" * 50 + "]" * 50 + "}", "scenario"),
        ('{"duration": 1, "x": ' + "[" * 500 + "]" * 500 + "}", "scenario"),
        ("[" * 100_000, "body"),
        ("[]", "body"),
        ("", "body"),
    ],
)
def test_a_hostile_scenario_is_refused_with_its_field(api, body, field):
    response = api.post("runs", content=body, headers={"Content-Type": "application/json"})
    assert response.status_code == 422
    assert all(set(error) == {"field", "value", "limit"} for error in response.json()["errors"])
    assert response.json()["errors"][0]["field"].split(" ")[0] == field
    assert len(response.content) < 6000 and api.get("runs").json() == []


@pytest.mark.parametrize("is_announced", [True, False])
def test_a_body_that_is_too_long_is_not_read(api, is_announced):
    body = b" " * 300_000
    chunks = (body[i : i + 1000] for i in range(0, len(body), 1000))
    response = api.post("runs", content=body if is_announced else chunks, headers={"Content-Type": "application/json"})
    assert response.status_code == 413 and set(response.json()) == {"detail", "errors"}


@pytest.mark.parametrize("run_id", ["..", "../..", "..%2f..%2fetc", "%2e%2e", "%00", "x' OR 1=1 --", "a" * 3000, "٣"])
def test_an_id_leads_nowhere_else(api, server, run_id):
    api.post("runs", json=SHORT)
    for rest in ("", "/recording.npz", "/run.json", "/events", "/recording.npz/../../../runs.sqlite"):
        response = httpx.get(f"{server.url}api/v1/runs/{run_id}{rest}")
        assert response.status_code in (404, 422) and set(response.json()) == {"detail", "errors"}


def test_an_unknown_ending_is_refused(api):
    run_id = api.post("runs", json=SHORT).json()["id"]
    ended_over_rest(api, run_id)
    assert api.get(f"runs/{run_id}/recording.exe").status_code == 422


def test_runs_survive_a_server_that_is_killed(tmp_path):
    folder = str(tmp_path / "data")
    server = start_server("--robot", "hrp2", WALK_DATA=folder, RUNS_WORKERS="1")
    with server.client() as api:
        done = api.post("runs", json=SHORT).json()["id"]
        ended_over_rest(api, done)
        recording = api.get(f"runs/{done}/recording.npz").content
        under_way, waiting = (api.post("runs", json=scenario).json()["id"] for scenario in (LONG, SHORT))
        wait_for(lambda: api.get(f"runs/{under_way}").json()["progress"] > 0.0, PATIENCE)
    orphans = psutil.Process(server.process.pid).children(recursive=True)
    server.process.kill()
    server.process.wait(PATIENCE)

    with serving("--robot", "hrp2", WALK_DATA=folder) as server, server.client() as api:
        run = api.get(f"runs/{under_way}").json()
        assert (run["status"], run["reason"]) == ("failed", SERVER_DIED)
        assert ended_over_rest(api, waiting)["status"] == "done", "what waited is taken up"
        assert api.get(f"runs/{done}/recording.npz").content == recording
        assert len(api.get("runs").json()) == 3
    assert psutil.wait_procs(orphans, timeout=PATIENCE)[1] == [], "workers of the dead server end by themselves"
    assert {path.name for path in (tmp_path / "data" / "done").iterdir()} == {done, waiting}


# Without a server


def test_a_scenario_that_cannot_be_walked_fails_with_its_reason(started):
    run = ended(started.get, started.submit({"duration": 1.0, "parameters": {"com_height": 1.9}}).id)
    assert run.status == "failed" and run.reason and run.size == 0
    with pytest.raises(NoFileError, match="failed"):
        started.file(run.id, "run.json")


def test_a_run_that_breaks_what_it_expects_fails_and_keeps_its_files(started):
    run = ended(started.get, started.submit(SHORT | {"expect": {"not_fallen": False}}).id)
    assert run.status == "failed" and "not_fallen" in run.reason and run.progress.fraction == 1.0
    assert started.file(run.id, "recording.npz").is_file()


@pytest.mark.exhaustive
def test_other_formats_are_made_on_request_as_the_command_line_makes_them(started, tmp_path):
    with_body = {"name": "with a body", "duration": 0.2}
    run = ended(started.get, started.submit(with_body).id)
    write_run(record(scenario_from_mapping(with_body)), tmp_path, tuple(FORMATS))
    for ending in FORMATS:
        made = started.file(run.id, f"recording.{ending}")
        assert made.read_bytes() == (tmp_path / made.name).read_bytes(), ending
    files = list(made.parent.iterdir())
    assert len(files) == 6 and started.get(run.id).size == sum(file.stat().st_size for file in files)


def test_a_worker_that_dies_fails_its_run_and_the_next_gets_another(started):
    long, short = started.submit(LONG).id, started.submit(SHORT).id
    wait_until_running(started.get, long)
    for worker in workers():
        worker.kill()
    run = ended(started.get, long)
    assert run.status == "failed" and "-9" in run.reason
    assert ended(started.get, short).status == "done"


def test_the_queue_is_bounded(runs):
    ids = [runs.submit(SHORT).id for _ in range(5)]
    with pytest.raises(WorkUnavailableError, match="5 runs wait"):
        runs.submit(SHORT)
    assert runs.delete(ids[1]).status == "queued" and runs.get(ids[1]).status == "cancelled"
    runs.submit(SHORT)


def test_more_ended_runs_than_are_kept_push_out_the_oldest(tmp_path):
    runs = service(tmp_path, nb_kept=1)
    runs.start()
    first, second = runs.submit(SHORT).id, runs.submit(SHORT).id
    wait_for(lambda: [run.id for run in runs.list() if run.has_ended] == [second], PATIENCE)
    with pytest.raises(UnknownWorkError):
        runs.get(first)
    runs.stop()


def test_a_second_server_leaves_the_runs_of_the_first_alone(tmp_path, caplog):
    first = service(tmp_path)
    run = first.submit(SHORT)
    second = service(tmp_path)
    assert second.list() == [] and str(tmp_path) in caplog.text
    second.stop()
    first.stop()
    third = service(tmp_path)
    assert [known.id for known in third.list()] == [run.id]
    third.stop()


@pytest.fixture
def store(tmp_path) -> Iterator[RunStore]:
    store = RunStore(tmp_path)
    yield store
    store.close()


def under_way(store: RunStore) -> str:
    store.add(SHORT, "hrp2", 2.0)
    run = store.start_next()
    assert run is not None
    record(scenario_from_mapping(SHORT)).write(store.unfinished(run.id))
    return run.id


def test_the_oldest_runs_go_first_by_count_and_by_size(store):
    done = [under_way(store) for _ in range(4)]
    assert all(store.finish(run_id, 1.0) for run_id in done)
    waiting = store.add(SHORT, "hrp2", 2.0).id

    def left() -> list[str]:
        kept = [run.id for run in reversed(store.list())]
        assert kept.pop() == waiting and {path.name for path in (store.folder / "done").iterdir()} == set(kept)
        return kept

    store.trim(3)
    assert left() == done[1:]
    store.trim(9, store.get(done[2]).size + store.get(done[3]).size)
    assert left() == done[2:]
    store.trim(0, 1)
    assert left() == done[3:], "the latest stays"


def test_wherever_a_server_dies_no_run_is_half_there(store, tmp_path):
    """Files written, files moved but not in the row yet, files in the row; and files being removed, its row not yet."""
    written, moved, told, removed = (under_way(store) for _ in range(4))
    assert store.finish(told, 3.0) and store.finish(removed, 3.0)
    after = tmp_path / "after"
    shutil.copytree(store.folder, after, ignore=shutil.ignore_patterns("after"))
    (after / "unfinished" / moved).rename(after / "done" / moved)
    (after / "done" / removed / "run.json").unlink()
    next_store = RunStore(after)
    assert {run_id: next_store.get(run_id).status for run_id in (written, moved, told, removed)} == {
        written: "failed",
        moved: "done",
        told: "done",
        removed: "failed",
    }
    assert {path.name for path in (after / "done").iterdir()} == {moved, told, removed}
    assert list((after / "unfinished").iterdir()) == []
    next_store.close()


def test_runs_are_taken_in_order_and_never_once_cancelled(store):
    ids = [store.add(SHORT, "hrp2", 2.0).id for _ in range(4)]
    store.cancel(ids.pop(1))
    taken = [store.start_next() for _ in range(4)]
    assert [run.id for run in taken if run is not None] == ids and taken[-1] is None


def test_a_run_cancelled_as_it_finishes_stays_cancelled(store):
    run_id = under_way(store)
    assert store.cancel(run_id)
    assert not store.finish(run_id, 1.0) and not store.files(run_id).exists()
    store.fail(run_id, "too late")
    assert store.get(run_id).status == "cancelled" and not store.cancel(run_id)


def test_metrics_that_are_not_finite_are_none(store):
    run_id = under_way(store)
    file = store.folder / "unfinished" / run_id / "run.json"
    file.write_text(json.dumps({"metrics": {"a": [math.nan, 1.0], "b": {"c": -math.inf}}, "expectations": []}))
    store.finish(run_id, 1.0)
    assert store.get(run_id).metrics == {"a": [None, 1.0], "b": {"c": None}}


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.just(10**400),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(
    path=st.sampled_from(
        [("name",), ("robot",), ("duration",), ("parameters",), ("events",), ("events", 0), ("more",)]
        + [("parameters", key) for key in ("alpha", "scheme", "horizon_samples", "com_height", "stepping_in_place")]
        + [("events", 0, key) for key in ("t", "reference", "more")]
        + [("events", 0, "reference", key) for key in ("vx", "more")]
        + [("events", 1, "push", key) for key in ("impulse", "duration", "frame", "more")]
        + [("events", 1, "push", "impulse", 0)]
    ),
    value=plain,
)
@example(path=("name",), value="\ud800")
@example(path=("name",), value="x" * 1001)
def test_whatever_stands_in_a_scenario_is_taken_or_refused(path, value):
    scenario = json.loads(json.dumps(SHORT))
    place = scenario
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    try:
        admitted = admitted_scenario(scenario, RunLimits())
    except InvalidValueError as error:
        assert error.field and error.limit
    else:
        assert admitted.nb_ticks <= RunLimits().ticks and np.isfinite(admitted.duration)
        assert json.dumps(scenario, allow_nan=False, ensure_ascii=False).encode() and len(admitted.name) <= 1000
