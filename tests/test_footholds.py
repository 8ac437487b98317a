"""Safe foothold regions: steps that are tried, why they are refused, and the polygons that sum them up."""

import os
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from app.footholds.foothold_files import summary, write
from app.footholds.foothold_study import FootholdStudy, study
from walkcore import load_robot
from walkcore.errors import EmptyRegionError, InvalidValueError
from walkcore.footholds.collisions import SAFETY_DISTANCE, LegDistances
from walkcore.footholds.safe_polygon import area, inside, intersection, safe_polygon
from walkcore.footholds.step_feasibility import Feasibility, StepFeasibility, placement_before
from walkcore.footholds.study import MAX_VERTICES, common_vertices, contains, safe_regions, sampled_placements
from walkcore.motion.swing_foot import standing
from walkcore.motion.whole_body import BodyTarget, WholeBody
from walkcore.mpc.stance import Footstep, Side

SAMPLES = 220


@pytest.fixture(scope="module")
def trial() -> StepFeasibility:
    return StepFeasibility(load_robot("talos"))


@pytest.fixture(scope="module")
def found() -> FootholdStudy:
    return study(load_robot("talos"), com_height=0.87, nb_samples=SAMPLES, seed=3, nb_workers=2, edge_spacing=0.5)


@pytest.mark.parametrize(
    ("placement", "outcome"),
    [
        ((0.0, 0.17, 0.0), Feasibility.SAFE),
        ((0.2, 0.20, 0.0), Feasibility.SAFE),
        ((0.0, 0.11, 0.0), Feasibility.COLLISION),
        ((0.0, 0.16, 0.40), Feasibility.COLLISION),  # heel against heel
        ((-0.50, 0.45, 0.0), Feasibility.REACH),
        ((0.90, 0.20, 0.0), Feasibility.JOINT_LIMIT),  # the hips end before the knees are straight
        ((0.55, 0.20, 0.0), Feasibility.JOINT_SPEED),
    ],
)
def test_an_obvious_placement_has_its_obvious_outcome(trial, placement, outcome):
    assert trial.placement(np.array(placement)) is outcome


def test_the_higher_the_com_the_shorter_the_step():
    placement = np.array([-0.40, 0.20, 0.0])
    outcomes = [StepFeasibility(load_robot("talos"), height).placement(placement) for height in (0.84, 0.89)]
    assert outcomes == [Feasibility.SAFE, Feasibility.REACH]


def test_the_foot_of_a_mirrored_walk_comes_from_where_it_left():
    assert placement_before(np.array([0.3, 0.2, 0.0])) == pytest.approx([-0.3, 0.2, 0.0])
    # Left against right is the inverse of right against left, whose placement is the mirrored one.
    x, y, yaw = 0.1, 0.2, 0.3
    before = placement_before(np.array([x, y, yaw]))
    c, s = np.cos(before[2]), np.sin(before[2])
    assert before[:2] + np.array([[c, -s], [s, c]]) @ [x, -y] == pytest.approx([0.0, 0.0])
    assert before[2] - yaw == pytest.approx(0.0)


def test_legs_that_stand_apart_are_as_far_apart_as_their_soles():
    robot = load_robot("talos")
    body = WholeBody(robot.body)
    distances = LegDistances(robot.body, body.model)
    smallest = []
    for width in (0.15, 0.17):
        feet = [standing(Footstep(side, np.array([0.0, side.sign * width / 2]), 0.0)) for side in Side]
        q = body.at_rest(BodyTarget(np.array([0.0, 0.0, robot.com_height]), *feet, heading=0.0))
        assert len(distances.distances(q)) == 16
        smallest.append(distances.clearance(q))
    assert smallest[0] < 0.0 < smallest[1] < 0.17 - 0.124 - SAFETY_DISTANCE


def test_legs_without_collision_shapes_are_held_apart_by_those_that_are_drawn():
    robot = load_robot("alexander")  # whose URDF has no collision shapes
    trial = StepFeasibility(robot)
    assert trial.placement(np.array([0.0, robot.stance_width, 0.0])) is Feasibility.SAFE
    assert trial.placement(np.array([0.0, 0.07, 0.0])) is Feasibility.COLLISION  # its feet are 9 cm wide


def test_a_point_to_keep_may_lie_on_the_edge_of_what_is_allowed():
    corners = np.random.default_rng(5).uniform(-0.3, 0.3, (40, 2))
    corners = corners[ConvexHull(corners).vertices]
    for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        kept = p + np.linspace(0.1, 0.9, 9)[:, None] * (q - p)
        polygon = safe_polygon(np.vstack([corners, kept]), np.zeros((0, 2)), kept, 20)
        assert np.all(inside(polygon, kept, 1e-4))


def test_every_placement_tried_inside_a_polygon_was_safe(found):
    outcomes = np.array(found.outcomes)
    for region in found.regions:
        inside_of_it = outcomes[contains(region, found.placements)]
        assert len(inside_of_it) > SAMPLES // 10
        assert np.all(inside_of_it == Feasibility.SAFE)


