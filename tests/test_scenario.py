import json
import math

import numpy as np
import pytest

from walkcore import Reference, load_scenario, record
from walkcore.errors import InvalidValueError, UnknownNameError
from walkcore.scenario.scenario import scenario_from_mapping

SHORT = {"robot": "hrp2", "duration": 2.0, "parameters": {"control_period": 0.1}}
CONTRACT = """
    tick t com_x com_y com_z com_vx com_vy com_ax com_ay jerk_x jerk_y cop_x cop_y true_cop_x true_cop_y
    reference_vx reference_vy reference_yaw_rate phase support_side support_x support_y support_yaw
    samples_on_support foothold_x foothold_y foothold_yaw foothold2_x foothold2_y foothold2_yaw time_to_touchdown
    left_x left_y left_z left_yaw right_x right_y right_z right_yaw push_x push_y status
""".split()  # columns of a recording


def test_references_hold_and_pushes_come_once():
    events = [
        {"t": 0.5, "reference": {"vx": 0.2}},
        {"t": 1.0, "push": {"impulse": [0.0, 4.0]}},
        {"t": 1.05, "reference": {}},
    ]
    commands = list(scenario_from_mapping(SHORT | {"events": events}).commands())
    assert len(commands) == 20
    assert [c.reference.vx for c in commands] == [0.0] * 5 + [0.2] * 6 + [0.0] * 9
    assert [i for i, c in enumerate(commands) if c.push is not None] == [10]


def test_two_pushes_at_one_time_are_both_given():
    events = [{"t": 1.0, "push": {"impulse": [1.0, 0.0]}}, {"t": 1.0, "push": {"impulse": [0.0, 1.0]}}]
    recording = record(scenario_from_mapping(SHORT | {"events": events}))
    assert np.sum(recording["push_x"]) == pytest.approx(1.0)
    assert np.sum(recording["push_y"]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"duration": math.nan}, "duration"),
        ({"duration": None}, "duration"),
        ({"duration": 1e9}, "duration"),
        ({"events": {}, "surprise": 1}, "scenario.surprise"),
        ({"events": "walk"}, "events"),
        ({"events": [3]}, "events[0]"),
        ({"events": [{"t": 5.0}]}, "events[0].t"),
        ({"events": [{"t": 0.0, "reference": {"vx": 9.0}}]}, "events[0].reference.vx"),
        ({"events": [{"t": 0.0, "reference": {"vz": 1.0}}]}, "events[0].reference.vz"),
        ({"events": [{"t": 0.0, "push": {"impulse": [1e9, 0.0]}}]}, "events[0].push.impulse"),
        ({"events": [{"t": 0.0, "push": {}}]}, "events[0].push.impulse"),
        ({"parameters": {"alpha": -1.0}}, "parameters.alpha"),
        ({"name": 3}, "name"),
        ({"description": "\ud800"}, "description"),
    ],
)
def test_a_wrong_scenario_is_refused_with_its_field(change, field):
    with pytest.raises(InvalidValueError) as refused:
        scenario_from_mapping(SHORT | change)
    assert refused.value.field == field


def test_unknown_names_tell_the_choices(tmp_path):
    with pytest.raises(UnknownNameError, match="herdt-2010-section-6"):
        load_scenario("moonwalk")
    with pytest.raises(UnknownNameError, match="talos"):
        scenario_from_mapping(SHORT | {"robot": "r2d2"})
    broken = tmp_path / "broken.yaml"
    broken.write_text("{unclosed: [")
    with pytest.raises(InvalidValueError, match="YAML"):
        load_scenario(broken)


def test_exponents_are_numbers_in_yaml_and_json_alike(tmp_path):
    for text in (
        "robot: hrp2\nduration: 1e0\nparameters: {alpha: 1e-5}\n",
        '{"robot": "hrp2", "duration": 1e0, "parameters": {"alpha": 1e-5}}',
    ):
        file = tmp_path / "scenario.yaml"
        file.write_text(text)
        assert load_scenario(file).parameters.alpha == 1e-5


def test_a_recording_reads_back_to_what_was_written(tmp_path):
    scenario = scenario_from_mapping(SHORT | {"events": [{"t": 0.0, "reference": {"vx": 0.1}}]})
    fractions = []
    recording = record(scenario, progress=fractions.append)
    recording.write(tmp_path)
    with np.load(tmp_path / "recording.npz") as columns:
        assert tuple(columns) == recording.columns
        assert all(np.array_equal(columns[name], recording[name], equal_nan=True) for name in columns)
    lines = (tmp_path / "recording.csv").read_text().splitlines()
    assert tuple(lines[0].split(",")) == recording.columns
    assert np.array_equal(
        np.array([list(map(float, line.split(","))) for line in lines[1:]]), recording.rows, equal_nan=True
    )
    run = json.loads((tmp_path / "run.json").read_text())
    assert run["metrics"]["ticks"] == 20
    assert run["parameters"]["com_height"] == 0.814
    assert fractions[-1] == 1.0
    assert scenario_from_mapping(run["scenario"]).events[0].reference == Reference(vx=0.1)


def test_columns_are_those_of_the_contract():
    more = "steps_to_stand com_offset_x com_offset_y step_duration next_step_duration foothold3_yaw foothold4_yaw"
    recording = record(scenario_from_mapping(SHORT))
    assert recording.columns == (*CONTRACT, *more.split())
    talos = record(scenario_from_mapping(SHORT | {"robot": "talos", "duration": 0.1}))
    assert talos.columns == (
        *CONTRACT,
        *(f"q_{i}" for i in range(39)),
        *more.split(),
    )
