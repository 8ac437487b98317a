"""Contact physics behind the simulation: forces, falls, determinism, and exact restoring."""

import json
import sys

import numpy as np
import pinocchio as pin
import pytest

from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot, load_scenario, record
from walkcore.errors import InvalidValueError
from walkcore.motion.body_model import load_model
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Side
from walkcore.plant.world import World
from walkcore.scenario.scenario import scenario_from_mapping
from walkcore.state import state_from_mapping

pytest.importorskip("mujoco", reason="mujoco-core is not installed on this platform")

TALOS = load_robot("talos")
PHYSICS = Parameters(plant="mujoco", dynamic_filter=True, initial_double_support_duration=0.3)
AHEAD = Command(Reference(vx=0.3))


def walk(simulation, nb_ticks, pushes=None):
    pushes = {} if pushes is None else pushes
    return [simulation.step(Command(AHEAD.reference, pushes.get(k))) for k in range(nb_ticks)]


def numbers(snapshots):
    """Everything that physics decides, for comparisons to the bit."""
    rows = [[*s.com.matrix.ravel(), *s.q, *s.plant.dcm_error, *s.plant.contact.total, *s.torques] for s in snapshots]
    return np.array(rows)


@pytest.fixture(scope="module")
def walked():
    return walk(Simulation(TALOS, PHYSICS), 800)


def test_the_robot_walks_with_its_cop_near_the_models(walked):
    assert all(s.status is Status.SOLVED for s in walked)
    carried = [s for s in walked[200:] if s.plant.contact.cop is not None]
    assert len(carried) > 590
    errors = [np.hypot(*(s.plant.contact.cop - s.cop)) for s in carried]
    assert np.median(errors) < 0.01
    assert max(np.hypot(*s.plant.dcm_error) for s in walked) < 0.015
    assert walked[-1].plant.measured.com[0] > 0.8


def test_the_ground_carries_the_weight(walked):
    weight = TALOS.mass * PHYSICS.gravity
    carried = [sum(s.plant.contact.forces.values()) for s in walked]
    assert np.mean(carried) == pytest.approx(weight, rel=0.02)
    assert all(s.plant.contact.total[2] == pytest.approx(sum(s.plant.contact.forces.values())) for s in walked)


def test_the_foot_in_the_air_carries_nothing(walked):
    for s in walked[200:]:
        if len(s.stance.feet) == 1 and 0.2 < s.time_to_touchdown < 0.5:
            assert s.plant.contact.forces[s.support.side.other] == 0.0


def test_measured_com_and_soles_are_those_of_pinocchio_in_the_measured_configuration(walked):
    model = load_model(TALOS.body)
    data = model.createData()
    for s in walked[::200]:
        q = np.array(s.q)
        np.testing.assert_allclose(pin.centerOfMass(model, data, q), s.plant.measured.com, atol=1e-6)
        pin.framesForwardKinematics(model, data, q)
        for side in Side:
            sole = data.oMf[model.getFrameId(TALOS.body.sole(side))].translation
            np.testing.assert_allclose(sole, s.plant.measured.soles[side].position, atol=1e-6)


def test_the_same_commands_give_the_same_bytes(walked):
    assert np.array_equal(numbers(walk(Simulation(TALOS, PHYSICS), 300)), numbers(walked[:300]))


@pytest.mark.parametrize("world", [World(), World(sensors="noisy", delay=0.01)], ids=["exact", "noisy"])
def test_a_restored_walk_goes_on_to_the_same_bytes(world):
    first, second = (Simulation(TALOS, PHYSICS, world=world) for _ in range(2))
    walk(first, 250, {240: Push([0.0, 15.0], duration=0.1, link="arm_left_2_joint", point=[0.0, 0.0, 0.1])})
    state = json.loads(json.dumps(first.state.to_mapping()))
    second.restore(state_from_mapping(state, TALOS, PHYSICS))
    assert np.array_equal(numbers(walk(second, 100)), numbers(walk(first, 100)))


def test_a_push_that_is_too_strong_ends_on_the_ground_with_a_reason_in_words():
    simulation = Simulation(TALOS, PHYSICS)
    snapshots = walk(simulation, 700, {300: Push([0.0, 60.0])})
    last = snapshots[-1]
    assert last.status is Status.FALLEN
    assert last.reason.startswith("60 N s to the left ")
    assert "first the CoP had reached the edge of the soles" in last.reason
    assert last.plant.measured.com[2] < 0.4
    assert np.all(np.isfinite(numbers(snapshots)))
    simulation.reset()
    assert walk(simulation, 300)[-1].status is Status.SOLVED


def test_a_fall_under_a_push_that_is_held_is_told_by_all_of_it():
    pieces = {300 + 10 * k: Push([0.0, 10.0], duration=0.05) for k in range(20)}
    reason = walk(Simulation(TALOS, PHYSICS), 700, pieces)[-1].reason
    strength = float(reason.split()[0])
    assert strength >= 30.0
    assert "to the left" in reason


def test_a_push_acts_on_the_link_that_is_named():
    at_torso, at_arm = (Simulation(TALOS, PHYSICS) for _ in range(2))
    walk(at_torso, 40, {30: Push([0.0, 9.0])})
    walk(at_arm, 40, {30: Push([0.0, 9.0], link="arm_left_7_joint")})
    left_arm = at_arm.body.joint_names.index("arm_left_2_joint") + 7
    moved = [
        abs(s.step(AHEAD).q[left_arm] - Simulation(TALOS, PHYSICS).state.driver.q[left_arm]) for s in (at_torso, at_arm)
    ]
    assert moved[1] > 2 * moved[0]


