"""The service of scripted runs without a server: what is admitted, how the queue goes on, and what is kept."""

import json
import math
import shutil
from collections.abc import Iterator

import numpy as np
import psutil
import pytest
from conftest import ended_run, runs_in, wait_for
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from app.formats import FORMATS, write_run
from app.runs import RunLimits, Runs
from app.runs.admission import admitted_scenario
from app.runs.store import RunStore
from app.work import NoFileError, UnknownWorkError, WorkUnavailableError
from walkcore.errors import InvalidValueError
from walkcore.scenario.recording import record
from walkcore.scenario.scenario import scenario_from_mapping

SHORT = {
    "name": "short",
    "robot": "hrp2",
    "duration": 2.0,
    "parameters": {"control_period": 0.1, "alpha": 1e-5},
    "events": [{"t": 0.3, "reference": {"vx": 0.2}}, {"t": 1, "push": {"impulse": [0, 2.5], "frame": "world"}}],
}
LONG = {"name": "long", "robot": "hrp2", "duration": 500.0}


@pytest.fixture(scope="module")
def started(tmp_path_factory) -> Iterator[Runs]:
    """Runs with a worker."""
    with runs_in(tmp_path_factory.mktemp("started")) as runs:
        runs.start()
        yield runs


def workers(server: int | None = None) -> list[psutil.Process]:
    """Processes that simulate, of a server or of this process; none that has ended."""
    children = [child for child in psutil.Process(server).children() if child.status() != psutil.STATUS_ZOMBIE]
    return [child for child in children if any("spawn_main" in word for word in child.cmdline())]


def test_a_scenario_that_cannot_be_walked_fails_with_its_reason(started):
    run = ended_run(started, started.submit({"duration": 1.0, "parameters": {"com_height": 1.9}}).id)
    assert run.status == "failed" and run.reason and run.size == 0
    with pytest.raises(NoFileError, match="failed"):
        started.file(run.id, "run.json")


def test_a_run_that_breaks_what_it_expects_fails_and_keeps_its_files(started):
    run = ended_run(started, started.submit(SHORT | {"expect": {"not_fallen": False}}).id)
    assert run.status == "failed" and "not_fallen" in run.reason and run.progress.fraction == 1.0
    assert started.file(run.id, "recording.npz").is_file()


@pytest.mark.exhaustive
def test_other_formats_are_made_on_request_as_the_command_line_makes_them(started, tmp_path):
    with_body = {"name": "with a body", "duration": 0.2}
    run = ended_run(started, started.submit(with_body).id)
    write_run(record(scenario_from_mapping(with_body)), tmp_path, tuple(FORMATS))
    for ending in FORMATS:
        made = started.file(run.id, f"recording.{ending}")
        assert made.read_bytes() == (tmp_path / made.name).read_bytes(), ending
    files = list(made.parent.iterdir())
    assert len(files) == 6 and started.get(run.id).size == sum(file.stat().st_size for file in files)


def test_a_worker_that_dies_fails_its_run_and_the_next_gets_another(started):
    long, short = started.submit(LONG).id, started.submit(SHORT).id
    wait_for(lambda: started.get(long).progress.fraction > 0.0)
    for worker in workers():
        worker.kill()
    run = ended_run(started, long)
    assert run.status == "failed" and "-9" in run.reason
    assert ended_run(started, short).status == "done"


def test_the_queue_is_bounded(tmp_path):
    with runs_in(tmp_path, nb_queued=5) as runs:
        ids = [runs.submit(SHORT).id for _ in range(5)]
        with pytest.raises(WorkUnavailableError, match="5 runs wait"):
            runs.submit(SHORT)
        assert runs.delete(ids[1]).status == "queued" and runs.get(ids[1]).status == "cancelled"
        runs.submit(SHORT)


def test_more_ended_runs_than_are_kept_push_out_the_oldest(tmp_path):
    with runs_in(tmp_path, nb_kept=1) as runs:
        runs.start()
        first, second = runs.submit(SHORT).id, runs.submit(SHORT).id
        wait_for(lambda: [run.id for run in runs.list() if run.has_ended] == [second])
        with pytest.raises(UnknownWorkError):
            runs.get(first)


def test_a_second_server_leaves_the_runs_of_the_first_alone(tmp_path, caplog):
    with runs_in(tmp_path) as first:
        run = first.submit(SHORT)
        with runs_in(tmp_path) as second:
            assert second.list() == [] and str(tmp_path) in caplog.text
    with runs_in(tmp_path) as third:
        assert [known.id for known in third.list()] == [run.id]


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


@settings(max_examples=100, suppress_health_check=list(HealthCheck), derandomize=True)
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
