import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import MultiPoint, Point

from walkcore.errors import EmptyRegionError
from walkcore.mpc.regions import box, half_planes
from walkcore.mpc.stance import Footstep, Side, on_side, sole_vertices
from walkcore.robot_file import load_robot
from walkcore.values import rotation

coordinates = st.integers(-1000, 1000).map(lambda millimetres: millimetres / 1000.0)
points = st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=8)
anywhere = st.floats(-1.0, 1.0)
yaws = st.floats(-np.pi, np.pi)


@given(points, coordinates, coordinates)
def test_half_planes_are_the_convex_hull(vertices, x, y):
    assert_is_hull(vertices, x, y)


@pytest.mark.exhaustive
@settings(max_examples=5000)
@given(st.lists(st.tuples(anywhere, anywhere), min_size=3, max_size=8), anywhere, anywhere)
def test_half_planes_are_the_convex_hull_of_corners_that_nearly_coincide(vertices, x, y):
    assert_is_hull(vertices, x, y)


def assert_is_hull(vertices, x, y):
    try:
        planes = half_planes(vertices)
    except EmptyRegionError:
        return
    assert max(planes.excess(vertex) for vertex in vertices) < 1e-9
    hull, point = MultiPoint(vertices).convex_hull, Point(x, y)
    if hull.covers(point):
        assert planes.excess([x, y]) == pytest.approx(-hull.boundary.distance(point), abs=1e-6)
    else:
        assert -1e-9 < planes.excess([x, y]) < hull.distance(point) + 1e-9


@given(yaws, coordinates, coordinates)
def test_turning_a_polygon_turns_its_points(yaw, x, y):
    sole = half_planes(load_robot("talos").sole)
    c, s = np.cos(yaw), np.sin(yaw)
    turned = np.array([[c, -s], [s, c]]) @ [x, y]
    assert sole.rotated(yaw).excess(turned) == pytest.approx(sole.excess([x, y]), abs=1e-12)


@pytest.mark.parametrize("turn", [1e-4, 5e-6, 1e-7])
def test_edges_that_are_almost_parallel_keep_their_own_normals(turn):
    vertices = (np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0 + turn)]) - 2.0) @ rotation(0.7)
    assert max(half_planes(vertices).excess(vertex) for vertex in vertices) < 1e-9


def test_opposite_edges_share_a_row():
    assert len(half_planes(load_robot("talos").sole).normals) == 2


def test_a_margin_moves_every_edge_inwards():
    sole = half_planes(load_robot("talos").sole)
    assert sole.inset(0.03).excess([0.0, 0.0]) == pytest.approx(sole.excess([0.0, 0.0]) + 0.03)


def test_a_margin_wider_than_the_sole_is_refused():
    with pytest.raises(EmptyRegionError):
        half_planes(load_robot("talos").sole).inset(0.07)


@pytest.mark.parametrize("vertices", [[], [[0, 0]], [[0, 0], [1, 1]], [[0, 0], [1, 1], [2, 2]]])
def test_points_without_area_are_refused(vertices):
    with pytest.raises(EmptyRegionError):
        half_planes(vertices)


def test_the_right_foot_lands_on_the_right():
    region = load_robot("talos").foothold_region
    assert np.all(on_side(Side.LEFT, region)[:, 1] > 0)
    assert np.all(on_side(Side.RIGHT, region)[:, 1] < 0)


def test_a_sole_turns_with_its_foot():
    outline = np.array([[0.1, 0.05], [-0.1, 0.05], [-0.1, -0.04]])
    foot = Footstep(Side.LEFT, np.array([1.0, 2.0]), np.pi / 2)
    assert np.allclose(sole_vertices(outline, foot)[0], [0.95, 2.1])
    mirrored = sole_vertices(outline, Footstep(Side.RIGHT, np.zeros(2), 0.0))
    assert np.allclose(mirrored[2], [-0.1, 0.04])


def test_box_is_bounded_on_all_sides():
    assert box([1.0, 2.0]).excess([1.5, 0.0]) == pytest.approx(0.5)
    assert box([1.0, 2.0]).excess([0.0, -2.5]) == pytest.approx(0.5)
