"""Rules of a booth: phones drive in turn within bounds, and the robot looks after itself while nobody drives."""

import math
from collections.abc import Iterator
from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any

import pytest

from app.live.booth import ATTRACT_AFTER, ATTRACT_PUSH_SHARE, FAR, PUSH_PERIOD, PUSH_SHARE, ROUND, STAND_UP_AFTER, Booth
from app.live.driver_lease import DriverLease, LeaseHeldError
from app.live.driver_queue import (
    ABSENCE_TIMEOUT,
    IDLE_TIMEOUT,
    LEASE,
    MAX_WAITING,
    RECONNECT_TIMEOUT,
    TURN,
    DriverQueue,
    NotYourTurnError,
    QueueFullError,
)
from walkcore import Reference, load_robot
from walkcore.mpc.plan import Status


@pytest.fixture
def lease(clock) -> DriverLease:
    return DriverLease(clock)


@pytest.fixture
def queue(lease, clock) -> DriverQueue:
    return DriverQueue(lease, clock)


def passes(time: float, clock, queue: DriverQueue, commanding: str = "") -> None:
    """Let time pass in small steps, in which one visitor may command."""
    for _ in range(round(time / 0.5)):
        clock.now += 0.5
        queue.update()
        if commanding and queue.driver == commanding:
            queue.check(commanding)


def test_a_turn_ends_where_others_wait_and_goes_on_where_nobody_does(queue, clock):
    queue.join("a")
    passes(1.5 * TURN, clock, queue, "a")
    assert queue.driver == "a" and queue.time_left == pytest.approx(0.5 * TURN)
    queue.join("b")
    assert (queue.place("a"), queue.place("b"), queue.nb_waiting) == (0, 1, 1)
    passes(0.5 * TURN, clock, queue, "a")
    assert queue.driver == "b" and queue.time_left == TURN
    assert queue.place("a") is None
    queue.join("a")
    assert queue.place("a") == 1


def test_only_the_one_whose_turn_it_is_commands_and_holds_the_lease(queue, lease):
    queue.update()
    assert lease.holder == ""
    queue.join("a")
    queue.join("b")
    queue.update()
    queue.check("a")
    for name in ("b", "c", ""):
        with pytest.raises(NotYourTurnError):
            queue.check(name)
    with pytest.raises(LeaseHeldError):
        lease.check("a browser")
    queue.clear()
    lease.check("a browser")
    with pytest.raises(NotYourTurnError):
        queue.check("a")


def test_a_browser_that_drives_alone_keeps_visitors_waiting_and_keeps_its_lease(queue, lease):
    lease.give("a browser", "a browser")
    queue.join("a")
    with pytest.raises(LeaseHeldError):
        queue.update()
    with pytest.raises(LeaseHeldError):
        queue.check("a")
    lease.end("a browser")
    queue.update()
    queue.check("a")
    assert lease.holder == LEASE


def test_an_idle_driver_makes_room_for_one_that_waits_and_leaves_in_the_end(queue, clock):
    queue.join("a")
    passes(IDLE_TIMEOUT + 5.0, clock, queue)
    assert queue.driver == "a"
    queue.join("b")
    passes(1.0, clock, queue)
    assert queue.driver == "b"
    passes(ABSENCE_TIMEOUT - 1.0, clock, queue)
    assert queue.driver == "b"
    passes(2.0, clock, queue)
    assert queue.driver == "" and queue.time_left == 0.0


def test_a_lost_connection_costs_the_place_only_where_it_lasts(queue, clock):
    queue.join("a")
    queue.join("b")
    queue.disconnect("a")
    passes(RECONNECT_TIMEOUT - 1.0, clock, queue)
    assert queue.join("a") == 1 and queue.driver == "a"
    queue.disconnect("a")
    passes(RECONNECT_TIMEOUT + 1.0, clock, queue)
    assert queue.driver == "b" and queue.place("a") is None
    assert queue.time_left >= TURN - 2.0  # a whole turn, and not what the other one left


def test_the_line_is_short(queue):
    for name in range(MAX_WAITING + 1):
        queue.join(str(name))
    with pytest.raises(QueueFullError):
        queue.join("late")
    assert queue.join("3") == 4  # who is in line already keeps its place
    assert queue.nb_waiting == MAX_WAITING


class FakeRunner:
    """Notes what it is told, and stands in a state that a test sets."""

    def __init__(self) -> None:
        self.robot = load_robot("hrp2")
        self.told: list[Any] = []
        snapshot = SimpleNamespace(
            status=Status.SOLVED, reference=Reference(), com=SimpleNamespace(position=(0.0, 0.0))
        )
        self.latest = SimpleNamespace(snapshot=snapshot, driver="none", running=True, fault="")

    def drive(self, reference, driver, expires_after, client="") -> None:
        self.robot.check_reference(reference)
        self.told.append((driver, reference))

    def push(self, push) -> None:
        self.told.append(self.robot.check_push(push))

    def reset(self) -> Future:
        self.told.append("reset")
        return Future()

    def resume(self) -> Future:
        self.told.append("resume")
        return Future()

    def taken(self) -> list[Any]:
        """Messages that have come since the last call."""
        told, self.told = self.told, []
        return told


@pytest.fixture
def runner() -> FakeRunner:
    return FakeRunner()


