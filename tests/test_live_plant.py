"""The live walk with contact physics: the choice of the plant, changes of plant, twin and world, and what is kept."""

import sys

import numpy as np
import pytest
from conftest import Clock, serving
from test_fork import recording

from app.http.live_json import live_json
from app.live.control import Control
from app.live.live_state import LiveState, ReferenceCommand
from app.live.parameter_changes import packed_sets
from app.live.plant_choice import suitable_plant
from walkcore import Parameters, Push, Reference, load_robot, record
from walkcore.errors import InvalidValueError
from walkcore.mpc.plan import Status
from walkcore.plant.world import PERFECT

pytest.importorskip("mujoco", reason="mujoco-core is not installed on this platform")

TALOS = load_robot("talos")
LIVE = Parameters(initial_double_support_duration=0.3, dynamic_filter=True)


class SlowClock(Clock):
    """A clock on which time passes with every look at it [s]."""

    def __init__(self, step: float) -> None:
        super().__init__()
        self.step = step

    def __call__(self) -> float:
        self.now += self.step
        return self.now


@pytest.fixture
def control(clock) -> Control:
    shown: list[LiveState] = []
    control = Control(TALOS, LIVE, shown.append, clock)
    control.start()
    control.pause()
    control.begin({"plant": "mujoco"}, {})
    return control


def test_a_machine_that_keeps_up_begins_with_physics_and_another_with_the_ideal_model():
    parameters, reason = suitable_plant(TALOS, LIVE, "auto", SlowClock(0.002))
    assert parameters.plant == "mujoco" and reason.startswith("contact physics: a tick takes 2.0 of 5 ms")
    parameters, reason = suitable_plant(TALOS, LIVE, "auto", SlowClock(0.004))
    assert parameters.plant == "ideal" and "a tick would take 4.0 of 5 ms" in reason


def test_without_the_package_or_a_body_the_walk_begins_with_the_ideal_model_and_says_why(monkeypatch):
    parameters, reason = suitable_plant(load_robot("hrp2"), Parameters(), "mujoco")
    assert parameters.plant == "ideal" and "point mass" in reason
    monkeypatch.setitem(sys.modules, "walkcore.plant.mujoco_plant", None)
    parameters, reason = suitable_plant(TALOS, LIVE, "mujoco")
    assert parameters.plant == "ideal" and "mujoco-core" in reason


def test_another_plant_resets_the_walk_and_a_refused_one_changes_nothing(control):
    control.step(30)
    assert control.latest.plant == "mujoco" and live_json(control.latest)["ground_cop_x"] is not None
    for values, world in [({"plant": "moon"}, {}), ({}, {"friction": 9.0}), ({"plant": "ideal"}, {"slope": 0.05})]:
        with pytest.raises(InvalidValueError):
            control.begin(values, world)
    assert control.latest.snapshot.tick == 30 and control.latest.world == PERFECT
    control.begin({}, {"slope": 0.05})
    assert control.latest.snapshot.tick == 0 and control.latest.world.slope == 0.05
    control.begin({"plant": "ideal"}, {})
    assert control.latest.snapshot.plant is None and control.latest.world == PERFECT
    assert "ground_cop_x" not in live_json(control.latest)


def test_a_twin_comes_and_goes_during_the_walk_and_the_difference_is_told(control):
    assert control.latest.twin_difference == ""
    control.step(10)
    control.change({"twin": True})
    state = control.step(10)
    assert state.snapshot.tick == 20 and state.twin_difference == "both are up, 0 cm from each other"
    assert live_json(state)["twin_com_x"] == pytest.approx(state.snapshot.twin.com.position[0])
    control.push(Push([0.0, 58.0]))
    state = control.step(400)
    assert state.snapshot.status is Status.FALLEN and "fell" in state.twin_difference
    control.change({"twin": False})
    assert control.step(1).twin_difference == ""


def test_no_tick_waits_for_a_twin_to_be_built(control, monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("computed between two ticks")

    parameters = control.parameters.changed({"twin": True, "cop_margin": 0.025})
    sets = packed_sets(TALOS, parameters)
    control.step(10)
    monkeypatch.setattr("walkcore.simulation.WholeBody", refuse)
    monkeypatch.setattr("walkcore.mpc.pattern_generator.balance_sets", refuse)
    for values in ({"twin": True, "cop_margin": 0.025}, {"twin": False}, {"twin": True}):
        control.change(values, sets)
        state = control.step(5)
        assert (state.snapshot.twin is not None) is values["twin"]
        assert state.twin_difference == ("both are up, 0 cm from each other" if values["twin"] else "")


def test_a_walk_in_a_world_with_a_twin_that_came_later_is_saved_and_replayed_to_the_same_bytes(control):
    control.begin({}, {"friction": 0.6, "strip_height": 0.01})
    control.set_reference(ReferenceCommand(Reference(0.2), "rest"))
    control.step(40)
    control.change({"twin": True})
    control.push(Push([0.0, 6.0], 0.05, "world", "arm_left_5_joint", [0.0, 0.0, -0.1]))
    control.step(40)
    saved = recording(control, TALOS)
    replayed = record(saved.scenario)
    assert saved.columns == replayed.columns and "twin_com_x" in saved.columns
    np.testing.assert_array_equal(saved.rows, replayed.rows)


def test_plant_world_and_pushed_link_by_rest():
    with serving("--scene", "light", "--plant", "mujoco") as server, server.client() as client:
        live = client.get("live").json()
        assert live["plant"] == "mujoco" and live["plant_reason"] == "contact physics, as chosen"
        assert len(live["q_commanded"]) == len(live["q"]) and live["world"]["friction"] == 0.8
        assert client.patch("live/world", json={"payload": 5.0}).json()["payload"] == 5.0
        refused = client.patch("live/world", json={"friction": 0.0})
        assert refused.status_code == 422 and refused.json()["errors"][0]["field"] == "friction"
        assert client.get("live/world").json()["friction"] == 0.8
        push = {"impulse": [0.0, 2.0], "link": "arm_left_5_joint", "point": [0.0, 0.0, -0.1]}
        assert client.post("live/push", json=push).json()["link"] == "arm_left_5_joint"
        refused = client.post("live/push", json={"impulse": [0.0, 2.0], "link": "tail"})
        assert refused.status_code == 422 and refused.json()["errors"][0]["field"] == "link"
        assert client.post("live/push", json=push | {"point": [0.0, 0.0, 9.0]}).status_code == 422
        assert client.patch("live/parameters", json={"plant": "ideal"}).json()["plant"] == "ideal"
        assert client.get("live").json()["plant"] == "ideal"
        assert client.patch("live/world", json={"slope": 0.05}).json()["errors"][0]["field"] == "world"