def test_polygons_are_convex_with_few_corners_and_one_for_each_band_of_yaw(found):
    for region in found.regions:
        assert 3 <= len(region.vertices) <= MAX_VERTICES
        assert len(ConvexHull(region.vertices).vertices) == len(region.vertices)
        assert area(region.vertices) > 0.05
    assert all(one.highest_yaw == other.lowest_yaw for one, other in pairwise(found.regions))


def test_a_standing_robot_is_inside_of_the_region_of_straight_feet(found):
    straight = next(region for region in found.regions if region.lowest_yaw < 0.0 < region.highest_yaw)
    assert contains(straight, np.array([[0.0, load_robot("talos").stance_width, 0.0]]))[0]


def test_what_is_safe_at_all_yaws_lies_in_every_region(found):
    common = common_vertices(found.regions)
    middle = np.mean(common, axis=0)
    for region in found.regions:
        assert np.all(inside(region.vertices, middle + 0.99 * (common - middle)))


@pytest.mark.exhaustive
def test_the_same_seed_gives_the_same_polygons_with_one_worker_and_with_two(found):
    alone = study(load_robot("talos"), com_height=0.87, nb_samples=SAMPLES, seed=3, nb_workers=1, edge_spacing=0.5)
    assert summary(alone) == summary(found)
    assert np.array_equal(alone.placements, found.placements) and alone.outcomes == found.outcomes


def test_short_steps_are_tried_between_placements_that_the_foot_can_reach_in_their_swing(found):
    talos = load_robot("talos")
    short = StepFeasibility(talos, step_duration=found.shortest_step_duration)
    reach = talos.max_foot_speed[0] * 0.3
    here, there, beyond = (np.array([x, 0.2, 0.0]) for x in (-0.2, reach - 0.21, reach - 0.19))
    assert found.shortest_step_duration == pytest.approx(0.4)
    assert short.flies_in_time(here, there) and not short.flies_in_time(here, beyond)
    assert StepFeasibility(talos).flies_in_time(here, beyond)
    assert 0 < len(found.short_steps) < len(found.steps)
    assert found.short_steps.count(Feasibility.SAFE) >= 0.9 * len(found.short_steps)


def test_another_seed_tries_other_placements():
    assert np.array_equal(sampled_placements(50, 1), sampled_placements(50, 1))
    assert not np.any(sampled_placements(50, 1) == sampled_placements(50, 2))


def test_the_picture_and_the_tables_are_written(found, tmp_path):
    write(found, tmp_path / "out")
    assert sorted(os.listdir(tmp_path / "out")) == ["footholds.csv", "footholds.svg", "footholds.yaml"]
    assert len((tmp_path / "out" / "footholds.csv").read_text().splitlines()) == len(found.placements) + 1
    first = (tmp_path / "out" / "footholds.svg").read_bytes()
    write(found, tmp_path / "out")
    assert (tmp_path / "out" / "footholds.svg").read_bytes() == first


def test_a_robot_without_a_body_is_refused():
    with pytest.raises(InvalidValueError, match="body"):
        study(load_robot("hrp2"), com_height=None, nb_samples=SAMPLES, seed=0, nb_workers=1)


def test_too_few_samples_are_refused():
    with pytest.raises(InvalidValueError, match="samples"):
        study(load_robot("talos"), com_height=None, nb_samples=10, seed=0, nb_workers=1)


@pytest.mark.parametrize("seed", range(20))
def test_a_safe_polygon_leaves_out_what_is_forbidden_and_keeps_what_is_to_be_kept(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.0, 1.0, (300, 2))
    is_allowed = np.linalg.norm(points / [1.0, 0.7], axis=1) < 0.8
    kept = np.array([[0.0, 0.0]])
    corners = safe_polygon(points[is_allowed], points[~is_allowed], kept, 6)
    assert len(corners) <= 6
    assert inside(corners, kept)[0]
    assert not np.any(inside(corners, points[~is_allowed]))
    # Six corners on an ellipse enclose 83% of it; samples leave gaps along its rim.
    assert area(corners) > 0.7 * np.pi * 0.8 * 0.56


def test_points_that_cannot_be_cut_off_are_an_error():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    with pytest.raises(EmptyRegionError, match="cut off"):
        safe_polygon(square, np.array([[0.5, 0.5]]), np.array([[0.5, 0.5]]), 5)
    with pytest.raises(EmptyRegionError, match="enclose no area"):
        safe_polygon(square[:2], np.empty((0, 2)), square[:1], 5)


def test_a_band_of_yaws_without_a_region_is_named_with_what_to_do():
    placements = np.array([[0.1, 0.2, 0.0], [0.2, 0.2, 0.0], [0.1, 0.3, 0.0], [0.0, 0.2, -0.05]])
    with pytest.raises(
        EmptyRegionError, match="yaws of -0.09 to -0.03 rad, where 1 of 1 placements were.*try more samples"
    ):
        safe_regions(placements, [Feasibility.SAFE] * 4, 0.2)


def test_two_squares_have_their_overlap_in_common():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    assert area(intersection([square, square + 0.25])) == pytest.approx(0.75**2)
    with pytest.raises(EmptyRegionError, match="common"):
        intersection([square, square + 2.0])
