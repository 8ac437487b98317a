import math
from dataclasses import dataclass, field, replace
from xml.etree import ElementTree

import numpy as np
import pytest

from walkcore import load_scenario, record
from walkcore.analysis.margins import dcm, support_margins
from walkcore.analysis.metrics import metrics
from walkcore.analysis.push_recovery import push_recoveries
from walkcore.analysis.steady_walking import steady_walks
from walkcore.errors import InvalidValueError
from walkcore.scenario.expectations import METRICS, Expectation, expectation_names, expectations_from_mapping
from walkcore.scenario.scenario import scenario_from_mapping

DT, STEP = 0.1, 0.8
PUSHED = {
    "robot": "hrp2",
    "duration": 14.0,
    "parameters": {"control_period": DT},
    "events": [{"t": 0.5, "reference": {"vx": 0.2}}, {"t": 6.0, "push": {"impulse": [0.0, 4.0]}}],
}

PACED = {
    "robot": "hrp2",
    "duration": 14.4,
    "parameters": {"control_period": DT},
    "events": [{"t": 0.0, "reference": {"vx": 0.2}}, {"t": 6.7, "parameters": {"step_duration": 0.6}}],
}


@dataclass
class Made:
    """A walk made by hand: what is not given is zero."""

    rows: int
    columns: dict = field(default_factory=dict)
    reason: str = ""
    body_use: None = None
    parameters = {  # noqa: RUF012
        "control_period": DT,
        "step_duration": STEP,
        "gravity": 9.81,
        "com_height": 0.981,
        "mass": 1000.0,
        "sole": {"polygon": [[-0.1, -0.05], [0.1, -0.05], [0.1, 0.05], [-0.1, 0.05]]},
    }

    def __getitem__(self, name):
        return np.asarray(self.columns.get(name, np.arange(self.rows) * DT if name == "t" else np.zeros(self.rows)))


def so_far(velocity):
    """The way that a velocity has led before each tick."""
    return np.concatenate([[0.0], np.cumsum(velocity)[:-1]]) * DT


def on_one_foot(rows, **columns):
    """A walk on the left foot, at the origin."""
    flying = {"right_y": np.full(rows, -0.3), "right_z": np.full(rows, 0.05)}
    return Made(rows, {"phase": np.full(rows, 2)} | flying | columns)


def test_margins_are_distances_to_the_nearest_edge():
    walk = on_one_foot(3)
    places = np.array([[0.0, 0.0], [0.09, 0.0], [0.0, -0.07]])
    assert support_margins(walk, places) == pytest.approx([0.05, 0.01, -0.02])
    both = Made(3, {"phase": np.array([1, 1, 2]), "right_y": np.full(3, -0.3)})
    assert support_margins(both, np.array([[0.0, -0.15]] * 3)) == pytest.approx([0.1, 0.1, -0.1])


def test_the_sole_that_turns_takes_its_edges_along():
    walk = on_one_foot(1, left_yaw=np.array([math.pi / 2]))
    assert support_margins(walk, np.array([[0.0, 0.09]])) == pytest.approx([0.01])


def test_the_dcm_is_ahead_of_the_com_by_velocity_over_omega():
    walk = on_one_foot(1, com_vx=np.array([math.sqrt(10.0)]))
    assert dcm(walk)[0] == pytest.approx([1.0, 0.0])


def test_mean_velocity_is_over_whole_cycles_in_the_heading_frame_after_one_to_settle():
    rows = 60
    t = np.arange(rows) * DT
    sway = np.sin(2 * math.pi * t / (2 * STEP))
    yaw = np.full(rows, math.pi / 2)  # facing y
    walk = on_one_foot(
        rows, left_yaw=yaw, right_yaw=yaw, com_vy=0.3 + sway, com_vx=sway, reference_vx=np.full(rows, 0.25)
    )
    (steady,) = steady_walks(walk)
    assert steady.cycles == 2 and steady.end - steady.start == pytest.approx(3.2)
    assert steady.mean_velocity == pytest.approx((0.3, 0.0, 0.0), abs=1e-12)
    assert steady.velocity_error == pytest.approx(0.05)


def test_cycles_are_as_long_as_the_steps_take_at_the_time():
    found = steady_walks(record(scenario_from_mapping(PACED)))
    assert [(s.cycles, s.end - s.start) for s in found] == [(3, pytest.approx(4.8)), (4, pytest.approx(4.8))]
    assert all(s.velocity_error < 0.01 for s in found)


def test_a_change_of_the_reference_and_a_push_begin_anew():
    rows = 100
    asked = np.where(np.arange(rows) < 50, 0.1, 0.2)
    push = np.zeros(rows)
    push[75] = 1.0
    found = steady_walks(on_one_foot(rows, reference_vx=asked, push_x=push))
    assert [s.reference[0] for s in found] == [0.1]  # the others are too short to hold two cycles


def test_the_deviation_is_from_the_cycle_before_the_push_repeated():
    rows, push = 100, 40
    t = np.arange(rows) * DT
    sway = 0.1 * np.sin(2 * math.pi * t / (2 * STEP))
    shove = np.where(np.arange(rows) >= push, 0.2 * np.exp(-(t - push * DT) / 0.5), 0.0)
    impulse = np.zeros(rows)
    impulse[push : push + 3] = [2.0, 2.0, 1.0]
    walk = on_one_foot(rows, com_vy=sway + shove, com_y=so_far(sway + shove), push_y=impulse)
    (found,) = push_recoveries(walk)
    assert found.impulse == (0.0, 5.0)
    assert found.time is None and found.steps is None  # it never steps
    assert found.com_deviation == pytest.approx(so_far(shove)[-1], rel=1e-9)


