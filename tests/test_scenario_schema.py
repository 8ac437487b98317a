import json

import jsonschema
import pytest

from app.http.scenario_schema import scenario_schema
from walkcore import Simulation, WalkError, load_robot, load_scenario, scenario_names
from walkcore.scenario.scenario import scenario_from_mapping

STATE = Simulation(load_robot("hrp2")).state.to_mapping()
LEAST = {"robot": "hrp2", "duration": 1.0}
EVENT = {"t": 0.5}
GOOD = {
    "least": LEAST,
    "talos by default": {"duration": 1},
    "all": LEAST
    | {
        "name": "all",
        "description": "everything",
        "parameters": {"alpha": 1e-6, "com_height": None, "horizon_samples": 16, "dynamic_filter": True},
        "initial_state": STATE,
        "events": [
            EVENT | {"reference": {"vx": 0.1}, "over": 0.2},
            EVENT | {"push": {"impulse": [1, 2.0], "duration": 0.1, "frame": "world"}},
            EVENT | {"parameters": {"scheme": "speed_and_jerk"}},
            EVENT,
        ],
        "expect": {"not_fallen": False, "max_cop_error": 0.02, "min_cop_margin": -1},
    },
    "nothing behind the keys": LEAST | {"parameters": None, "events": None, "expect": None, "initial_state": None},
    "empty": LEAST | {"parameters": {}, "events": [], "expect": {}},
}
BAD = {
    "no duration": {"robot": "hrp2"},
    "text": "walk",
    "list": [],
    "unknown key": LEAST | {"surprise": 1},
    "unknown robot": LEAST | {"robot": "r2d2"},
    "robot is a number": LEAST | {"robot": 3},
    "robot is null": LEAST | {"robot": None},
    "name is a number": LEAST | {"name": 3},
    "name is null": LEAST | {"name": None},
    "duration as text": LEAST | {"duration": "1"},
    "duration is true": LEAST | {"duration": True},
    "too long": LEAST | {"duration": 1e9},
    "parameters is false": LEAST | {"parameters": False},
    "events is a mapping": LEAST | {"events": {}},
    "events is zero": LEAST | {"events": 0},
    "unknown parameter": LEAST | {"parameters": {"speed": 1}},
    "unknown scheme": LEAST | {"parameters": {"scheme": "magic"}},
    "alpha too large": LEAST | {"parameters": {"alpha": 1e4}},
    "alpha as text": LEAST | {"parameters": {"alpha": "1e-6"}},
    "filter is one": LEAST | {"parameters": {"dynamic_filter": 1}},
    "event without a time": LEAST | {"events": [{"reference": {}}]},
    "event before the start": LEAST | {"events": [{"t": -1}]},
    "reference is null": LEAST | {"events": [EVENT | {"reference": None}]},
    "push is null": LEAST | {"events": [EVENT | {"push": None}]},
    "unknown component": LEAST | {"events": [EVENT | {"reference": {"vz": 1}}]},
    "push in one direction": LEAST | {"events": [EVENT | {"push": {"impulse": [1]}}]},
    "push backwards in time": LEAST | {"events": [EVENT | {"push": {"impulse": [1, 1], "duration": -1}}]},
    "push in no frame": LEAST | {"events": [EVENT | {"push": {"impulse": [1, 1], "frame": "moon"}}]},
    "unknown metric": LEAST | {"expect": {"max_fun": 1}},
    "bound as text": LEAST | {"expect": {"max_cop_error": "1"}},
    "expect is a list": LEAST | {"expect": []},
    "fallen is one": LEAST | {"expect": {"not_fallen": 1}},
    "state without a tick": LEAST | {"initial_state": {k: v for k, v in STATE.items() if k != "tick"}},
    "state at a negative tick": LEAST | {"initial_state": STATE | {"tick": -1}},
    "state in the sky": LEAST | {"initial_state": STATE | {"left_foot": STATE["left_foot"] | {"height": 9}}},
}
# These depend on the robot, or on other values, or are no JSON: only the core can tell.
ONLY_BY_THE_CORE = {
    "duration is NaN": LEAST | {"duration": float("nan")},
    "too fast": LEAST | {"events": [EVENT | {"reference": {"vx": 5.0}}]},
    "too strong": LEAST | {"events": [EVENT | {"push": {"impulse": [1e4, 0]}}]},
    "after the end": LEAST | {"events": [{"t": 2.0}]},
    "a ramp to nowhere": LEAST | {"events": [EVENT | {"over": 1.0}]},
    "not a multiple": LEAST | {"parameters": {"control_period": 0.03}},
    "another period on the way": LEAST | {"events": [EVENT | {"parameters": {"control_period": 0.1}}]},
}


def core_accepts(data):
    try:
        scenario_from_mapping(data)
    except WalkError:
        return False
    return True


def schema_accepts(data):
    try:
        jsonschema.validate(data, scenario_schema())
    except jsonschema.ValidationError:
        return False
    return True


@pytest.mark.parametrize("data", GOOD.values(), ids=GOOD)
def test_what_is_good_is_good_for_core_and_schema(data):
    assert core_accepts(data) and schema_accepts(data)


@pytest.mark.parametrize("data", BAD.values(), ids=BAD)
def test_what_is_bad_is_refused_by_the_core_and_does_not_fit_the_schema(data):
    assert not core_accepts(data)
    assert not schema_accepts(data)


@pytest.mark.parametrize("data", ONLY_BY_THE_CORE.values(), ids=ONLY_BY_THE_CORE)
def test_what_depends_on_other_values_is_refused_by_the_core(data):
    assert schema_accepts(data) and not core_accepts(data)


def test_every_scenario_that_ships_fits_the_published_schema():
    schema = json.loads(json.dumps(scenario_schema(), allow_nan=False))
    jsonschema.Draft202012Validator.check_schema(schema)
    for name in scenario_names():
        scenario = load_scenario(name)
        assert scenario.name == name
        jsonschema.validate(dict(scenario.source), schema)


def test_the_schema_says_what_each_parameter_is():
    alpha = scenario_schema()["properties"]["parameters"]["properties"]["alpha"]
    assert alpha["description"] == "Weight of the jerk in (19)."
    assert (alpha["minimum"], alpha["maximum"], alpha["default"]) == (0.0, 1e3, 1e-6)
