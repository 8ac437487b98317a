import dataclasses
import json
import math

import numpy as np
import pytest

from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.errors import InvalidValueError
from walkcore.scenario.events import Event
from walkcore.scenario.scenario import scenario_from_mapping
from walkcore.state import state_from_mapping

LIVE = Parameters(initial_double_support_duration=0.3, dynamic_filter=True)


def drive(simulation, nb_ticks, seed=0):
    """The snapshots of random references, pushes and changes of parameters."""
    rng = np.random.default_rng(seed)
    reference, snapshots = Reference(), []
    for _ in range(nb_ticks):
        if rng.random() < 0.02:
            reference = Reference(rng.uniform(-0.1, 0.3), rng.uniform(-0.1, 0.1), rng.uniform(-0.2, 0.2))
        push = Push(rng.uniform(-4.0, 4.0, 2), rng.uniform(0.0, 0.1)) if rng.random() < 0.01 else None
        if rng.random() < 0.01:
            values = {"alpha": float(10 ** rng.uniform(-6, -4)), "step_duration": float(rng.choice([0.6, 0.8, 1.0]))}
            simulation.change(simulation.parameters.changed(values))
        snapshots.append(simulation.step(Command(reference, push)))
    return snapshots


def test_a_state_survives_json_to_the_last_bit():
    simulation = Simulation(load_robot("talos"), LIVE)
    drive(simulation, 300)
    simulation.step(Command(push=Push([3.0, 1.0], duration=0.5)))
    mapping = simulation.state.to_mapping()
    assert mapping["pushes"][-1]["ticks_left"] == 99
    again = state_from_mapping(json.loads(json.dumps(mapping)), simulation.robot, simulation.parameters)
    assert again.to_mapping() == mapping


def test_restoring_takes_back_what_has_happened_since():
    simulation = Simulation(load_robot("hrp2"))
    drive(simulation, 250)
    state = simulation.state
    parameters = simulation.parameters
    first = [s.com.position.tolist() for s in drive(simulation, 100, seed=2)]
    simulation.change(parameters)
    simulation.restore(state)
    assert [s.com.position.tolist() for s in drive(simulation, 100, seed=2)] == first


def test_a_fall_is_remembered():
    simulation = Simulation(load_robot("hrp2"))
    for _ in range(300):
        fallen = simulation.step(Command(push=Push([40.0, 40.0])))
    assert fallen.reason
    other = Simulation(load_robot("hrp2"))
    other.restore(simulation.state)
    assert other.step().reason == fallen.reason


def test_every_tick_maps_to_a_time_and_back():
    for period in (0.001, 0.002, 0.005, 0.01, 0.02, 0.1):
        ticks = np.concatenate([np.arange(2000), np.random.default_rng(0).integers(0, int(3600 / period), 5000)])
        assert all(Event(float(tick * period)).tick(period) == tick for tick in ticks)


def altered(mapping, path, value):
    """A copy of nested mappings and lists with one place changed, or taken away."""
    copy = json.loads(json.dumps(mapping))
    *parents, last = path
    place = copy
    for key in parents:
        place = place[key]
    if value is KeyError:
        del place[last]
    else:
        place[last] = value
    return copy


@pytest.fixture(scope="module")
def walking():
    """The state of a robot that is on its way."""
    simulation = Simulation(load_robot("talos"), Parameters(control_period=0.05))
    for _ in range(70):
        simulation.step(Command(Reference(vx=0.1)))
    return simulation.state.to_mapping()


@pytest.mark.parametrize(
    ("path", "value", "field"),
    [
        (["tick"], -1, "tick"),
        (["tick"], 1.5, "tick"),
        (["tick"], KeyError, "tick"),
        (["surprise"], 1, "surprise"),
        (["gait"], [], "gait"),
        (["gait", "first_support"], "middle", "gait.first_support"),
        (["gait", "start"], True, "gait.start"),
        (["gait", "nb_steps"], 0, "gait.nb_steps"),
        (["gait", "nb_steps"], 1, "gait.nb_steps"),
        (["com", "velocity"], [math.nan, 0.0], "com.velocity[0]"),
        (["com", "position"], [1e9, 0.0], "com.position[0]"),
        (["com", "position"], [0.0], "com.position"),
        (["left_foot", "height"], 3.0, "left_foot.height"),
        (["left_foot", "pose"], "here", "left_foot.pose"),
        (["pushes"], {}, "pushes"),
        (["pushes"], [{"impulse_per_tick": [1e9, 0.0], "ticks_left": 1}], "pushes[0].impulse_per_tick[0]"),
        (["pushes"], [{"impulse_per_tick": [1.0, 0.0], "ticks_left": 0}], "pushes[0].ticks_left"),
        (["why_fallen"], None, "why_fallen"),
        (["q"], None, "q"),
        (["q"], [0.0] * 39, "q[3:7]"),
        (["q_before"], [0.0] * 38, "q_before"),
    ],
)
def test_a_wrong_state_is_refused_with_its_field(walking, path, value, field):
    scenario = {"robot": "talos", "duration": 1.0, "parameters": {"control_period": 0.05}}
    assert scenario_from_mapping(scenario | {"initial_state": walking}).initial_state.model.gait.start is not None
    with pytest.raises(InvalidValueError) as refused:
        scenario_from_mapping(scenario | {"initial_state": altered(walking, path, value)})
    assert refused.value.field == f"initial_state.{field}"


def test_a_point_mass_has_no_configuration_and_a_body_needs_one():
    talos, hrp2 = load_robot("talos"), load_robot("hrp2")
    embodied, point_mass = Simulation(talos), Simulation(dataclasses.replace(talos, body=None))
    with pytest.raises(InvalidValueError, match="no body"):
        state_from_mapping(embodied.state.to_mapping(), hrp2, Parameters())
    with pytest.raises(InvalidValueError, match=r"state\.q"):
        embodied.restore(point_mass.state)
    point_mass.restore(embodied.state)
    assert point_mass.step().q is None
