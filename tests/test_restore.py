"""The live robot goes on from a tick of a recorded run, exactly as that walk was."""

import errno
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from test_fork import FAST, HRP2, LIVE, TALOS, JumpingClock, recording, run_to, walked

from app.formats import write_run
from app.live.control import Control
from app.live.fork import Fork
from app.runs import restore
from app.runs.restore import Restore
from app.work import WorkUnavailableError
from app.work.awaited_jobs import AwaitedJobs
from walkcore import Parameters, Robot
from walkcore.errors import InvalidValueError
from walkcore.scenario.recording import Recording, record
from walkcore.scenario.scenario import scenario_from_mapping

SCENARIO = {
    "robot": "hrp2",
    "duration": 3.0,
    "parameters": {"control_period": 0.02, "initial_double_support_duration": 0.3},
    "events": [
        {"t": 0.0, "reference": {"vx": 0.2}},
        {"t": 0.7, "parameters": {"alpha": 3e-6}},  # later ones would not come again
        {"t": 1.0, "push": {"impulse": [0.0, 5.0]}},
    ],
}


@pytest.fixture
def restored(tmp_path, monkeypatch) -> Callable[[Recording, int], Path]:
    """Restores a tick of a recording, in this process; returns the segments."""
    monkeypatch.setattr(restore, "limit_this_process", lambda _: None)

    def restored(recorded: Recording, tick: int) -> Path:
        write_run(recorded, tmp_path, ("npz",))
        Restore(tmp_path, tick, tmp_path / "segments")(lambda _: None)
        return tmp_path / "segments"

    return restored


def standing(robot: Robot, parameters: Parameters) -> Control:
    control = Control(robot, parameters, lambda _: None)
    control.start()
    run_to(control, 5)
    return control


def driven(robot: Robot, parameters: Parameters, nb_ticks: int, clock: JumpingClock | None = None) -> Recording:
    """A session that does not begin at rest."""
    control = walked(robot, parameters, nb_ticks, changed_at=30, clock=clock)
    control._walk.log._packed.popleft()
    return recording(control, robot)


CASES = {
    "scenario": (HRP2, FAST, lambda: record(scenario_from_mapping(SCENARIO))),
    "session": (HRP2, FAST, lambda: driven(HRP2, FAST, 150)),
    "session that ran out of time": (HRP2, FAST, lambda: driven(HRP2, FAST, 200, JumpingClock())),
    "physics with twin": (
        TALOS,
        LIVE,
        lambda: driven(TALOS, LIVE.changed({"plant": "mujoco", "twin": True}), 70),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_the_robot_goes_on_from_a_recorded_tick_to_the_same_bytes(case, restored):
    robot, live, walk = CASES[case]
    was = walk()
    last = int(was["tick"][-1])
    for tick in (last - 3, 47):
        control = standing(robot, live)
        before = control.latest
        control.fork(Fork(tick), restored(was, tick))
        now = control.latest
        assert (now.snapshot.tick, now.driver, now.walk) == (tick, "past", before.walk + 1)
        assert now.plant == was.scenario.parameters.plant
        run_to(control, last)
        again = recording(control, robot)
        first = int(again["tick"][0] - was["tick"][0])
        assert again.columns == was.columns and again.rows.tobytes() == was.rows[first:].tobytes()
        comparison = control.latest.comparison
        assert comparison is not None and comparison.now == comparison.was
        assert recording(control, robot, before_reset=True)["tick"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_a_recording_that_is_not_what_its_scenario_leads_to_is_refused(restored):
    was = record(scenario_from_mapping(SCENARIO))
    was.rows[70, was.columns.index("jerk_x")] = np.nextafter(was.rows[70, was.columns.index("jerk_x")], 1.0)
    restored(was, 69)  # nothing is different up to here
    with pytest.raises(InvalidValueError, match=r"jerk_x.*tick 70.*no exact state"):
        restored(was, 70)


@pytest.mark.parametrize("tick", [-1, 150])
def test_a_tick_that_was_not_recorded_is_refused(restored, tick):
    with pytest.raises(InvalidValueError, match="must be between 0 and 149"):
        restored(record(scenario_from_mapping(SCENARIO)), tick)


def test_a_robot_with_another_control_period_does_not_go_on_and_walks_on(restored):
    segments = restored(record(scenario_from_mapping(SCENARIO)), 60)
    control = standing(HRP2, FAST.changed({"control_period": 0.01}))
    with pytest.raises(InvalidValueError, match="control_period"):
        control.fork(Fork(60), segments)
    run_to(control, 8)
    assert control.latest.snapshot.tick == 8


@pytest.mark.parametrize("fails", ["app.jobs.JobProcess", "tempfile.TemporaryDirectory"])
def test_a_machine_without_room_for_a_process_or_a_file_is_told_and_the_next_tick_is_restored(
    tmp_path, monkeypatch, fails
):
    def no_room(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    write_run(record(scenario_from_mapping(SCENARIO)), tmp_path, ("npz",))
    jobs = AwaitedJobs(1, "another tick of a run is being restored")
    with monkeypatch.context() as patch:
        patch.setattr(fails, no_room)
        with pytest.raises(WorkUnavailableError, match="No space left"), restore.restored(jobs, tmp_path, 60):
            pass
    with restore.restored(jobs, tmp_path, 60) as segments:
        assert segments.is_file()
    jobs.stop()
    with pytest.raises(WorkUnavailableError, match="the server stops"), restore.restored(jobs, tmp_path, 60):
        pass