def test_a_push_that_disturbs_the_cycle_before_the_next_one_leaves_that_without_a_deviation():
    push = np.zeros(100)
    push[[40, 50]] = 1.0
    first, second = push_recoveries(Made(100, {"push_x": push}))
    assert first.time == second.time == pytest.approx(DT)  # it stands at rest
    assert first.com_deviation == 0.0 and second.com_deviation is None


def test_metrics_of_a_pushed_walk():
    recording = record(scenario_from_mapping(PUSHED))
    found = metrics(recording)
    assert set(METRICS) <= set(found)
    assert found["velocity_error"] < 0.005 and found["cop_error"] is None and found["joints"] == {}
    (push,) = found["pushes"]
    assert push["t"] == pytest.approx(6.0) and push["steps"] == found["recovery_steps"]
    assert 0.1 < push["time"] < 3.0 and 0.01 < push["com_deviation"] < 0.3
    assert found["cop_margin"] > 0.02 and found["capturability_margin"] < 0.0
    unpushed = metrics(record(scenario_from_mapping(PUSHED | {"events": PUSHED["events"][:1]})))
    assert unpushed["pushes"] == [] and unpushed["recovery_time"] is None


def test_what_comes_after_a_fall_is_not_measured():
    hard = {"t": 6.0, "push": {"impulse": [0.0, 50.0]}}
    found = metrics(record(scenario_from_mapping(PUSHED | {"events": [PUSHED["events"][0], hard]})))
    assert found["has_fallen"] and found["reason"]
    assert found["pushes_unrecovered"] == 1 and found["velocity_error"] < 0.01
    assert found["status_counts"]["fallen"] > 50


def test_the_body_follows_and_its_use_is_reported_by_joint():
    recording = record(scenario_from_mapping({"duration": 1.0, "events": [{"t": 0.1, "reference": {"vx": 0.1}}]}))
    found = recording.metrics()
    assert 0.0 < found["com_error"] < 1e-3 and 0.0 < found["sole_error"] < 1e-3
    assert len(found["joints"]) == 32
    assert found["torque_use_p99"] == max(joint["torque_use_p99"] for joint in found["joints"].values())
    assert 0.0 < found["speed_use"] < 1.0
    # The knee's speed by hand: the largest change of its angle in a tick over its limit.
    urdf = ElementTree.parse(recording.scenario.robot.body.urdf)
    limit = float(urdf.find("joint[@name='leg_left_4_joint']/limit").get("velocity"))
    knee = recording.body_use.joints.index("leg_left_4_joint")
    fastest = np.max(np.abs(np.diff(recording[f"q_{7 + knee}"]))) / 0.005
    assert found["joints"]["leg_left_4_joint"]["speed_use"] == pytest.approx(fastest / limit, rel=1e-6)


def test_an_expectation_holds_or_does_not():
    measured = {"has_fallen": False, "cop_margin": 0.02, "cop_error": None}
    assert Expectation("not_fallen", True).verdict(measured).holds
    assert not Expectation("not_fallen", False).verdict(measured).holds
    assert Expectation("min_cop_margin", 0.02).verdict(measured).holds
    assert not Expectation("max_cop_margin", 0.01).verdict(measured).holds
    assert not Expectation("max_cop_error", 1.0).verdict(measured).holds  # there is none


@pytest.mark.parametrize(
    ("expect", "name"),
    [({"max_fun": 1.0}, "max_fun"), ({"not_fallen": 1}, "not_fallen"), ({"max_turn": math.inf}, "max_turn")],
)
def test_a_wrong_expectation_is_refused_with_its_name(expect, name):
    with pytest.raises(InvalidValueError) as refused:
        expectations_from_mapping(expect)
    assert refused.value.field == f"expect.{name}"


def test_every_metric_can_be_expected():
    assert len(expectation_names()) == 1 + 2 * len(METRICS)
    assert record(replace(load_scenario("circle").without_body(), duration=0.5)).verdicts()[0].measured is not None


def test_parameter_changes_tell_what_is_in_force():
    events = [
        {"t": 0.5, "reference": {"vx": 0.1}, "over": 1.0},
        {"t": 1.0, "parameters": {"alpha": 1e-5, "cop_margin": 0.02}},
        {"t": 1.5, "parameters": {"alpha": 1e-4}},
    ]
    recording = record(scenario_from_mapping(PUSHED | {"duration": 2.0, "events": events}))
    assert recording.parameters["alpha"] == 1e-6
    assert recording.parameter_changes == (
        {"tick": 10, "parameters": {"alpha": 1e-5, "cop_margin": 0.02}},
        {"tick": 15, "parameters": {"alpha": 1e-4}},
    )
    ramp = recording["reference_vx"]
    assert ramp[5:16] == pytest.approx(np.linspace(0.0, 0.1, 11)) and ramp[16:] == pytest.approx(0.1)


def test_a_ramp_begins_where_the_last_one_has_got_to():
    events = [
        {"t": 0.0, "reference": {"vx": 0.2}, "over": 1.0},
        {"t": 0.5, "reference": {"vx": -0.1}, "over": 0.4},
        {"t": 1.2, "reference": {}},
    ]
    asked = [c.reference.vx for c in scenario_from_mapping(PUSHED | {"duration": 1.5, "events": events}).commands()]
    assert asked == pytest.approx([0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.05, 0, -0.05, -0.1, -0.1, -0.1, 0, 0, 0])
