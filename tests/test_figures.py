"""The paper's figures and the report beside them, from walks at the paper's own period."""

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from app.figures import make, measures, walks
from app.figures.methods import methods_sweep
from app.sweeps.cells import read_cells
from walkcore.analysis.sweep import sweep_from_mapping
from walkcore.errors import UnknownNameError
from walkcore.mpc.regions import half_planes
from walkcore.mpc.stance import Footstep, Side, sole_vertices

PERIOD = 0.1  # [s]
METHODS = ("full", "adapted_steps", "fixed_steps", "preview_control", "morisawa", "sugihara", "dcm_tracker")
FIGURES = [*(f"fig{n}" for n in range(1, 10)), "hard-push"]
PUSHES = {"directions": 3, "phases": 1, "duration": 0.0, "max_impulse": 40.0, "coarse": 20.0, "tolerance": 10.0}


@pytest.fixture(scope="module")
def walked():
    return walks.simulate("hrp2", PERIOD)


@pytest.fixture(scope="module")
def folder(walked, tmp_path_factory):
    """Output of `walk figures` for a robot whose walks are simulated already."""
    out = tmp_path_factory.mktemp("figures")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(make, "simulate", lambda robot, control_period: walked)
        patch.setattr(make, "methods_sweep", few_pushes)
        make.make_figures(out, ("hrp2",), ("svg",), PERIOD)
    return out


def few_pushes(robot):
    sweep = methods_sweep(robot)
    assert [walk.parameters.scheme for walk in sweep.walks] == list(METHODS)
    parameters = [{**dict(p), "control_period": 0.1} for p in sweep.source["parameters"]]
    return sweep_from_mapping({**sweep.source, "parameters": parameters, "pushes": PUSHES})


def rows(folder):
    """Measured cells of the report's claims, by what they are of."""
    lines = (folder / "report.md").read_text(encoding="utf-8").splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines if re.match(r"\| \d", line)]
    return {what: measured for _, what, _, measured, _ in cells}


def numbers(cell):
    return [float(number) for number in re.findall(r"-?\d+\.\d+", cell)]


def test_the_robots_of_the_figures_are_those_whose_sample_motion_ships(tmp_path):
    assert [(name, motion.robot.name) for name, motion in walks.sample_motions().items()] == [
        ("hrp2", "hrp2"),
        ("talos", "talos"),
    ]
    with pytest.raises(UnknownNameError, match="no robot with a sample motion 'g1'; there are: hrp2, talos"):
        make.make_figures(tmp_path / "out", ("hrp2", "g1"), ("svg",), PERIOD)
    assert not (tmp_path / "out").exists(), "refused before anything is simulated"


def test_every_figure_is_a_small_picture_that_parses(folder):
    assert sorted(path.stem for path in (folder / "hrp2").iterdir()) == sorted([*FIGURES, "methods"])
    for path in (folder / "hrp2").iterdir():
        assert ElementTree.parse(path).getroot().tag == "{http://www.w3.org/2000/svg}svg"
        assert path.stat().st_size < 150_000


def test_the_same_walks_give_the_same_bytes(folder, walked, tmp_path):
    make.draw_figures(tmp_path, walked, ("svg",))
    for name in FIGURES:
        assert (tmp_path / f"{name}.svg").read_bytes() == (folder / "hrp2" / f"{name}.svg").read_bytes()


def test_the_report_tells_what_each_method_survives(folder):
    sweep, outcomes, _ = read_cells(folder / "hrp2-methods")
    lines = (folder / "report.md").read_text(encoding="utf-8").splitlines()
    impulses = np.reshape([outcome.largest_impulse or 0.0 for outcome in outcomes], (len(sweep.walks), -1))
    assert any(of_walk.min() < of_walk.mean() != np.median(of_walk) for of_walk in impulses)
    for walk, of_walk in zip(sweep.walks, impulses, strict=True):
        (line,) = (line for line in lines if line.startswith(f"| {walk.parameters.formulation.label} |"))
        told = numbers(line.removeprefix(f"| {walk.parameters.formulation.label}"))
        assert told[:3] == [round(total(of_walk), 1) for total in (np.min, np.median, np.mean)]


def test_a_speed_over_time_is_red_and_its_reference_blue(folder):
    text = (folder / "hrp2" / "fig6.svg").read_text(encoding="utf-8")
    assert "#d62424" in text and "#1454c8" in text


