"""Jobs in processes of their own: results, progress, errors, and the end of their processes."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import psutil
import pytest

from app.jobs import JobPool, JobProcess, JobRunner, ProcessDiedError, Report
from walkcore.errors import InvalidValueError

PATIENCE = 60.0  # [s] on a busy machine


class OddError(Exception):
    """An error that cannot be made again from what pickle keeps of it."""

    def __init__(self, one: int, other: int) -> None:
        super().__init__(f"{one} and {other}")


def square(number: int, report: Report) -> int:
    for percent in (50, 100):
        report((number, percent))
    return number**2


def process_id(_: Report) -> int:
    return os.getpid()


def niceness(_: Report) -> int:
    return os.nice(0)


def fail(kind: type[Exception], arguments: tuple[object, ...], _: Report) -> None:
    raise kind(*arguments)


def die(_: Report) -> None:
    os._exit(7)


def report_process_and_sleep(report: Report) -> None:
    report(os.getpid())
    time.sleep(600.0)


@pytest.fixture
def process() -> Iterator[JobProcess]:
    process = JobProcess()
    yield process
    process.kill()


def test_a_process_does_one_job_after_the_other_and_reports_their_progress(process):
    progress = []
    assert process.run(partial(square, 3), progress.append).result() == 9
    assert progress == [(3, 50), (3, 100)]
    assert process.run(process_id).result() == process.run(process_id).result() != os.getpid()
    process.kill()
    assert not process.is_alive


def test_a_process_gives_way_to_others():
    process = JobProcess(niceness=7)
    assert process.run(niceness).result() == min(max(os.nice(0), 0) + 7, 19)
    process.kill()


def test_a_process_gives_way_to_others_also_where_the_one_that_starts_it_does_not(monkeypatch):
    monkeypatch.setattr(os, "getpriority", lambda *_: -5)
    process = JobProcess(niceness=19)
    assert process.run(niceness).result() == 19
    process.kill()


@pytest.mark.parametrize(
    ("kind", "arguments", "received", "text"),
    [
        (InvalidValueError, ("a.b", 3, "must be less"), InvalidValueError, "a.b = 3: must be less"),
        (OddError, (1, 2), RuntimeError, "1 and 2"),
    ],
)
def test_an_error_fails_the_job_and_the_process_takes_the_next(kind, arguments, received, text, process):
    error = process.run(partial(fail, kind, arguments)).exception()
    assert type(error) is received and text in str(error)
    assert process.run(partial(square, 2)).result() == 4


def test_a_process_that_ends_fails_its_job(process):
    with pytest.raises(ProcessDiedError, match="exit code 7"):
        process.run(die).result()
    assert not process.is_alive
    with pytest.raises(ProcessDiedError):
        process.run(process_id).result()


def test_a_job_can_be_killed_while_it_runs_by_several_threads_at_once(process):
    started = threading.Event()
    for _ in range(4):
        threading.Thread(target=lambda: started.wait(PATIENCE) and process.kill()).start()
    error = process.run(report_process_and_sleep, lambda _: started.set()).exception()
    assert isinstance(error, ProcessDiedError) and "-9" in str(error)


def test_a_runner_has_a_new_process_for_each_job_or_keeps_one_and_has_none_once_it_is_stopped():
    runner = JobRunner()
    ids = {runner.run(process_id).result() for _ in range(2)}
    assert len(ids) == 2 and not any(psutil.pid_exists(i) for i in ids)
    kept = [runner.run_and_keep(process_id).result() for _ in range(2)]
    assert kept[0] == kept[1] and kept[0] not in ids
    runner.end_process()
    assert not psutil.pid_exists(kept[0])
    assert isinstance(runner.run_and_keep(die).exception(), ProcessDiedError)
    last = runner.run_and_keep(process_id).result()
    runner.stop()
    assert runner.is_stopping and not psutil.pid_exists(last)
    with pytest.raises(ProcessDiedError, match="no process"):
        runner.run(process_id).result()


@pytest.mark.parametrize("nb_processes", [1, 3])
def test_a_pool_does_all_jobs_and_reports_the_progress_of_each(nb_processes):
    progress = []
    with JobPool(nb_processes) as pool:
        done = dict(pool.run([partial(square, number) for number in range(7)], lambda *told: progress.append(told)))
    assert {index: future.result() for index, future in done.items()} == {i: i**2 for i in range(7)}
    assert sorted(progress) == [(i, (i, percent)) for i in range(7) for percent in (50, 100)]


def test_a_pool_keeps_its_processes_from_one_run_to_the_next_and_replaces_those_that_end():
    with JobPool(2) as pool:
        first = {done.result() for _, done in pool.run([process_id] * 4)}
        assert {done.result() for _, done in pool.run([process_id] * 4)} <= first and os.getpid() not in first
        endings = [done.exception() for _, done in pool.run([die, process_id, die, process_id])]
        assert sum(isinstance(error, ProcessDiedError) for error in endings) == 2
        assert {done.result() for _, done in pool.run([process_id] * 4)}.isdisjoint({os.getpid()})
    assert not any(map(psutil.pid_exists, first))


def test_a_pool_that_is_left_early_leaves_no_process():
    started: list[int] = []
    with pytest.raises(KeyboardInterrupt), JobPool(2) as pool:

        def interrupt(_: int, process: int) -> None:
            started.append(process)
            if len(started) == 2:
                raise KeyboardInterrupt

        list(pool.run([report_process_and_sleep] * 3, interrupt))
    assert len(started) == 2 and not any(map(psutil.pid_exists, started))


def test_a_job_of_one_process_is_done_here():
    with JobPool(1) as pool:
        assert [done.result() for _, done in pool.run([process_id])] == [os.getpid()]


PARENT = """
import sys
sys.path.insert(0, sys.argv[1])
from app.jobs import JobPool
from test_jobs import report_process_and_sleep
if __name__ == "__main__":
    with JobPool(2) as pool:
        list(pool.run([report_process_and_sleep] * 2, lambda _, process: print(process, flush=True)))
"""


def test_processes_end_when_their_parent_is_killed_in_the_middle_of_a_job(tmp_path):
    (tmp_path / "parent.py").write_text(PARENT)
    command = [sys.executable, tmp_path / "parent.py", Path(__file__).parent]
    parent = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    orphans = [psutil.Process(int(parent.stdout.readline())) for _ in range(2)]
    parent.kill()
    parent.wait()
    assert psutil.wait_procs(orphans, timeout=PATIENCE)[1] == []
