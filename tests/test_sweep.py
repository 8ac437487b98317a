"""Sweeps: what a file may say, how the limit of survival is searched, and that a cell is decided by itself."""

import math

import jsonschema
import numpy as np
import pytest
from conftest import survives_to_the_end
from hypothesis import given
from hypothesis import strategies as st

from app.http.sweep_schemas import sweep_schema
from walkcore import Parameters, Push, Reference, WalkError, load_robot
from walkcore.analysis.cell_outcome import CellOutcome, cell_seeds, nominal_walk, outcome, replay, wilson_interval
from walkcore.analysis.survival import OBSERVED, ImpulseScan, NominalWalk, largest_survived, survived_impulses
from walkcore.analysis.sweep import load_sweep, sweep_from_mapping, sweep_names
from walkcore.mpc.plan import Status
from walkcore.scenario.recording import record
from walkcore.scenario.scenario import scenario_from_mapping

GRID = {"directions": 4, "phases": 2, "max_impulse": 40.0, "coarse": 10.0, "tolerance": 5.0}
FAST = {"control_period": 0.05, "stepping_in_place": True, "solver": "daqp"}
SMALL = {"name": "small", "robots": ["hrp2"], "parameters": [FAST], "pushes": GRID}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"wind": 1}, "sweep.wind = 1: unknown"),
        ({"robots": []}, "robots = []"),
        ({"robots": ["nobody"]}, "no robot 'nobody'"),
        ({"robots": [3]}, "robots[0] = 3"),
        ({"parameters": [{}, {"alpha": -1.0}]}, "parameters[1].alpha = -1.0: must lie in [0, 1000]"),
        ({"references": [{}, {"vx": 3.0}]}, "references[1].vx = 3.0: must lie in"),
        ({"references": [3]}, "references[0] = 3: must be a mapping"),
        ({"pushes": 3}, "pushes = 3"),
        ({"pushes": {"directions": 4, "phases": 2}}, "pushes.max_impulse = None: is missing"),
        ({"pushes": GRID | {"directions": 0}}, "pushes.directions = 0: must lie in [1, 3600]"),
        ({"pushes": GRID | {"phases": 2.5}}, "pushes.phases = 2.5: must be a whole number"),
        ({"pushes": GRID | {"max_impulse": 61.0}}, "pushes.max_impulse = 61.0: must lie in [0, 60], the limit of hrp2"),
        ({"pushes": GRID | {"tolerance": 0.0}}, "pushes.tolerance = 0.0"),
        ({"pushes": GRID | {"duration": 5.0}}, "pushes.duration = 5.0"),
        ({"seeds": 2}, "seeds = 2: must be 1 where nothing is random"),
        ({"world": {"slope": 0.1}}, "needs plant: mujoco"),
        ({"body": 1}, "body = 1: must be true or false"),
        ({"references": [{}] * 2001}, "references = "),
        ({"pushes": GRID | {"directions": 3600, "phases": 1000}, "references": [{}] * 9}, "number of cells = 32400000"),
    ],
)
def test_what_is_no_sweep_is_refused_with_field_value_and_limit(change, message):
    with pytest.raises(WalkError) as refused:
        sweep_from_mapping(SMALL | change)
    assert message in str(refused.value)


@pytest.mark.parametrize("name", sweep_names())
def test_what_ships_is_a_sweep_by_validator_and_schema(name):
    sweep = load_sweep(name)
    assert sweep.name == name and sweep.description and sweep.nb_cells > 0
    jsonschema.validate(sweep.source, sweep_schema())


def test_the_schema_refuses_unknown_keys():
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(SMALL | {"wind": 1}, sweep_schema())


def test_cells_stand_in_the_order_of_the_file():
    sweep = sweep_from_mapping(SMALL | {"robots": ["hrp2", "talos"], "references": [{}, {"vx": 0.1}]})
    cells = [sweep.cell(index) for index in range(sweep.nb_cells)]
    order = [(sweep.walks[c.walk].robot.name, sweep.walks[c.walk].events[0].reference.vx) for c in cells]
    assert order == [(robot, vx) for robot in ("hrp2", "talos") for vx in (0.0, 0.1) for _ in range(8)]
    assert [(c.direction, c.phase) for c in cells[8:16]] == [
        (k * math.pi / 2, phase) for k in range(4) for phase in (0.0, 0.5)
    ]


@given(borders=st.lists(st.floats(0.1, 79.9), max_size=6).map(sorted))
def test_every_border_that_the_scan_sees_is_found_to_the_tolerance(borders):
    tried: dict[float, bool] = {}

    def survives(impulse: float) -> bool:
        assert impulse not in tried, "asked twice"
        tried[impulse] = sum(border <= impulse for border in borders) % 2 == 0
        return tried[impulse]

    scan = ImpulseScan(max_impulse=80.0, coarse=10.0, tolerance=0.5)
    found = survived_impulses(survives, scan)
    intervals = [(0.0, found.largest), *found.islands]
    seen = dict(tried)
    tried.clear()
    assert largest_survived(survives, scan) == found.largest and tried.items() <= seen.items()
    assert max(tried) == next((impulse for impulse in scan.grid[1:] if not seen[impulse]), 80.0)
    for impulse, has_survived in seen.items():
        assert has_survived is any(low <= impulse <= high for low, high in intervals)
    for low, high in intervals:
        assert low == 0.0 or any(low - 0.5 <= lethal < low for lethal in seen if not seen[lethal])
        assert high == 80.0 or any(high < lethal <= high + 0.5 for lethal in seen if not seen[lethal])


