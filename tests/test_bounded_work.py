"""Work that clients request of the runs is bounded: one walk is saved at a time, elsewhere; streams share a reader."""

import asyncio
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import pytest
from conftest import PATIENCE, runs_in, wait_for

from app.http.run_schemas import RunSummary
from app.live.control import Control
from app.live.session_log import PackedSegment, Session
from app.routes.followed_runs import MAX_STREAMS, FollowedRuns
from app.runs import Run, Runs
from app.runs.run import RunProgress
from app.runs.runs import MAX_SAVES
from app.work import UnknownWorkError, WorkUnavailableError
from walkcore import Parameters, load_robot

HRP2 = load_robot("hrp2")


@pytest.fixture
def runs(tmp_path) -> Iterator[Runs]:
    with runs_in(tmp_path) as runs:
        yield runs


@pytest.fixture(scope="module")
def session() -> list[PackedSegment]:
    """A short walk, as the control process packs it."""
    control = Control(HRP2, Parameters(control_period=0.02), lambda _: None)
    for _ in range(30):
        control.tick()
    return list(control.save(False))


def test_a_walk_is_written_by_a_process_of_its_own_as_it_would_be_here(runs, session, tmp_path):
    seen = set[str]()
    thread = threading.Thread(target=lambda: runs.add_session(session, "driven", HRP2))
    thread.start()
    wait_for(lambda: seen.update(p.name for p in active_children()) or not thread.is_alive())
    ours = {p.name for p in active_children() if not p.name.startswith("Loky")}  # those are of sweeps in other tests
    assert {name for name in seen if not name.startswith("Loky")} == {"walk job"} and not ours
    (run,) = runs.list()
    assert (run.status, run.name, run.robot) == ("done", "driven", "hrp2")
    Session.unpacked(session).recording("driven", HRP2).write(tmp_path / "here")
    for name in ("recording.npz", "recording.csv", "run.json"):
        assert runs.file(run.id, name).read_bytes() == (tmp_path / "here" / name).read_bytes()
    assert files(tmp_path / "unfinished") == []


def test_a_walk_goes_to_its_file_as_it_comes_and_is_not_held(runs, session):
    """One segment at most of those that come from the control process is alive at a time."""
    alive = 0

    class Held(PackedSegment):
        def __reduce__(self) -> tuple[type[PackedSegment], tuple[int, bytes]]:
            return PackedSegment, (self.first_tick, self.data)

        def __del__(self) -> None:
            nonlocal alive
            alive -= 1

    def come() -> Iterator[PackedSegment]:
        nonlocal alive
        for segment in session:
            assert alive <= 1  # the one before, until this one takes its name
            alive += 1
            yield Held(segment.first_tick, segment.data)

    assert runs.add_session(come(), "driven", HRP2).status == "done"
    assert alive == 0


def files(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*")) if folder.exists() else []


def test_so_many_walks_are_saved_at_once_and_no_more(runs):
    with ExitStack() as places:
        for _ in range(MAX_SAVES):
            places.enter_context(runs.sessions.place())
        with pytest.raises(WorkUnavailableError, match="being saved"), runs.sessions.place():
            pass
    with runs.sessions.place():
        pass


def test_a_walk_that_cannot_be_written_leaves_nothing(runs, tmp_path):
    with pytest.raises(Exception, match="pickle"):
        runs.add_session([PackedSegment(0, b"no session")], "broken", HRP2)
    assert runs.list() == [] and files(tmp_path / "unfinished") == []


class Lookups:
    """Stand-in for the runs that counts how often each is looked up."""

    def __init__(self) -> None:
        self.counts = Counter[str]()
        self.runs: dict[str, Run] = {}

    def get(self, run_id: str) -> Run:
        self.counts[run_id] += 1
        if run_id not in self.runs:
            raise UnknownWorkError(run_id)
        return self.runs[run_id]


@pytest.fixture
def lookups() -> Lookups:
    found = Lookups()
    for run_id in ("a", "b"):
        found.runs[run_id] = Run(
            id=run_id, source={}, robot="hrp2", duration=1.0, status="running", created=0.0, progress=RunProgress(0.1)
        )
    return found


def test_streams_of_a_run_share_its_reader_and_all_see_its_end(lookups):
    async def follow() -> list[list[str]]:
        followed: Any = FollowedRuns(lambda run_id: RunSummary.model_validate(lookups.get(run_id)))
        seen: list[list[str]] = [[] for _ in range(50)]

        async def read(k: int) -> None:
            async for summary in followed.summaries(RunSummary.model_validate(lookups.runs["a"])):
                seen[k].append(summary.status)

        streams = [asyncio.create_task(read(k)) for k in range(50)]
        while lookups.counts["a"] < 3:
            await asyncio.sleep(0.01)
        lookups.runs["a"] = replace(lookups.runs["a"], status="done")
        await asyncio.wait_for(asyncio.gather(*streams), PATIENCE)
        return seen

    assert asyncio.run(follow()) == 50 * [["running", "done"]]
    assert lookups.counts["a"] <= 5 and lookups.counts["b"] == 0


def test_a_stream_ends_when_its_run_is_removed(lookups):
    async def follow() -> list[str]:
        followed: Any = FollowedRuns(lambda run_id: RunSummary.model_validate(lookups.get(run_id)))
        run = lookups.runs.pop("b")
        return [summary.status async for summary in followed.summaries(RunSummary.model_validate(run))]

    assert asyncio.run(asyncio.wait_for(follow(), PATIENCE))[0] == "running"


def test_so_many_streams_are_open_and_no_more(lookups):
    async def follow() -> None:
        followed: Any = FollowedRuns(lookups)  # type: ignore[arg-type]
        streams = [followed.summaries(lookups.runs["a"]) for _ in range(MAX_STREAMS)]
        for stream in streams:
            await anext(stream)
        with pytest.raises(WorkUnavailableError):
            followed.check_room()
        for stream in streams:
            await stream.aclose()
        followed.check_room()

    asyncio.run(follow())