def test_an_unknown_link_is_refused():
    simulation = Simulation(TALOS, PHYSICS)
    with pytest.raises(InvalidValueError, match="push.link"):
        simulation.step(Command(push=Push([0.0, 9.0], link="tail")))


def test_the_twin_is_the_ideal_walk_on_the_same_commands():
    pushes = {100: Push([0.0, 12.0])}
    with_twin = walk(Simulation(TALOS, PHYSICS.changed({"twin": True})), 200, pushes)
    ideal = walk(Simulation(TALOS, PHYSICS.changed({"plant": "ideal"})), 200, pushes)
    for snapshot, alone in zip(with_twin, ideal, strict=True):
        assert np.array_equal(snapshot.twin.com.matrix, alone.com.matrix)
        assert np.array_equal(snapshot.twin.q, alone.q)


def test_a_reset_puts_the_twin_back_too():
    simulation = Simulation(TALOS, PHYSICS.changed({"twin": True}))
    before = walk(simulation, 60)
    simulation.reset()
    after = walk(simulation, 60)
    assert np.array_equal(after[-1].twin.q, before[-1].twin.q)
    assert [s.twin.tick for s in after] == [s.tick for s in after]


def test_a_recording_in_physics_has_the_columns_of_the_contract():
    scenario = scenario_from_mapping(
        {"duration": 0.5, "parameters": {"plant": "mujoco", "dynamic_filter": True, "twin": True}}
    )
    recording = record(scenario)
    vectors = {"measured_com": "x y z vx vy", "ground_cop": "x y", "commanded_cop": "x y"}
    vectors |= {f"measured_{foot}": "x y z yaw" for foot in ("left", "right")}
    expected = {f"{name}_{c}" for name, components in vectors.items() for c in components.split()}
    assert expected | {"left_force", "right_force", "q_commanded_0", "twin_com_x"} <= set(recording.columns)
    metrics = recording.metrics()
    assert metrics["ground_cop_error_median"] < 0.01
    assert metrics["twin_difference"].startswith("both are up")
    assert "mujoco-core" in recording.run()["versions"]


def test_an_ideal_recording_has_none_of_them():
    recording = record(scenario_from_mapping({"robot": "hrp2", "duration": 0.1}))
    assert not any(name.startswith(("measured", "ground", "twin")) for name in recording.columns)
    assert recording.metrics()["ground_cop_error"] is None


@pytest.mark.parametrize(
    ("world", "field"),
    [
        ({"friction": 9.0}, "world.friction"),
        ({"slope": "steep"}, "world.slope"),
        ({"sensors": "perfect"}, "world.sensors"),
        ({"seed": -1}, "world.seed"),
        ({"wind": 1.0}, "world.wind"),
    ],
)
def test_a_world_beyond_its_limits_is_refused(world, field):
    with pytest.raises(InvalidValueError) as refused:
        scenario_from_mapping({"duration": 1.0, "parameters": {"plant": "mujoco"}, "world": world})
    assert refused.value.field == field


def test_a_world_needs_contact_physics_and_physics_a_body():
    with pytest.raises(InvalidValueError, match="needs parameters.plant: mujoco"):
        scenario_from_mapping({"duration": 1.0, "world": {"friction": 0.5}})
    with pytest.raises(InvalidValueError, match="needs a body"):
        scenario_from_mapping({"robot": "hrp2", "duration": 1.0, "parameters": {"plant": "mujoco"}})


def test_without_the_package_physics_is_refused_in_words(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    for module in ("mujoco_plant", "mujoco_model"):
        monkeypatch.delitem(sys.modules, f"walkcore.plant.{module}", raising=False)
    with pytest.raises(InvalidValueError, match="needs the package mujoco-core, which is not installed here"):
        Simulation(TALOS, PHYSICS)
    assert Simulation(TALOS, PHYSICS.changed({"plant": "ideal"})).step(AHEAD).status is Status.SOLVED


@pytest.mark.exhaustive
def test_nothing_blows_up_at_any_push_that_is_allowed():
    rng = np.random.default_rng(0)
    simulation = Simulation(TALOS, PHYSICS)
    for _ in range(500):
        simulation.reset()
        at, angle, strength = int(rng.integers(40, 200)), rng.uniform(0.0, 2 * np.pi), rng.uniform(0.0, 60.0)
        push = Push([strength * np.cos(angle), strength * np.sin(angle)], duration=float(rng.choice([0.0, 0.1])))
        snapshots = walk(simulation, 400, {at: push})
        assert np.all(np.isfinite(numbers(snapshots)))


@pytest.mark.exhaustive
def test_all_that_a_joystick_can_ask_for_is_walked_as_fast_as_by_the_model():
    recording = record(load_scenario("turns-and-stops").on_plant("mujoco", twin=True))
    metrics = recording.metrics()
    assert recording.reason == "" and metrics["ground_cop_error_p95"] < 0.03 and metrics["dcm_error"] < 0.015
    at = {t: round(t / 0.005) for t in (3.0, 7.0, 18.0, 21.0, 24.0, 26.0)}
    for start, end in ((3.0, 7.0), (18.0, 21.0), (24.0, 26.0)):
        robot, twin = (
            np.hypot(*(recording[f"{com}_{c}"][at[end]] - recording[f"{com}_{c}"][at[start]] for c in "xy"))
            for com in ("measured_com", "twin_com")
        )
        assert robot == pytest.approx(twin, rel=0.05)