@pytest.fixture
def booth(runner, lease, clock) -> Iterator[Booth]:
    booth = Booth(lambda: runner, lease, clock)
    with booth.screen():
        yield booth


def lives(time: float, clock, booth: Booth) -> None:
    for _ in range(round(time / 0.2)):
        clock.now += 0.2
        booth.step()


def test_it_walks_by_itself_until_somebody_drives_and_again_a_minute_later(booth, runner, clock):
    lives(1.0, clock, booth)
    assert booth.is_attracting and {driver for driver, _ in runner.taken()} == {"booth"}
    booth.queue.join("a")
    lives(1.0, clock, booth)
    assert not booth.is_attracting and runner.taken() == []
    with pytest.raises(NotYourTurnError):
        booth.steer("b", 1.0, 0.0, 0.0)
    booth.steer("a", 1.0, -1.0, 0.0)
    ((driver, reference),) = runner.taken()
    limits = runner.robot.max_reference
    assert driver == "phone" and (reference.vx, reference.vy) == (limits["vx"][1], limits["vy"][0])
    lives(ABSENCE_TIMEOUT + 0.9 * ATTRACT_AFTER, clock, booth)
    assert booth.queue.driver == "" and runner.taken() == []
    lives(0.2 * ATTRACT_AFTER, clock, booth)
    assert booth.is_attracting and runner.taken()


def test_it_leaves_the_robot_to_whoever_drives_at_a_page_or_has_the_lease(booth, runner, lease, clock):
    lives(1.0, clock, booth)
    runner.latest.driver, runner.latest.snapshot.reference = "keyboard", Reference(vx=0.1)
    runner.taken()
    lives(2.0 * ATTRACT_AFTER, clock, booth)
    assert runner.taken() == []
    runner.latest.driver, runner.latest.snapshot.reference = "rest", Reference()  # a program's stop holds forever
    lives(ATTRACT_AFTER + 1.0, clock, booth)
    assert runner.taken()
    lease.give("a", "a")
    lives(1.0, clock, booth)
    assert not booth.is_attracting and booth.problem == ""
    booth.queue.join("b")
    lives(1.0, clock, booth)
    assert "drives alone" in booth.problem and not booth.is_attracting


def test_a_round_shows_all_directions_and_pushes_within_the_bounds_of_visitors(booth, runner, clock):
    lives(sum(stretch.duration for stretch in ROUND) + 3.0, clock, booth)
    told = runner.taken()
    references = [entry[1] for entry in told if isinstance(entry, tuple)]
    pushes = [entry for entry in told if not isinstance(entry, tuple)]
    assert ATTRACT_PUSH_SHARE <= PUSH_SHARE
    assert len(pushes) == sum(stretch.push is not None for stretch in ROUND) == 2
    assert all(math.hypot(*p.impulse) == pytest.approx(ATTRACT_PUSH_SHARE * runner.robot.max_push) for p in pushes)
    assert max(r.vx for r in references) > 0.0 and {math.copysign(1, r.vy) for r in references if r.vy} == {1, -1}
    assert references[-1] == Reference()  # at rest, where the next round begins
    assert "reset" not in told


def test_pushes_of_visitors_are_bounded_in_strength_and_number(booth, runner, clock):
    booth.queue.join("a")
    for _ in range(3):
        booth.push("a", 0.5 * math.pi)
    (push,) = runner.taken()
    assert push.impulse == pytest.approx([0.0, PUSH_SHARE * runner.robot.max_push])
    clock.now += PUSH_PERIOD
    booth.push("a", 0.0)
    assert len(runner.taken()) == 1
    with pytest.raises(NotYourTurnError):
        booth.push("b", 0.0)


@pytest.mark.parametrize("trouble", ["fallen", "fault"])
def test_a_robot_that_lies_or_has_a_fault_stands_up_after_a_moment(booth, runner, clock, trouble):
    booth.queue.join("a")
    if trouble == "fallen":
        runner.latest.snapshot.status = Status.FALLEN
    else:
        runner.latest.fault = "a bug"
    lives(STAND_UP_AFTER - 0.5, clock, booth)
    assert runner.taken() == []
    lives(0.8, clock, booth)
    assert runner.taken() == ["reset", "resume"]
    lives(STAND_UP_AFTER - 0.5, clock, booth)  # which takes a moment, too
    assert runner.taken() == []


def test_whoever_left_it_paused_does_not_end_the_booth(booth, runner, clock):
    runner.latest.running = False
    lives(1.0, clock, booth)
    assert runner.taken()[0] == "resume"


def test_a_robot_that_has_walked_far_begins_anew_between_two_rounds(booth, runner, clock):
    lives(10.0, clock, booth)
    runner.latest.snapshot.com.position = (FAR, 1.0)
    lives(5.0, clock, booth)
    assert "reset" not in runner.taken()
    lives(sum(stretch.duration for stretch in ROUND), clock, booth)
    assert runner.taken().count("reset") == 1


def test_with_the_last_screen_all_visitors_go(runner, lease, clock):
    booth = Booth(lambda: runner, lease, clock)
    with booth.screen():
        with booth.screen():
            booth.queue.join("a")
            booth.step()
        assert booth.is_open and booth.queue.driver == "a" and lease.holder == LEASE
    assert not booth.is_open and booth.queue.driver == "" and lease.holder == ""