def test_wilson_interval_agrees_with_its_published_values():
    assert wilson_interval(0, 10) == pytest.approx((0.0, 0.2775), abs=1e-4)
    assert wilson_interval(8, 10) == pytest.approx((0.4902, 0.9433), abs=1e-4)  # Brown, Cai, DasGupta 2001


def test_a_cell_is_decided_the_same_alone_and_after_others():
    sweep = sweep_from_mapping(SMALL)
    in_order = [outcome(sweep, sweep.cell(index)) for index in range(sweep.nb_cells)]
    nominal_walk.cache_clear()
    assert [outcome(sweep, sweep.cell(index)) for index in reversed(range(sweep.nb_cells))] == in_order[::-1]
    assert len({found.largest_impulse for found in in_order}) > 1
    assert all(found.delta_v == found.largest_impulse / 56.0 for found in in_order)


@pytest.mark.parametrize("timing", ["fixed", "adaptive"])
def test_the_replay_of_a_cell_falls_and_recovers_as_the_cell_says(timing):
    sweep = sweep_from_mapping(SMALL | {"parameters": [FAST | {"step_timing": timing}], "references": [{"vx": 0.2}]})
    cell = sweep.cell(3)
    found = outcome(sweep, cell)
    survived, lethal = (
        record(scenario_from_mapping(replay(sweep, cell, impulse)))
        for impulse in (found.largest_impulse, found.largest_impulse + sweep.pushes.scan.tolerance)
    )
    (push,) = survived.metrics()["pushes"]
    assert push["time"] is not None and survived["status"][-1] != Status.FALLEN
    assert np.hypot(*push["impulse"]) == pytest.approx(found.largest_impulse)
    assert lethal["status"][-1] == Status.FALLEN or lethal.metrics()["pushes"][0]["time"] is None


def test_a_walk_that_falls_by_itself_survives_no_push():
    sweep = sweep_from_mapping(SMALL | {"parameters": [FAST | {"scheme": "preview_control", "horizon_samples": 9}]})
    assert nominal_walk(sweep, 0).has_fallen
    assert outcome(sweep, sweep.cell(0)) == CellOutcome(None, None)


NOISY = {"robots": ["talos"], "parameters": [{"plant": "mujoco"}], "world": {"sensors": "noisy"}, "seeds": 5}


def test_seeds_follow_from_the_cell_and_not_from_its_place():
    one = sweep_from_mapping(SMALL | NOISY)
    two = sweep_from_mapping(SMALL | NOISY | {"references": [{"vx": 0.1}, {}]})
    assert list(cell_seeds(one, one.cell(3))) == list(cell_seeds(two, two.cell(11)))
    everything = [seed for index in range(8) for seed in cell_seeds(one, one.cell(index))]
    assert len(set(everything)) == 40 and list(cell_seeds(sweep_from_mapping(SMALL), one.cell(0))) == [None]


def pushes_at_random(nb: int, hardest: float):
    numbers = np.random.default_rng(0)
    for _ in range(nb):
        angle, impulse = numbers.uniform(0.0, 2 * math.pi), numbers.uniform(0.0, hardest)
        yield numbers.integers(16) / 16, Push(impulse * np.array([math.cos(angle), math.sin(angle)]))


@pytest.mark.parametrize(("timing", "nb"), [("fixed", 12), ("adaptive", 6)])
def test_what_is_decided_early_is_decided_as_after_all_of_the_time(timing, nb):
    parameters = Parameters.from_mapping(FAST | {"step_timing": timing})
    walk = NominalWalk(load_robot("hrp2"), parameters, Reference())
    assert walk.push_tick(0.5) - walk.push_tick(0.0) == 8
    pushes = list(pushes_at_random(nb, 40.0))
    decided = [(walk.survives(*push), survives_to_the_end(walk, *push)) for push in pushes]
    assert {early for early, _ in decided} == {True, False}
    assert [early for early, _ in decided] == [late for _, late in decided]
    assert all(walk.branch_point(phase).monitor.last is None for phase, _ in pushes), (
        "a trial leaves no trace in the walk it branches from"
    )


def test_a_long_push_is_not_survived_for_the_ticks_at_which_it_is_still_weak():
    walk = NominalWalk(load_robot("hrp2"), Parameters.from_mapping(FAST), Reference())
    lethal = Push([0.0, 40.0], duration=1.0)
    first, _ = next(iter(walk.after(0.25, lethal)))
    assert first.status is Status.SOLVED, "the paper's QP solves the first ticks of this push"
    assert not survives_to_the_end(walk, 0.25, lethal)
    assert not walk.survives(0.25, lethal)


@pytest.mark.exhaustive
@pytest.mark.parametrize("robot", ["talos", "hrp2"])
@pytest.mark.parametrize("timing", ["fixed", "adaptive"])
@pytest.mark.parametrize("vx", [0.0, 0.3])
def test_no_push_is_decided_otherwise_early_than_after_all_of_the_time(robot, timing, vx):
    values = {"stepping_in_place": True, "solver": "daqp", "step_timing": timing}
    walk = NominalWalk(load_robot(robot), Parameters.from_mapping(values), Reference(vx=vx))
    for phase, push in pushes_at_random(200, 60.0):
        assert walk.survives(phase, push) is survives_to_the_end(walk, phase, push), (phase, push)


def test_the_robot_is_observed_for_eight_seconds():
    assert OBSERVED == 8.0
