"""Scripted runs over REST: queued, simulated in other processes, stored, and served as `walk run` writes them."""

import json
import subprocess
import threading
from collections import Counter
from collections.abc import Iterator

import httpx
import psutil
import pytest
from conftest import PATIENCE, WALK, ended, send_text, serving, start_server, wait_for
from test_run_service import LONG, SHORT, workers

from app.runs.recovery import SERVER_DIED

pytestmark = pytest.mark.server("hrp2", RUNS_QUEUED="20")


@pytest.fixture
def api(server) -> Iterator[httpx.Client]:
    """A client of a server that has no runs."""
    with server.client() as client:
        while runs := client.get("runs").json():
            for run in runs:
                client.delete(f"runs/{run['id']}")
        yield client


def test_a_posted_run_gives_the_same_bytes_as_the_command_line(api, tmp_path):
    response = api.post("runs", json=SHORT)
    assert response.status_code == 202
    location = response.headers["location"]
    assert location == f"/api/v1/runs/{response.json()['id']}"
    run = ended(api, f"runs/{response.json()['id']}")
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
    wait_for(lambda: api.get(f"runs/{run_id}").json()["progress"] > 0.0)
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
    assert ended(api, f"runs/{api.post('runs', json=SHORT).json()['id']}")["status"] == "done", "the next one is taken"


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
    assert {ended(api, f"runs/{run_id}")["status"] for run_id in taken} == {"done"}
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
    response = send_text(api, "POST", "runs", body)
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
    ended(api, f"runs/{run_id}")
    assert api.get(f"runs/{run_id}/recording.exe").status_code == 422


def test_runs_survive_a_server_that_is_killed(tmp_path):
    folder = str(tmp_path / "data")
    server = start_server("--robot", "hrp2", WALK_DATA=folder, RUNS_WORKERS="1")
    with server.client() as api:
        done = api.post("runs", json=SHORT).json()["id"]
        ended(api, f"runs/{done}")
        recording = api.get(f"runs/{done}/recording.npz").content
        under_way, waiting = (api.post("runs", json=scenario).json()["id"] for scenario in (LONG, SHORT))
        wait_for(lambda: api.get(f"runs/{under_way}").json()["progress"] > 0.0)
    orphans = psutil.Process(server.process.pid).children(recursive=True)
    server.process.kill()
    server.process.wait(PATIENCE)

    with serving("--robot", "hrp2", WALK_DATA=folder) as server, server.client() as api:
        run = api.get(f"runs/{under_way}").json()
        assert (run["status"], run["reason"]) == ("failed", SERVER_DIED)
        assert ended(api, f"runs/{waiting}")["status"] == "done", "what waited is taken up"
        assert api.get(f"runs/{done}/recording.npz").content == recording
        assert len(api.get("runs").json()) == 3
    assert psutil.wait_procs(orphans, timeout=PATIENCE)[1] == [], "workers of the dead server end by themselves"
    assert {path.name for path in (tmp_path / "data" / "done").iterdir()} == {done, waiting}
