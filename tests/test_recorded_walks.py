"""Walks checked from outside: from run.json and recording.npz alone."""

import json

import numpy as np
import pytest
from oracle import Oracle, excess

from walkcore import load_robot, load_scenario, record
from walkcore.scenario.scaling import scaled

SAMPLE_MOTIONS = ("herdt-2010-section-6", "herdt-2010-section-6-hrp2")
MORE = ("turns-and-stops", *(f"{SAMPLE_MOTIONS[0]}@{robot}" for robot in ("alexander", "romeo")))
SCENARIOS = (*SAMPLE_MOTIONS, *(pytest.param(name, marks=pytest.mark.exhaustive) for name in MORE))
"""Names of scenarios, some with the robot that they are scaled to."""


@pytest.fixture(scope="module", params=SCENARIOS)
def run(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    name, _, robot = request.param.partition("@")
    scenario = load_scenario(name)
    record(scaled(scenario, load_robot(robot)) if robot else scenario).write(folder)
    parameters = json.loads((folder / "run.json").read_text())["parameters"]
    with np.load(folder / "recording.npz") as columns:
        return Oracle(parameters, dict(columns))


def test_every_tick_is_solved_and_finite(run):
    assert np.all(run["status"] == 0)
    may_be_nan = ("true_cop", "foothold", "time_to_touchdown")
    assert all(np.all(np.isfinite(v)) for name, v in run.c.items() if not name.startswith(may_be_nan))


@pytest.mark.parametrize("every", [8, pytest.param(1, marks=pytest.mark.exhaustive)])
def test_footholds_are_the_exact_optimum(run, every):
    worst = 0.0
    for k in range(0, len(run["tick"]), every):
        footholds = run.footholds(k)[0][:2]  # the recording has the first two: short steps leave room for a third
        decided = np.array([[run[f"foothold{n}_{a}"][k] for a in "xy"] for n in ("", "2")])[: len(footholds)]
        is_planned = len(footholds) > 0 or run["steps_to_stand"][k] == 1
        assert np.isnan(run["foothold_x"][k]) != is_planned
        worst = max(worst, np.max(np.abs(footholds - decided), initial=0.0))
    assert worst < 1e-3


def test_cop_keeps_its_margin_at_the_samples(run):
    on_grid = run["tick"] % round(run.T / run.dt) == 0
    was_in_step = np.concatenate([[False], run["phase"][:-1] == 2])
    in_step = on_grid & (run["phase"] > 0) & was_in_step
    for k in np.flatnonzero(in_step):
        # A sample at a touchdown belongs to the step that ends there, whose support is the other foot.
        is_touchdown = run["phase"][k] == 1 and np.isclose(run["time_to_touchdown"][k], run.p["step_duration"])
        side = int(run["support_side"][k]) ^ int(is_touchdown)
        foot = ("left", "right")[side]
        sole = run.sole(side, [run[f"{foot}_{c}"][k] for c in ("x", "y", "yaw")])
        assert excess([run["cop_x"][k], run["cop_y"][k]], sole, run.p["cop_margin"]) < 1e-6


def test_cop_is_inside_the_soles_on_the_ground_at_every_tick(run):
    for k in range(len(run["tick"])):
        soles = [
            run.sole(side, [run[f"{f}_{c}"][k] for c in ("x", "y", "yaw")]) for side, f in enumerate(("left", "right"))
        ]
        ground = soles[int(run["support_side"][k])] if run["phase"][k] == 2 else np.vstack(soles)
        assert excess([run["cop_x"][k], run["cop_y"][k]], ground) < 0.0


def test_every_landed_foothold_lies_in_its_region(run):
    for k in np.flatnonzero(np.diff(run["support_side"]) != 0):
        before, after = np.array([[run[f"support_{a}"][i] for a in "xy"] for i in (k, k + 1)])
        landed_right = run["support_side"][k + 1] == 1
        region = run.region(run["support_yaw"][k + 1] - run["support_yaw"][k], landed_right)
        assert excess(turned(after - before, -run["support_yaw"][k]), region) < 1e-6


def test_no_foot_is_faster_than_its_limit(run):
    for foot in ("left", "right"):
        moves = np.diff(np.column_stack([run[f"{foot}_x"], run[f"{foot}_y"]]), axis=0)
        moves = np.array([turned(move, -yaw) for move, yaw in zip(moves, run["support_yaw"], strict=False)])
        assert np.all(np.abs(moves) <= np.array(run.p["max_foot_speed"]) * run.dt + 1e-9)
        assert np.max(np.abs(np.diff(run[f"{foot}_yaw"]))) <= run.p["max_foot_yaw_rate"] * run.dt + 1e-9


def turned(vector, yaw):
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s], [s, c]]) @ vector


def test_a_foot_on_the_ground_does_not_slip(run):
    for side, foot in enumerate(("left", "right")):
        on_ground = (run["phase"] < 2) | (run["support_side"] == side)
        still = on_ground[:-1] & on_ground[1:]
        for axis in ("x", "y", "z", "yaw"):
            assert np.all(np.diff(run[f"{foot}_{axis}"])[still] == 0.0)


@pytest.mark.parametrize("run", SAMPLE_MOTIONS, indirect=True)
def test_forward_speed_is_the_reference_in_steady_state(run):
    two_steps = 2 * run.p["step_duration"]
    steady = (run["t"] >= 16.0) & (run["t"] < 16.0 + two_steps - 1e-9)
    assert np.mean(run["com_vx"][steady]) == pytest.approx(0.3, rel=0.02)


@pytest.mark.parametrize("run", SAMPLE_MOTIONS, indirect=True)
def test_the_push_moves_the_com_and_is_recovered_from(run):
    k = int(np.flatnonzero(run["push_y"])[0])
    assert run["t"][k] == pytest.approx(2.4)
    assert run["com_vy"][k] - run["com_vy"][k - 1] == pytest.approx(run["push_y"][k] / run.p["mass"], abs=0.02)
    later = (run["t"] >= 4.0) & (run["t"] < 5.6)
    assert abs(np.mean(run["com_vy"][later])) < 0.02


def test_the_state_follows_the_recorded_jerk(run):
    dt = run.dt
    for a in "xy":
        position = run[f"com_{a}"] + dt * run[f"com_v{a}"] + dt**2 / 2 * run[f"com_a{a}"] + dt**3 / 6 * run[f"jerk_{a}"]
        assert np.allclose(position[:-1], run[f"com_{a}"][1:], atol=1e-12)
