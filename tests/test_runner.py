"""The control process, as the server sees it."""

import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import psutil
import pytest
from conftest import PATIENCE, wait_for

from app.live import link as link_module
from app.live.control import Control, NotPausedError
from app.live.messages import NoResponseError, PartKind, has_sent
from app.live.runner import Runner
from app.live.session_log import Session
from walkcore import Parameters, Push, Reference, WalkError, load_robot
from walkcore.errors import InvalidValueError, UnknownNameError


@pytest.fixture(scope="module")
def process() -> Iterator[Runner]:
    runner = Runner(load_robot("hrp2"), Parameters())
    assert runner.latest.snapshot.tick == 0 and runner.latest.driver == "none"
    runner.start()
    yield runner
    runner.stop()


@pytest.fixture
def runner(process) -> Runner:
    """One that stands at its start and runs."""
    process.set_speed(1.0)
    process.push_at_random(0.0, 1.0)
    process.reset()
    process.resume().result(PATIENCE)
    return process


def test_reset_and_step_return_the_state_that_they_lead_to(runner):
    with pytest.raises(NotPausedError):
        runner.step(1).result(PATIENCE)
    runner.pause()
    assert runner.reset().result(PATIENCE).snapshot.tick == 0
    assert runner.step(7).result(PATIENCE).snapshot.tick == 7
    assert runner.step_samples(2).result(PATIENCE).snapshot.tick == 40
    assert runner.latest.snapshot.tick == 40


def test_request_that_nobody_waits_for_any_more_is_harmless(runner):
    requests = [runner.pause(), runner.step(1), runner.resume()]
    for request in requests:
        request.cancel()
    tick = runner.latest.snapshot.tick
    wait_for(lambda: runner.latest.running and runner.latest.snapshot.tick > tick + 5)


def test_the_active_driver_is_known_until_its_reference_expires(runner):
    runner.drive(Reference(vx=0.1), "joystick", expires_after=PATIENCE, client="me")
    assert runner.active_driver == ("joystick", "me")
    wait_for(lambda: (runner.latest.driver, runner.latest.driver_client) == ("joystick", "me"))
    runner.drive(Reference(vx=0.1), "joystick", expires_after=0.3, client="me")
    wait_for(lambda: runner.latest.driver == "none")
    assert runner.latest.snapshot.reference.is_zero and runner.active_driver == ("none", "")
    runner.drive(Reference(vx=0.1), "sliders")
    wait_for(lambda: runner.latest.driver == "sliders")
    runner.reset().result(PATIENCE)
    assert runner.active_driver == ("none", "")


def test_push_begins_once(runner):
    runner.pause().result(PATIENCE)
    runner.push(Push([0.0, 5.0]))
    assert [runner.step(1).result(PATIENCE).snapshot.push[1] for _ in range(2)] == [5.0, 0.0]


def test_commands_from_before_a_reset_do_not_come_after_it(runner):
    runner.pause().result(PATIENCE)
    runner.push(Push([0.0, 5.0]))
    runner.drive(Reference(vx=0.1), "rest")
    runner.reset().result(PATIENCE)
    state = runner.step(1).result(PATIENCE)
    assert state.driver == "none" and not state.snapshot.push.any()


@pytest.mark.parametrize("beyond", [Reference(vx=99.0), Push([1e4, 0.0])])
def test_commands_beyond_the_limits_do_not_get_in(runner, beyond):
    with pytest.raises(WalkError):
        runner.drive(beyond, "rest") if isinstance(beyond, Reference) else runner.push(beyond)
    time.sleep(0.05)
    assert runner.latest.driver == "none" and runner.latest.snapshot.status == 0


@pytest.mark.parametrize(
    "ask",
    [
        lambda runner: runner.set_speed(5.0),
        lambda runner: runner.set_speed(float("nan")),
        lambda runner: runner.push_at_random(1e4, 1.0),
        lambda runner: runner.push_at_random(1.0, 0.0),
        lambda runner: runner.preview(Push([1e4, 0.0])),
    ],
)
def test_requests_beyond_their_limits_are_refused_at_once(runner, ask):
    with pytest.raises(InvalidValueError):
        ask(runner)


def test_a_refusal_comes_back_as_it_was_raised(runner):
    with pytest.raises(InvalidValueError) as refusal:
        runner.change({"cop_margin": 99.0}).result(PATIENCE)
    assert (refusal.value.field, refusal.value.value) == ("cop_margin", 99.0) and "0.2" in refusal.value.limit
    assert runner.parameters is runner.defaults
    runner.change({"cop_margin": 0.02}).result(PATIENCE)
    assert runner.parameters.cop_margin == 0.02
    runner.change({"cop_margin": runner.defaults.cop_margin}).result(PATIENCE)