def test_the_reported_lateral_speeds_are_those_of_the_recordings(folder, walked):
    cells = rows(folder)
    for scheme, what in (("full", "Mean lateral speed by (19), of the reference"), ("mean_velocity", "by (31)")):
        walk = walked.by_scheme[scheme]
        whole_cycles = (walk["t"] > 7.2 - 1e-6) & (walk["t"] < 12.0 - 1e-6)  # sideways from 6 s to 12 s, 1.6 s each
        mean = walk["com_vy"][whole_cycles].mean()
        found = next(cell for name, cell in cells.items() if what in name and name.startswith("Mean lateral"))
        assert numbers(found)[0] == pytest.approx(-mean, abs=6e-4)


def test_the_reported_reaction_ends_where_the_recording_reaches_the_reference(folder, walked):
    walk = walked.by_scheme["full"]
    first = walk["t"][walk["com_vx"] >= 0.3][0]
    cell = next(cell for name, cell in rows(folder).items() if name.startswith("Reaction"))
    assert numbers(cell)[0] == pytest.approx(first - 0.8, abs=6e-4)


def test_the_margin_is_the_distance_to_the_sole_that_carries_the_sample(walked):
    walk = walked.by_scheme["full"]
    sole = np.array(walk.parameters["sole"]["polygon"])
    found = []
    for k in range(1, len(walk.rows)):  # at the paper's period each tick is a sample
        if walk["phase"][k - 1] == 2:
            side = Side(int(walk["support_side"][k - 1]))
            place = [walk[f"{side.name.lower()}_{c}"][k] for c in ("x", "y", "yaw")]
            ground = half_planes(sole_vertices(sole, Footstep(side, np.array(place[:2]), place[2])))
            found.append(-ground.excess([walk["cop_x"][k], walk["cop_y"][k]]))
    assert np.allclose(measures.margins_at_samples(walk), found, atol=1e-12)
    assert min(found) == pytest.approx(0.03, abs=1e-6)


def test_no_mean_lateral_speed_is_beyond_what_placement_allows(walked):
    for variation in walked.variations.values():
        bound = measures.lateral_bound(variation.full)
        y = np.array(variation.full.parameters["foothold_region"])[:, 1]
        assert bound == pytest.approx((y.max() - y.min()) / 1.6)
        for walk in (variation.full, variation.mean_velocity):
            assert 0.0 < -measures.lateral_speed(walk) <= bound + 1e-3


def test_a_mean_over_a_horizon_is_the_mean_of_the_ticks_around(walked):
    walk = walked.by_scheme["full"]
    means = measures.mean_over_horizon(walk, "com_vy")
    assert means[80] == pytest.approx(walk["com_vy"][72:88].mean())
    assert np.isnan(means[:8]).all() and np.isnan(means[-8:]).all() and np.isfinite(means[8:-8]).all()


def test_a_hard_push_moves_the_free_foot_and_the_robot_comes_back_to_its_speed(walked):
    found = measures.push_effect(walked.hard_push, walked.without_push)
    assert found.free_step > 0.05 and found.drift > 0.05
    assert found.free_touchdown == pytest.approx(4.0)
    later = walked.hard_push["t"] > 2.4 + found.recovery.time
    gap = np.hypot(*(walked.hard_push[v][later] - walked.without_push[v][later] for v in ("com_vx", "com_vy")))
    assert gap.max() <= 0.07  # 2 cm of the capture point


def test_every_tick_of_the_sample_motion_is_timed():
    motion = walks.sample_motion("hrp2", PERIOD)
    durations = walks.plan_durations(motion)
    assert len(durations) == motion.nb_ticks and durations.min() > 0.0


def test_fig_7_has_both_curves_and_only_the_mean_of_the_black_one_converges(folder, walked):
    start, analytic = measures.moments(walked.by_scheme["full"]).start, walked.analytic
    red, black = (measures.time_to_reach(walk, start, 0.5) for walk in (walked.by_scheme["full"], analytic))
    assert red < 0.6 * black
    assert "#16121e" in (folder / "hrp2" / "fig7.svg").read_text(encoding="utf-8")
    steady = measures.during(analytic, start + 2.4, start + 4.8)
    assert np.mean(analytic["com_vx"][steady]) == pytest.approx(0.3, abs=0.01)
    assert np.ptp(analytic["com_vx"][steady]) > 0.1
