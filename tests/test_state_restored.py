"""Every state that a walk can come to can be restored, also through its mapping, and leads to the same next ticks."""

import json
from dataclasses import replace

import numpy as np
import pytest
from test_fork import recording

from app.live import session_log
from app.live.control import Control
from app.live.live_state import LiveState, ReferenceCommand
from walkcore import Command, Parameters, Push, Reference, Simulation, WalkError, load_robot
from walkcore.errors import InvalidValueError
from walkcore.mpc.plan import Status
from walkcore.scenario.recording import record
from walkcore.scenario.scenario import scenario_from_mapping
from walkcore.state import state_from_mapping

LIVE = Parameters(initial_double_support_duration=0.3, dynamic_filter=True, control_period=0.02)
WALK = Reference(vx=0.2, yaw_rate=0.1)
CHANGES = [
    {"step_duration": 0.6},
    {"step_duration": 1.0, "horizon_samples": 16},
    {"step_duration": 1.5, "horizon_samples": 16},
    {"step_duration": 0.4, "horizon_samples": 5},
    {"horizon_samples": 33, "scheme": "mean_velocity", "step_duration": 0.8},
    {"scheme": "preview_control"},
    {"scheme": "full", "stepping_in_place": True},
    {"stepping_in_place": False, "cop_margin": 0.0},
    {"swing_height": 0.2},
]
ROBOTS = {name: load_robot(name) for name in ("hrp2", "talos")}


def drive(simulation: Simulation, rng: np.random.Generator, nb_ticks: int) -> None:
    """References, pushes up to the strongest, and changes of the gait, at random."""
    limits, reference = simulation.robot.max_reference, Reference()
    for _ in range(nb_ticks):
        if rng.random() < 0.04:
            walks = rng.random() < 0.7
            reference = Reference(**{k: float(rng.uniform(*v)) for k, v in limits.items()}) if walks else Reference()
        push = None
        if rng.random() < 0.01:
            angle, strength = rng.uniform(-np.pi, np.pi), simulation.robot.max_push * rng.choice([0.05, 0.1, 1.0])
            push = Push(strength * np.array([np.cos(angle), np.sin(angle)]), float(rng.choice([0.0, 0.3])))
        if rng.random() < 0.02:
            try:
                simulation.change(simulation.parameters.changed(CHANGES[rng.integers(len(CHANGES))]))
            except WalkError:
                continue
        simulation.step(Command(reference, push))


def next_ticks(simulation: Simulation) -> list[bytes]:
    snapshots = [simulation.step(Command(WALK)) for _ in range(8)]
    return [s.com.matrix.tobytes() + (b"" if s.q is None else s.q.tobytes()) for s in snapshots]


def check_every_state(name: str, seed: int, nb_states: int) -> None:
    rng, simulation = np.random.default_rng(seed), Simulation(ROBOTS[name], LIVE)
    for _ in range(nb_states):
        drive(simulation, rng, int(rng.integers(1, 40)))
        state, parameters = simulation.state, simulation.parameters
        mapping = json.loads(json.dumps(state.to_mapping(), allow_nan=False))
        again = state_from_mapping(mapping, simulation.robot, parameters)
        assert again.to_mapping() == mapping
        other = Simulation(simulation.robot, parameters)
        other.restore(again)
        expected = next_ticks(simulation)
        assert next_ticks(other) == expected
        if state.why_fallen and rng.random() < 0.3:
            simulation.reset()
        else:
            simulation.restore(state)
            assert next_ticks(simulation) == expected


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("seed", range(3))
def test_every_state_of_a_random_walk_is_restored(name, seed):
    check_every_state(name, seed, 12)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("seed", range(12))
def test_every_state_of_a_long_random_walk_is_restored(name, seed):
    check_every_state(name, seed, 100)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_walk_is_saved_long_after_a_fall_and_again_during_the_stop(monkeypatch, name):
    monkeypatch.setattr(session_log, "KEPT", 1.0)
    control = Control(ROBOTS[name], LIVE, lambda _: None)
    control.set_reference(ReferenceCommand(WALK, "rest"))
    control.pause()
    control.step(150)
    control.set_reference(ReferenceCommand(Reference(), "rest"))
    control.step(10)  # the stop is under way
    control.push(Push([0.0, ROBOTS[name].max_push]))
    control.step(200)
    assert control.latest.snapshot.status is Status.FALLEN
    driven = recording(control, ROBOTS[name])
    assert driven["status"][0] == driven["status"][-1] == Status.FALLEN
    scenario = scenario_from_mapping(json.loads(json.dumps(driven.scenario.source, allow_nan=False)))
    assert record(scenario).rows.tobytes() == driven.rows.tobytes()


def resumed(state: LiveState) -> Control:
    """The control of another process, which goes on with the latest state of this one."""
    return Control(ROBOTS["talos"], LIVE, lambda _: None, resumed=state)


def test_a_walk_goes_on_in_another_control_as_if_nothing_had_happened():
    control = Control(ROBOTS["talos"], LIVE, lambda _: None)
    control.pause()
    control.set_reference(ReferenceCommand(WALK, "rest"))
    state = control.step(170)
    other = resumed(state)
    assert (other.latest.snapshot.tick, other.latest.running) == (170, False)
    for one in (control, other):
        one.set_reference(ReferenceCommand(WALK, "rest"))
    assert [control.step(1).snapshot.q.tobytes() for _ in range(30)] == [
        other.step(1).snapshot.q.tobytes() for _ in range(30)
    ]
    assert len(list(other.save(False))) > 0


def test_a_state_that_cannot_go_on_leaves_the_robot_at_rest(caplog):
    control = Control(ROBOTS["talos"], LIVE, lambda _: None)
    control.pause()
    state = control.step(20)
    for broken in (None, replace(state.next_state, driver=None), replace(state.next_state, model=None)):
        other = resumed(replace(state, next_state=broken))
        assert (other.latest.snapshot.tick, other.latest.snapshot.phase, other.latest.running) == (0, 0, False)
        assert other.latest.walk == state.walk + 1, "segments of the walk before would be taken for its own"
    assert "stands at rest" in caplog.text


def test_a_gait_that_has_ended_is_refused_where_the_robot_is_on_its_feet():
    simulation = Simulation(ROBOTS["hrp2"], LIVE)
    for tick in range(100):
        simulation.step(Command(WALK if tick < 60 else Reference()))
    mapping = simulation.state.to_mapping()
    mapping["gait"] |= {"nb_steps": 1, "start": 0}
    with pytest.raises(InvalidValueError, match="nb_steps"):
        state_from_mapping(mapping, simulation.robot, LIVE)