@pytest.mark.parametrize(
    "error", [InvalidValueError("a.b", 3, "must be less"), UnknownNameError("robot", "asimo", ["b", "a"])]
)
def test_errors_of_the_core_cross_processes(error):
    copy = pickle.loads(pickle.dumps(error))
    assert str(copy) == str(error) and vars(copy) == vars(error)


def test_a_robot_that_cannot_stand_fails_every_request():
    runner = Runner(load_robot("talos"), Parameters(com_height=1.9))
    with pytest.raises(WalkError):
        runner.wait()
    with pytest.raises(WalkError):
        _ = runner.latest
    with pytest.raises((NoResponseError, WalkError)):
        runner.pause().result(PATIENCE)
    runner.stop()


@pytest.fixture
def mortal() -> Iterator[Runner]:
    runner = Runner(load_robot("hrp2"), Parameters())
    runner.start()
    wait_for(lambda: runner.latest.snapshot.tick > 5)
    yield runner
    runner.stop()


def kill_and_wait(mortal: Runner) -> None:
    """Kill the control process, and wait until another one is in its place."""
    os.kill(mortal.process_id, signal.SIGKILL)
    wait_for(lambda: mortal.trouble != "")
    wait_for(lambda: mortal.trouble == "")


def test_a_killed_control_process_is_reported_refuses_and_starts_again_where_it_was(mortal):
    mortal.change({"cop_margin": 0.02}).result(PATIENCE)
    mortal.drive(Reference(vx=0.1), "rest")
    mortal.set_speed(2.0).result(PATIENCE)
    wait_for(lambda: mortal.latest.snapshot.com.position[0] > 0.1)
    killed = mortal.process_id
    os.kill(killed, signal.SIGKILL)
    wait_for(lambda: mortal.trouble != "")
    wait_for(lambda: "SIGKILL" in mortal.latest.fault)
    before = mortal.latest
    assert not before.running
    for command in (
        lambda: mortal.pause().result(PATIENCE),
        lambda: mortal.push(Push([0.0, 1.0])),
        lambda: mortal.drive(Reference(vx=0.1), "rest"),
    ):
        with pytest.raises(NoResponseError):
            command()
    for begin_anew in (mortal.reset, lambda: mortal.choose_plant("ideal"), lambda: mortal.begin({}, {})):
        with pytest.raises(NoResponseError):
            begin_anew().result(PATIENCE)
        assert mortal.active_driver == ("rest", ""), "what was refused has dropped the reference"
    wait_for(lambda: mortal.trouble == "")
    state = mortal.latest
    assert mortal.process_id != killed and state.fault == "" and state.running and state.speed == 2.0
    assert before.snapshot.tick <= state.snapshot.tick
    assert abs(state.snapshot.com.position[0] - before.snapshot.com.position[0]) < 0.5
    wait_for(lambda: mortal.latest.snapshot.tick > state.snapshot.tick + 5)
    assert mortal.latest.driver == "rest" and mortal.latest.snapshot.reference.vx == 0.1
    assert mortal.parameters.cop_margin == 0.02
    assert mortal.change({"beta": 2.0}).result(PATIENCE).cop_margin == 0.02


def test_the_parameters_in_force_are_known_though_nobody_waits_for_the_response(mortal):
    mortal.pause().result(PATIENCE)
    mortal.begin({"alpha": 1e-5}, {}).cancel()
    wait_for(lambda: mortal.parameters.alpha == 1e-5)
    os.kill(mortal.process_id, signal.SIGKILL)
    wait_for(lambda: mortal.trouble != "")
    wait_for(lambda: mortal.trouble == "")
    assert mortal.parameters.alpha == 1e-5 and mortal.parameters is mortal.parameters


def test_a_paused_robot_is_paused_at_the_same_tick_after_its_process_was_killed(mortal):
    tick = mortal.pause().result(PATIENCE).snapshot.tick
    kill_and_wait(mortal)
    assert (mortal.latest.snapshot.tick, mortal.latest.running) == (tick, False)
    assert mortal.step(1).result(PATIENCE).snapshot.tick == tick + 1


def test_a_control_process_that_is_killed_again_and_again_comes_back_at_rest(mortal):
    wait_for(lambda: mortal.latest.snapshot.tick > 50)
    mortal.set_speed(0.5).result(PATIENCE)
    mortal.pause().result(PATIENCE)
    for _ in range(2):
        kill_and_wait(mortal)
    state = mortal.latest
    assert (state.snapshot.tick, state.running, state.speed) == (0, False, 0.5)
    assert mortal.step(1).result(PATIENCE).snapshot.tick == 1


