"""Durations of the stages of a tick, by a clock of the test."""

import numpy as np
import pytest

from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.mpc.plan import Status
from walkcore.scenario.recording import row
from walkcore.stages import Stopwatch

WALKING = Command(Reference(vx=0.2))


class Ticking:
    """A clock that is a second later at each reading."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        self.now += 1.0
        return self.now


def test_laps_share_out_the_whole_tick_and_start_anew_at_each():
    clock = Ticking()
    stopwatch = Stopwatch(clock)
    simulation = Simulation(load_robot("talos"), Parameters(dynamic_filter=True), stopwatch)
    for _ in range(3):
        before = clock.now
        simulation.step(WALKING)
        assert sum(stopwatch.laps.values()) == clock.now - before - 1.0
    assert set(stopwatch.laps) == {
        *("gait", "assemble", "solve", "check", "snapshot"),
        *("dynamic_filter", "swing_foot", "inverse_kinematics", "true_cop"),
    }


def test_a_stopwatch_changes_nothing_that_is_decided():
    timed, untimed = Simulation(load_robot("hrp2"), None, Stopwatch(Ticking())), Simulation(load_robot("hrp2"))
    for _ in range(300):
        assert str(row(timed.step(WALKING))) == str(row(untimed.step(WALKING)))


@pytest.mark.parametrize("robot", ["hrp2", "talos"])
def test_a_preview_is_what_the_next_tick_would_be_and_leaves_no_trace(robot):
    pushed = Command(WALKING.reference, Push([0.0, 12.0]))
    one, other = (Simulation(load_robot(robot)) for _ in range(2))
    for tick in range(340):
        if tick % 9 == 0:
            one.preview(pushed)
        one.step(WALKING)
        other.step(WALKING)
    preview, untouched, true = one.preview(pushed), one.preview(WALKING), other.step(pushed)
    assert preview.plan is not None and true.plan is not None and untouched.plan is not None
    np.testing.assert_array_equal(preview.push, true.push)
    for seen, come in zip(preview.plan.footholds, true.plan.footholds, strict=True):
        np.testing.assert_array_equal(seen.position, come.position)
    assert abs(preview.plan.footholds[0].position - untouched.plan.footholds[0].position).max() > 0.01


def test_a_preview_tells_whether_steps_can_catch_the_robot_and_lets_it_walk_on():
    simulation = Simulation(load_robot("hrp2"))
    for _ in range(300):
        simulation.step(WALKING)
    hopeless, harmless = (simulation.preview(Command(push=Push([0.0, strength]))).plan for strength in (400.0, 1.0))
    assert hopeless is not None and not hopeless.is_capturable
    assert harmless is not None and harmless.is_capturable
    assert simulation.step(WALKING).status is Status.SOLVED
