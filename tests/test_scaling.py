"""A scenario in the proportions of another robot, and the sample motion of the paper by robots other than its own."""

import json
from dataclasses import replace

import numpy as np
import pytest

from app.commands.run_commands import RunCommand
from walkcore import Simulation, load_robot, load_scenario, record
from walkcore.errors import InvalidValueError
from walkcore.scenario.scaling import PROMISES, scaled
from walkcore.scenario.scenario import scenario_from_mapping

SAMPLE_MOTION = load_scenario("herdt-2010-section-6")
COARSE = 0.02  # [s] of a tick; at 5 ms the oracle sees these walks in test_recorded_walks.py


@pytest.mark.parametrize("name", ["alexander", "romeo", "g1"])
def test_the_sample_motion_scaled_to_a_robot_keeps_every_promise(name):
    scenario = scaled(SAMPLE_MOTION, load_robot(name))
    recording = record(replace(scenario, parameters=scenario.parameters.changed({"control_period": COARSE})))
    kept = {verdict.name: verdict.holds for verdict in recording.verdicts()}
    if scenario.parameters.step_timing == "fixed":
        assert np.all(recording["status"] == 0)
        assert set(kept) == {*PROMISES, "max_ticks_relaxed", "max_recovery_steps"}
    else:  # it takes other plans, and more steps, where the paper's fixed steps would fall
        assert name == "g1" and set(kept) == set(PROMISES)
    assert all(kept.values()), kept
    model = Simulation(scenario.robot).body.model
    q = np.column_stack([recording[f"q_{i}"] for i in range(7, model.nq)])
    assert np.all(q >= model.lowerPositionLimit[7:] - 1e-6) and np.all(q <= model.upperPositionLimit[7:] + 1e-6)
    assert np.all(np.abs(np.diff(q, axis=0)) <= model.velocityLimit[6:] * COARSE)
    assert recording["com_x"][-1] > 15 * scenario.events[0].reference.vx * 0.5


def scenario_for(robot, *events, **more):
    return scenario_from_mapping({"name": "a", "robot": robot, "duration": 9.0, "events": list(events), **more})


def test_speeds_keep_their_froude_number_and_times_their_step():
    talos, g1 = (load_robot(name) for name in ("talos", "g1"))
    g1 = replace(g1, max_reference={key: (-9.0, 9.0) for key in g1.max_reference})
    circle = {"t": 1.6, "over": 0.8, "reference": {"vx": 0.2, "yaw_rate": 0.25}}
    push = {"t": 4.0, "push": {"impulse": [3.0, 4.0], "duration": 0.4}}
    turn, shove = scaled(scenario_for("talos", circle, push), g1).source["events"]
    shorter = g1.parameters.step_duration / talos.parameters.step_duration
    assert (turn["t"], turn["over"], shove["t"]) == pytest.approx((1.6 * shorter, 0.8 * shorter, 4.0 * shorter))
    assert turn["reference"]["vx"] ** 2 / g1.com_height == pytest.approx(0.2**2 / talos.com_height, rel=1e-3)
    assert turn["reference"]["yaw_rate"] == pytest.approx(0.25 / shorter, abs=1e-4)
    gained = np.array(shove["push"]["impulse"]) / g1.mass / np.sqrt(g1.com_height)
    assert gained == pytest.approx(np.array([3.0, 4.0]) / talos.mass / np.sqrt(talos.com_height), rel=1e-3)
    assert shove["push"]["duration"] == pytest.approx(0.4 * shorter)


def test_robots_that_walk_at_the_same_height_walk_at_the_same_speed():
    walk = scenario_for("talos", {"t": 1.0, "reference": {"vx": 0.12}}, parameters={"com_height": 0.7})
    (event,) = scaled(walk, load_robot("g1")).source["events"]
    assert event["reference"]["vx"] == pytest.approx(0.12, abs=1e-4)


def test_a_reference_beyond_the_limits_of_the_robot_keeps_its_direction_and_its_curvature():
    romeo = load_robot("romeo")
    (event,) = scaled(
        scenario_for("talos", {"t": 1.0, "reference": {"vx": 0.3, "vy": -0.1, "yaw_rate": 0.2}}), romeo
    ).events
    assert event.reference.vx == romeo.max_reference["vx"][1]
    assert event.reference.vy / event.reference.vx == pytest.approx(-1 / 3, abs=1e-3)
    radius = np.sqrt(romeo.com_height / load_robot("talos").com_height)  # of Talos's, as steps last as long
    assert event.reference.yaw_rate / event.reference.vx == pytest.approx(0.2 / 0.3 / radius, abs=1e-3)
    backward, push = ({"t": 1.0, "reference": {"vx": -0.2}}, {"t": 2.0, "push": {"impulse": [-36.0, 48.0]}})
    strict = replace(romeo, max_push=9.0)
    slow, weak = scaled(scenario_for("talos", backward, push), strict).events
    assert slow.reference.vx == romeo.max_reference["vx"][0]
    assert weak.push.impulse == pytest.approx([-5.4, 7.2], abs=1e-3) and np.hypot(*weak.push.impulse) <= 9.0


def test_what_is_expected_of_another_robot_has_no_lengths_of_the_first():
    walk = scenario_for("talos", expect={"not_fallen": True, "min_distance_x": 9.0, "max_recovery_steps": 2})
    assert [e.name for e in scaled(walk, load_robot("hrp2")).expectations] == [
        "not_fallen", "min_cop_margin", "max_recovery_steps",
    ]  # fmt: skip
    fall = scenario_for("talos", expect={"not_fallen": False, "max_recovery_steps": 2})
    assert scaled(fall, load_robot("g1")).source["expect"] == {"not_fallen": False}
    assert scaled(walk, load_robot("talos")) is walk


@pytest.mark.parametrize(
    ("events", "more", "field"),
    [
        ([{"t": 1.0, "push": {"impulse": [1.0, 0.0], "link": "arm_left_1_joint"}}], {}, "events[0].push.link"),
        ([], {"parameters": {"cop_margin": 0.04}}, "parameters.cop_margin"),
    ],
)
def test_what_belongs_to_the_first_robot_alone_is_refused(events, more, field):
    with pytest.raises(InvalidValueError) as refused:
        scaled(scenario_for("talos", *events, **more), load_robot("g1"))
    assert refused.value.field == field


def test_walk_run_takes_another_robot_and_says_how_it_is_scaled(tmp_path, capsys):
    file = tmp_path / "ahead.yaml"
    file.write_text("{name: ahead, robot: talos, duration: 2.0, parameters: {control_period: 0.1}, "
                    "events: [{t: 0.4, reference: {vx: 0.3}}], expect: {max_distance_x: 0.001}}")  # fmt: skip
    assert RunCommand((str(file),), tmp_path / "out", ("npz",), robot="romeo")() == 0
    said = capsys.readouterr().out
    assert "Scaled to Romeo: speeds by 0.88 (Froude number), durations by 1.00; its max_reference takes" in said
    run = json.loads((tmp_path / "out" / "run.json").read_text())
    assert "references down to 0.61 of that" in said
    assert run["parameters"]["robot"] == "romeo" and run["scenario"]["events"][0]["reference"] == {"vx": 0.16}