def test_requests_to_a_control_process_that_was_stopped_end_and_another_takes_over(mortal):
    stopped = mortal.process_id
    tick = mortal.latest.snapshot.tick
    os.kill(stopped, signal.SIGSTOP)
    requests, saved = [mortal.pause(), mortal.change({"beta": 2.0})], mortal.save()
    for request in requests:
        with pytest.raises(NoResponseError):
            request.result(PATIENCE)
    with pytest.raises(NoResponseError):
        next(saved)
    wait_for(lambda: mortal.trouble == "" and mortal.process_id != stopped)
    assert not psutil.pid_exists(stopped)
    assert mortal.latest.snapshot.tick >= tick
    mortal.resume().result(PATIENCE)


def test_no_message_ends_the_process_or_a_thread_or_the_walk(mortal):
    link = mortal._supervisor.link
    process, tick = mortal.process_id, mortal.latest.snapshot.tick
    for garbage in (b"x", b"\x80", pickle.dumps(None), pickle.dumps((1, 2)), b"y" * 100_000):
        assert has_sent(link._socket, garbage)
    link._deliver(10**9, PartKind.VALUE, "nobody's")
    with pytest.raises(NoResponseError):
        link.request(Control.change, {"a": "x" * 200_000}).result(PATIENCE)
    for arguments in (({"a": "x" * 100_000},), (), ([],), (1, 2, 3)):
        with pytest.raises((NoResponseError, WalkError)):
            link.request(Control.change, *arguments).result(PATIENCE)
    assert mortal.pause().result(PATIENCE).fault == ""
    mortal.resume().result(PATIENCE)
    wait_for(lambda: mortal.latest.snapshot.tick > tick + 5)
    assert mortal.process_id == process


def test_requests_beyond_their_number_are_refused_and_the_others_are_done(mortal):
    os.kill(mortal.process_id, signal.SIGSTOP)
    requests = [mortal.pause() for _ in range(500)]
    os.kill(mortal.process_id, signal.SIGCONT)
    errors = [request.exception(PATIENCE) for request in requests]
    assert errors[0] is None and any("busy" in str(error) for error in errors)
    assert mortal.pause().result(PATIENCE).running is False


def test_a_control_process_that_hangs_is_reported(mortal):
    os.kill(mortal.process_id, signal.SIGSTOP)
    wait_for(lambda: "silent" in mortal.latest.fault)
    os.kill(mortal.process_id, signal.SIGCONT)
    wait_for(lambda: mortal.latest.fault == "")


def test_a_paused_robot_is_not_silent(mortal):
    mortal.pause().result(PATIENCE)
    time.sleep(2.3)
    assert mortal.latest.fault == ""


SERVER = """
import time
from app.live.runner import Runner
from walkcore import Parameters, load_robot
runner = Runner(load_robot("hrp2"), Parameters())
runner.start()
print(runner.process_id, runner.latest.snapshot.tick, flush=True)
time.sleep(600)
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_the_control_process_ends_with_its_server_however_that_ends(how):
    server = subprocess.Popen([sys.executable, "-c", SERVER], stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    control = psutil.Process(int(server.stdout.readline().split()[0]))
    server.send_signal(how)
    server.wait(PATIENCE)
    assert psutil.wait_procs([control], timeout=PATIENCE)[1] == []


def test_the_control_process_imports_nothing_of_the_web():
    program = "import app.live.process, sys; print(*{name.split('.')[0] for name in sys.modules})"
    loaded = set(subprocess.run([sys.executable, "-c", program], capture_output=True, text=True).stdout.split())
    assert "walkcore" in loaded and loaded & {"fastapi", "uvicorn", "viser", "pydantic", "starlette"} == set()


def test_a_saved_session_crosses_processes_in_chunks(runner):
    runner.pause().result(PATIENCE)
    runner.reset().result(PATIENCE)
    runner.drive(Reference(vx=0.2), "rest")
    runner.step(500).result(PATIENCE)
    session = Session.unpacked(list(runner.save()))
    assert len(session.segments) == 51
    rows = session.recording("walked", runner.robot)
    assert rows["tick"].tolist() == list(range(501)) and rows["reference_vx"][-1] == 0.2


def test_a_request_that_waited_for_too_long_is_answered_and_not_carried_out(runner, monkeypatch):
    monkeypatch.setattr(link_module, "EXPIRY", -1.0)
    with pytest.raises(NoResponseError, match="no time"):
        runner.pause().result(PATIENCE)
    assert runner.latest.running
