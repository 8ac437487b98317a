"""Changes of parameters while the robot walks: any value is accepted or refused whole, and no tick waits for them."""

import math
import os
import signal
from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import pytest
from conftest import PATIENCE, wait_for
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from app.live.control import Control
from app.live.messages import NoResponseError
from app.live.parameter_changes import MAX_WAITING, packed_sets
from app.live.runner import Runner
from walkcore import Command, Parameters, Reference, Simulation, WalkError, load_robot
from walkcore.errors import InvalidValueError
from walkcore.mpc import pattern_generator, supports
from walkcore.mpc.plan import Status
from walkcore.mpc.schemes import SCHEMES
from walkcore.parameters import LIMITS

HRP2 = load_robot("hrp2")
NAMES = [field.name for field in fields(Parameters)]


def nested(depth: int) -> list[Any]:
    value: list[Any] = []
    for _ in range(depth):
        value = [value]
    return value


SCALARS = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.sampled_from([10**400, -(10**4000), math.nan, math.inf, -math.inf, 1e308, 5e-324, -0.0])
    | st.floats()
    | st.text(st.characters(codec=None), max_size=20)
    | st.sampled_from(["\ud800", "x" * 200_000, *SCHEMES, "daqp"])
)
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner), max_leaves=8
)
KEYS = st.sampled_from(NAMES) | st.text(st.characters(codec=None), max_size=10) | st.just("k" * 100_000)
CHANGES = st.dictionaries(KEYS, VALUES, max_size=4)


@pytest.fixture(scope="module")
def runner() -> Iterator[Runner]:
    runner = Runner(HRP2, Parameters(control_period=0.01))
    runner.start()
    runner.wait()
    yield runner
    runner.stop()


def examples(test: Any) -> Any:
    """The values that were seen to stop the robot or the server."""
    found = [{"solver": []}, {"a": "x" * 163_753}, {"a": "x" * 220_000}, {"\ud800": 1}, {"scheme": "\udfff"}]
    found += [{"alpha": nested(990)}, {"k": nested(990)}, {"horizon_samples": 10**5000}, {"solver": {}}, {"beta": True}]
    for values in found:
        test = example(values)(test)
    return test


@examples
@settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow])
@given(CHANGES)
def test_any_change_is_made_whole_or_refused_with_its_field(values):
    before = Parameters()
    try:
        after = before.check_change(before.changed(values))
    except InvalidValueError as refusal:
        assert isinstance(refusal.field, str) and refusal.limit
        assert len(str(refusal)) < 2000
        return
    for name, value in values.items():
        assert getattr(after, name) == value or SCHEMES[getattr(after, name)] is SCHEMES["mean_velocity"]
    for name, (low, high) in LIMITS.items():
        assert low <= getattr(after, name) <= high


@pytest.mark.parametrize(
    "values", [{"solver": []}, {"a": "x" * 163_753}, {"a": "x" * 220_000}, {"alpha": nested(990)}, {"cop_margin": 0.15}]
)
def test_a_refused_change_leaves_the_robot_and_its_parameters_as_they_are(runner, values):
    before, tick = runner.parameters, runner.latest.snapshot.tick
    with pytest.raises(WalkError):
        runner.change(values).result(PATIENCE)
    assert runner.parameters is before
    wait_for(lambda: runner.latest.snapshot.tick > tick + 5)
    assert runner.latest.running and runner.latest.fault == ""


def test_a_change_that_changes_nothing_is_answered_at_once_with_the_same_parameters(runner):
    before = runner.parameters
    assert runner.change({}).result(PATIENCE) is before
    assert runner.change({"alpha": before.alpha}).result(PATIENCE) is before


def test_changes_that_come_together_all_hold_and_the_latest_of_each_wins(runner):
    requests = [runner.change({"alpha": 1e-6 * (1 + i), "beta": 2.0 if i == 3 else 1.0}) for i in range(20)]
    assert all(isinstance(request.result(PATIENCE), Parameters) for request in requests)
    assert runner.parameters.alpha == pytest.approx(2e-5)
    requests = [runner.change({"cop_margin": margin}) for margin in (0.02, 0.15, 0.025)]
    refused = [request.exception(PATIENCE) for request in requests]
    assert refused[0] is None and isinstance(refused[1], WalkError) and refused[2] is None
    assert runner.parameters.cop_margin == 0.025


def test_more_changes_than_may_wait_are_refused_and_the_others_are_made(runner):
    requests = [runner.change({"alpha": 1e-6 * (1 + i % 7)}) for i in range(5 * MAX_WAITING)]
    failures = [request.exception(PATIENCE) for request in requests]
    assert any(failure is None for failure in failures)
    assert all(failure is None or isinstance(failure, NoResponseError) for failure in failures)
    assert runner.change({"alpha": 1e-6}).result(PATIENCE).alpha == 1e-6


def test_a_change_that_nobody_waits_for_any_more_is_not_made(runner):
    os.kill(runner.process_id, signal.SIGSTOP)
    first, dropped = runner.change({"beta": 3.0}), None
    wait_for(first.running)
    dropped = runner.change({"gamma": 1e-5})
    assert dropped.cancel()
    os.kill(runner.process_id, signal.SIGCONT)
    assert first.result(PATIENCE).beta == 3.0
    assert runner.change({"beta": 1.0}).result(PATIENCE).gamma == runner.defaults.gamma


@pytest.mark.parametrize("step_timing", ["fixed", "adaptive"])
def test_the_control_loop_computes_nothing_of_a_prepared_change(step_timing, monkeypatch):
    control = Control(HRP2, Parameters(step_timing=step_timing), lambda _: None)
    parameters = control.parameters.changed({"step_duration": 1.0, "cop_margin": 0.02})
    sets = packed_sets(HRP2, parameters)

    def fail(*_: object) -> None:
        raise AssertionError("computed in the control loop")

    monkeypatch.setattr(pattern_generator, "balance_sets", fail)
    monkeypatch.setattr(supports, "capture_sets", fail)
    assert control.change(parameters.to_mapping(), sets) == parameters
    with pytest.raises(AssertionError):
        control.change({"step_duration": 0.8})


def test_a_prepared_change_walks_as_one_that_was_not():
    parameters = Parameters().changed({"step_duration": 1.0})
    walks = []
    for sets in (b"", packed_sets(HRP2, parameters)):
        control = Control(HRP2, Parameters(), lambda _: None)
        control.change({"step_duration": 1.0}, sets)
        control.pause()
        walks.append(control.step(50).snapshot.com.matrix.tobytes())
    assert walks[0] == walks[1]


@pytest.mark.parametrize("scheme", ["full", "dcm_tracker"])
@pytest.mark.parametrize("ticks", range(0, 40, 5))
def test_the_step_under_way_is_seen_to_its_end_though_the_horizon_gets_shorter(scheme, ticks):
    simulation = Simulation(HRP2, Parameters(scheme=scheme, control_period=0.02, initial_double_support_duration=0.1))
    for _ in range(60 + ticks):
        simulation.step(Command(Reference(vx=0.1)))
    touchdown = simulation.step(Command(Reference(vx=0.1))).time_to_touchdown
    simulation.change(simulation.parameters.changed({"step_duration": 0.4, "horizon_samples": 5}))
    snapshots = [simulation.step(Command(Reference(vx=0.1))) for _ in range(100)]
    assert snapshots[0].time_to_touchdown == pytest.approx(touchdown - 0.02 or 0.4)
    assert all(s.status is not Status.FALLEN and s.plan.footholds for s in snapshots)
    assert len(snapshots[-1].plan.times) == 5
