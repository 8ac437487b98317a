"""Uploaded recordings: each becomes a run with the same numbers, or is refused by the field that is wrong."""

import io
import json
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import PATIENCE
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from websockets.sync.client import connect

from app.formats import read_run, write_run
from app.formats.foreign_file import read_foreign
from app.robot_choices import RobotChoices
from app.runs import upload
from app.runs.upload import TakeUpload, UploadLimits
from walkcore.errors import InvalidValueError
from walkcore.scenario.recording import record
from walkcore.scenario.scenario import scenario_from_mapping

pytestmark = pytest.mark.server("hrp2", UPLOADS_MAX_BYTES="400000")

LIMITS = UploadLimits(bytes=400_000, ticks=300)
WALK = {
    "name": "short",
    "robot": "hrp2",
    "duration": 4.0,
    "parameters": {"control_period": 0.02},
    "events": [{"t": 0.4, "reference": {"vx": 0.2}}, {"t": 2.0, "push": {"impulse": [0.0, 5.0]}}],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files of a short walk, in all formats with columns, and a zip of its folder."""
    folder = tmp_path_factory.mktemp("walk")
    write_run(record(scenario_from_mapping(WALK)), folder, ("npz", "csv", "parquet", "mcap"))
    with zipfile.ZipFile(folder / "walk.zip", "w") as archive:
        for name in ("recording.npz", "run.json"):
            archive.write(folder / name, f"short/{name}")
    return folder


@pytest.fixture
def take(tmp_path, monkeypatch) -> Callable[[bytes], Path]:
    """Makes a run of a file, in this process."""
    monkeypatch.setattr(upload, "limit_this_process", lambda _: None)

    def take(content: bytes) -> Path:
        (tmp_path / "upload").write_bytes(content)
        TakeUpload(tmp_path / "upload", "", "hrp2", RobotChoices(), LIMITS)(lambda _: None)
        return tmp_path

    return take


@pytest.mark.parametrize("name", ["recording.npz", "recording.csv", "recording.parquet", "recording.mcap", "walk.zip"])
def test_every_kind_of_file_leads_to_the_same_numbers(folder, take, name):
    written, found = read_run(folder), read_run(take((folder / name).read_bytes()))
    assert set(found.columns) == set(written.columns)
    for column, values in written.columns.items():
        assert np.array_equal(found[column], values, equal_nan=True), column
    has_scenario = name not in ("recording.npz", "recording.csv")
    assert found.run["has_scenario"] is has_scenario
    assert found.parameters["control_period"] == 0.02 and found.parameters["robot"] == "hrp2"
    if has_scenario:
        assert found.run["scenario"] == written.run["scenario"] and found.metrics == written.metrics


def changed(name: str, value: Any, row: Any = 7) -> Callable[[dict[str, np.ndarray]], None]:
    def change(columns: dict[str, np.ndarray]) -> None:
        columns[name][row] = value

    return change


def put(name: str, values: Any) -> Callable[[dict[str, np.ndarray]], None]:
    return lambda columns: columns.update({name: values})


WRONG_COLUMNS = {
    "no number": (changed("com_x", np.nan), "com_x[7]"),
    "an infinity": (changed("left_z", np.inf), "left_z[7]"),
    "far away": (changed("right_x", 1e7), "right_x[7]"),
    "a huge jerk": (changed("jerk_x", 1e300), "jerk_x[7]"),
    "half a foothold": (changed("foothold_yaw", np.nan, 100), "foothold_yaw[100]"),
    "an unknown phase": (changed("phase", 3), "phase[7]"),
    "half a side": (changed("support_side", 0.5), "support_side[7]"),
    "a gap in time": (changed("tick", 3), "tick[7]"),
    "a negative tick": (put("tick", np.arange(-1.0, 199.0)), "tick[0]"),
    "another clock": (changed("t", 1.0), "t[7]"),
    "half a step": (changed("steps_to_stand", 0.5), "steps_to_stand[7]"),
    "one dimension more": (put("com_x", np.zeros((200, 2))), "com_x.npy"),
    "no dimension": (put("com_x", np.float64(1.0)), "com_x.npy"),
    "another length": (put("com_x", np.zeros(199)), "columns"),
    "complex numbers": (put("com_x", np.zeros(200, complex)), "com_x.npy"),
    "text": (put("com_x", np.array(["x"] * 200)), "com_x.npy"),
    "records": (put("com_x", np.zeros(200, [("a", float)])), "com_x.npy"),
    "objects": (put("com_x", np.array([{}] * 200, object)), "com_x.npy"),
    "a missing column": (lambda columns: columns.pop("com_x"), "columns"),
    "too many columns": (lambda columns: columns.update({f"more_{i}": np.zeros(200) for i in range(600)}), "columns"),
    "too many rows": (lambda columns: columns.update({n: np.zeros(301) for n in columns}), "rows"),
    "no rows": (lambda columns: columns.update({n: np.zeros(0) for n in columns}), "rows"),
}


@pytest.mark.parametrize(("change", "field"), WRONG_COLUMNS.values(), ids=WRONG_COLUMNS)
def test_columns_that_cannot_be_drawn_are_refused(folder, take, change, field):
    with np.load(folder / "recording.npz") as file:
        columns = {name: file[name] for name in file.files}
    change(columns)
    content = io.BytesIO()
    np.savez(content, allow_pickle=True, **columns)
    with pytest.raises(InvalidValueError) as refusal:
        take(content.getvalue())
    assert refusal.value.field == field


def bomb() -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("tick.npy", bytes(10**8))
    return content.getvalue()


def zipped(**members: bytes) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return content.getvalue()


def header(shape: str, kind: str = "<f8") -> bytes:
    """An npz whose only array says of itself what it is."""
    text = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117).encode() + b"\n"
    return zipped(**{"tick.npy": b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text})


def lie() -> bytes:
    """A zip that says of its member that it is short."""
    data = zipped(**{"tick.npy": b"\x93NUMPY\x01\x00" + bytes(10**5)})
    return data.replace((10**5 + 8).to_bytes(4, "little"), (100).to_bytes(4, "little"))


class Surprise:
    def __reduce__(self):
        return (pytest.fail, ("unpickled",))


def pickled() -> bytes:
    content = io.BytesIO()
    np.savez(content, allow_pickle=True, tick=np.array([Surprise()], object))
    return content.getvalue()


def parquet(**columns: Any) -> bytes:
    content = io.BytesIO()
    pq.write_table(pa.table(columns), content)
    return content.getvalue()


WRONG_FILES = {
    "nothing": (b"", "file"),
    "text": (b"walk", "file"),
    "a picture": (b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 10, "file"),
    "a pickle": (pickle.dumps(Surprise()), "file"),
    "objects in an array": (pickled(), "tick.npy"),
    "a bomb": (bomb(), "bytes"),
    "a lie": (lie(), "file"),
    "half of an archive": (zipped(a=b"x" * 1000)[:500], "file"),
    "an archive of nothing": (zipped(), "file"),
    "an archive of something else": (zipped(a=b"x"), "file"),
    "an archive in an archive": (zipped(**{"recording.npz": zipped(**{"recording.npz": b"x"})}), "file"),
    "1e9 rows": (header(f"({10**9},)"), "rows"),
    "rows below zero": (header("(-1,)"), "tick.npy"),
    "a shape that is code": (header("(__import__('os').abort(),)"), "file"),
    "no data": (header("(100,)"), "tick.npy"),
    "long numbers": (header("(100,)", "<f16"), "tick.npy"),
    "Parquet of text": (parquet(tick=["a"]), "tick"),
    "Parquet of lists": (parquet(tick=[[1.0]]), "tick"),
    "Parquet with too many rows": (parquet(tick=np.zeros(301)), "rows"),
    "half of a Parquet": (parquet(tick=np.zeros(100))[:200], "file"),
    "no MCAP": (b"\x89MCAP0\r\n" + bytes(100), "file"),
    "CSV of words": (b"tick,t\nno,yes\n", "file"),
    "CSV with other lines": (b"tick,t\n1,2,3\n", "file"),
    "CSV with a long line": (b"tick," + b"x" * 100_000, "file"),
    "CSV with a column twice": (b"tick,tick\n0,0\n", "file"),
    "CSV with too many lines": (b"tick,t\n" + b"0,0\n" * 301, "rows"),
    "CSV with too many lines of a Mac": (b"tick,t\n" + b"0,0\r" * 301, "rows"),
    "CSV with no columns of ours": (b"tick,t\n0,0\n1,0.02\n", "columns"),
}


@pytest.mark.parametrize(("content", "field"), WRONG_FILES.values(), ids=WRONG_FILES)
def test_files_that_are_no_recording_are_refused(take, content, field):
    with pytest.raises(InvalidValueError) as refusal:
        take(content)
    assert refusal.value.field == field and f"{refusal.value}".isprintable()


def without(key: str) -> Callable[[dict[str, Any]], str]:
    return lambda run: json.dumps({name: value for name, value in run.items() if name != key})


def with_(**changes: Any) -> Callable[[dict[str, Any]], str]:
    return lambda run: json.dumps(
        {name: {**run[name], **change} for name, change in changes.items()}
        | {name: value for name, value in run.items() if name not in changes}
    )


WRONG_RUNS = {
    "no JSON": (lambda _: "{", "run.json"),
    "no mapping": (lambda _: "[]", "run.json"),
    "NaN": (lambda _: '{"scenario": NaN}', "run.json"),
    "100,000 lists": (lambda _: "[" * 100_000, "run.json"),
    "no scenario": (without("scenario"), "run.json.scenario"),
    "no parameters": (without("parameters"), "run.json.parameters"),
    "a robot on our disk": (with_(parameters={"robot": "/etc/passwd"}), "robot"),
    "no robot": (with_(parameters={"robot": None}), "robot"),
    "a body that is not there": (with_(parameters={"robot": "talos"}), "columns"),
    "another period": (with_(parameters={"control_period": 0.01}), "run.json.parameters.control_period"),
    "no gravity": (with_(parameters={"gravity": "strong"}), "run.json.parameters.gravity"),
    "no duration": (with_(scenario={"duration": -1}), "duration"),
    "1001 changes": (
        with_(scenario={"events": [{"t": 1.0, "parameters": {"alpha": 1e-6}}] * 1001}),
        "changes of parameters",
    ),
    "a shorter walk": (with_(scenario={"duration": 2.0}), "rows"),
    "a reason that is none": (with_(metrics={"reason": {}}), "run.json.metrics.reason"),
}


@pytest.mark.parametrize(("change", "field"), WRONG_RUNS.values(), ids=WRONG_RUNS)
def test_a_run_json_that_does_not_fit_is_refused(folder, take, change, field):
    text = change(json.loads((folder / "run.json").read_text()))
    with pytest.raises(InvalidValueError) as refusal:
        take(zipped(**{"recording.npz": (folder / "recording.npz").read_bytes(), "run.json": text.encode()}))
    assert refusal.value.field == field


@settings(max_examples=100, suppress_health_check=list(HealthCheck), derandomize=True)
@given(
    name=st.sampled_from(["recording.npz", "walk.zip", "recording.csv"]),
    places=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=5),
    end=st.integers(1, 10**6),
)
def test_a_broken_file_is_read_or_refused(folder, tmp_path, name, places, end):
    content = bytearray((folder / name).read_bytes())
    for place, value in places:
        content[place % len(content)] = value
    file = tmp_path / "upload"
    file.write_bytes(content[: max(end % (2 * len(content)), 1)])
    try:
        read_foreign(file, LIMITS.ticks, 8 * LIMITS.bytes)
    except InvalidValueError as refusal:
        assert f"{refusal}".isprintable()


# By REST


def sent(api: httpx.Client, content: Any, **query: str) -> httpx.Response:
    return api.post("runs/upload", content=content, params=query)


def test_an_uploaded_recording_is_a_run_that_can_be_looked_at(server, api, folder):
    answer = sent(api, (folder / "walk.zip").read_bytes(), name="mine").raise_for_status()
    run = answer.json()
    assert answer.status_code == 201 and answer.headers["location"].endswith(run["id"])
    assert (run["name"], run["status"], run["robot"]) == ("mine", "done", "hrp2")
    assert api.get(f"runs/{run['id']}/recording.csv").content == (folder / "recording.csv").read_bytes()
    line = api.get(f"runs/{run['id']}/timeline").raise_for_status().json()
    assert line["last_tick"] == 199 and [(mark["tick"], mark["kind"]) for mark in line["marks"]] == [(100, "push")]
    with connect(server.socket_url("look?client=me")) as look:
        look.send(json.dumps({"tick": 120, "run": run["id"]}))
        past = json.loads(look.recv(30))
    with np.load(folder / "recording.npz") as file:
        assert past["tick"] == 120 and past["com_x"] == file["com_x"][120]


def test_what_is_refused_leaves_nothing_and_says_the_field(api):
    before = len(api.get("runs").json())
    answer = sent(api, header(f"({10**9},)"))
    assert answer.status_code == 422
    assert answer.json()["errors"] == [{"field": "rows", "value": 10**9, "limit": "must be at most 120000"}]
    for content in (bytes(400_001), iter([bytes(200_000)] * 3)):  # announced, and not
        assert sent(api, content).status_code == 413
    assert sent(api, b"tick,t\n0,0\n", robot="/etc/passwd").json()["errors"][0]["field"] == "robot"
    assert len(api.get("runs").json()) == before


def test_the_robot_goes_on_from_an_uploaded_recording_or_says_why_not(api, folder):
    """The server's robot has another control period than the files of the other tests."""
    walk = scenario_from_mapping(WALK | {"duration": 3.0, "parameters": {}})
    write_run(record(walk), folder / "live", ("npz", "parquet"))
    api.post("live/pause")
    run = sent(api, (folder / "live" / "recording.parquet").read_bytes()).raise_for_status().json()["id"]
    assert api.get(f"runs/{run}/timeline").json()["no_fork"] == ""
    live = api.post("live/fork", json={"run": run, "tick": 120}, timeout=PATIENCE).raise_for_status().json()
    with np.load(folder / "live" / "recording.npz") as file:
        for tick in (120, 130):
            assert (live["tick"], live["driver"], live["com_x"]) == (tick, "past", file["com_x"][tick])
            live = api.post("live/step", json={"ticks": 10}).json()
    bare = sent(api, (folder / "live" / "recording.npz").read_bytes()).raise_for_status().json()["id"]
    assert "without run.json" in api.get(f"runs/{bare}/timeline").json()["no_fork"]
    walks = api.get("live").json()["walk"]
    for body, status in (
        ({"run": bare, "tick": 120}, 422),
        ({"run": run, "tick": 600}, 422),
        ({"run": run, "tick": 1, "push": {"impulse": [1e6, 0.0]}}, 422),
        ({"run": "unknown", "tick": 1}, 404),
    ):
        assert api.post("live/fork", json=body, timeout=PATIENCE).status_code == status
    assert api.get("live").json()["walk"] == walks
