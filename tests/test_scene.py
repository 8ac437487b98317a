"""Truth of the scene: every node stands for something in the snapshot."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from scene_reader import latest
from scipy.spatial.transform import Rotation
from shapely import Point, Polygon

from app.drawing.palette import COP, DCM
from app.viewer import LIGHT
from app.viewer.panel.panel import ViewTab
from app.viewer.scene.footprints import sole_outline
from app.viewer.scene.frame import PRINTS_PER_FOOT, TRAIL_POINTS, Canvas, Frame
from app.viewer.scene.layers import LAYERS, Layer
from app.viewer.scene.primitives import dot_picture
from app.viewer.scene.robot import LYING, Topple
from app.viewer.scene.robot_mesh import BodyPart, closed
from app.viewer.scene.scene import SECTION, WORLD, Scene
from app.viewer.transport.client_registry import ClientRegistry
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import Command, Parameters, Reference, Simulation, load_robot
from walkcore.motion.body_model import load_model
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Footstep, Side
from walkcore.plant.fall_watch import needed_step

FRAME = 7  # ticks
FRAME_TIME = 1 / 30  # [s]
REFERENCE = Reference(vx=0.3, vy=0.1, yaw_rate=0.3)


@pytest.fixture(scope="module")
def walk() -> list[Any]:
    """Drawn snapshots of 10 s, walked by a point mass."""
    simulation = Simulation(load_robot("hrp2"), Parameters())
    return [simulation.step(Command(REFERENCE)) for _ in range(2000)][::FRAME]


def draw(scene: Scene, *snapshots: Any, **more: Any) -> None:
    for snapshot in snapshots:
        scene.draw(snapshot, Parameters(), FRAME_TIME, **more)


def test_links_are_where_forward_kinematics_puts_them(viser_server):
    robot = load_robot("talos")
    scene = Scene(viser_server, robot, LIGHT)
    simulation = Simulation(robot, Parameters())
    for _ in range(300):
        snapshot = simulation.step(Command(Reference(vx=0.3)))
    scene.draw(snapshot, simulation.parameters, FRAME_TIME)
    model = load_model(robot.body)
    data = model.createData()
    pin.forwardKinematics(model, data, snapshot.q)
    turned, moved = latest(scene.updates, "wxyz"), latest(scene.updates, "position")
    nodes = [name for name in turned if name.startswith(f"{WORLD}/robot/")]
    assert len(nodes) > 25
    for name in nodes:
        joint = int(name.rsplit("/j", 1)[1])
        pose = np.eye(4)
        for depth in range(len("/w/robot/".split("/")), len(name.split("/")) + 1):
            node = "/".join(name.split("/")[:depth])
            handle = viser_server.scene.get_handle_by_name(node)
            w, x, y, z = turned[node]
            local = np.eye(4)
            local[:3, :3] = Rotation.from_quat([x, y, z, w]).as_matrix()
            local[:3, 3] = moved.get(node, handle.position)
            pose = pose @ local
        assert pose == pytest.approx(data.oMi[joint].homogeneous, abs=5e-4)


def test_the_robot_stays_in_the_middle_of_an_endless_ground(scene, walk):
    for snapshot in walk:
        draw(scene, snapshot)
        at = latest(scene.updates, "position")
        middle, ground = np.array(at[WORLD][:2]), np.array(at[f"{WORLD}/ground"][:2])
        assert np.hypot(*(middle + snapshot.com.position)) < 0.3
        assert np.all(np.abs(ground + middle) <= SECTION / 2 + 1e-5) and np.all(ground % SECTION == 0.0)
    assert np.hypot(*walk[-1].com.position) > 1.0
    draw(scene, walk[0])  # reset: no slow way back
    middle = np.array(latest(scene.updates, "position")[WORLD][:2])
    assert np.hypot(*(middle + walk[0].com.position)) < 1.0


def test_hidden_layers_are_not_sent_and_shown_ones_are(scene, walk):
    hidden = {name for name, layer in LAYERS.items() if not layer.is_on}
    assert {"margin", "regions", "active", "velocity"} <= hidden

    def drawn() -> set[str]:
        return {message["name"].split("/")[2] for message in scene.updates.changes(0) if message["name"].count("/") > 2}

    draw(scene, *walk[100:120])
    assert not drawn() & hidden
    for layer in LAYERS:
        scene.show(layer, True)
    draw(scene, *walk[120:140])
    # Trails and previews are drawn with each point, and see-through changes the robot.
    assert drawn() == set(LAYERS) - {"trails", "preview", "see_through"}


class Heading:
    """An example of a layer: a frame that turns with the robot."""

    def __init__(self, canvas: Canvas) -> None:
        self._node = f"{canvas.root}/axes"
        canvas.server.scene.add_frame(self._node, axes_length=0.3, axes_radius=0.01)

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        updates.on_ground(self._node, frame.snapshot.com.position, frame.snapshot.heading)


def test_a_new_layer_is_one_entry(viser_server, walk, monkeypatch):
    layer = Layer("heading", "Direction that the robot faces", (1, 2, 3), Heading)
    monkeypatch.setitem(LAYERS, "heading", layer)
    scene = Scene(viser_server, load_robot("hrp2"), LIGHT)
    tab = ViewTab(viser_server, scene, ClientRegistry(viser_server))
    draw(scene, walk[-1])
    x, y, _ = latest(scene.updates, "position")[f"{WORLD}/heading/axes"]
    assert (x, y) == pytest.approx(walk[-1].com.position, abs=1e-4)
    assert tab.layers.of("")["heading"] is True


def test_every_layer_has_a_meaning_and_those_of_one_colour_are_told_apart():
    assert all(layer.meaning for layer in LAYERS.values())
    colours = [layer.colour for name, layer in LAYERS.items() if layer.colour and name != "velocity"]
    assert len(set(colours)) == len(colours)


def test_footprints_are_where_feet_stood(scene, walk):
    stood: list[list[float]] = []
    for snapshot in walk:
        draw(scene, snapshot)
        stood += [foot.position.tolist() for foot in snapshot.feet.values() if foot.height == 0.0]
    visible, at = latest(scene.updates, "visible"), latest(scene.updates, "position")
    prints = [name for name, is_visible in visible.items() if "/footprints/" in name and is_visible]
    assert len(prints) == 2 * PRINTS_PER_FOOT
    for name in prints:
        assert np.min(np.linalg.norm(np.array(stood) - at[name][:2], axis=1)) < 1e-4
    assert len({at[name][:2] for name in prints}) == len(prints)
    draw(scene, walk[0])  # reset
    visible = latest(scene.updates, "visible")
    assert [name for name in prints if visible[name]] == [f"{WORLD}/footprints/{side}_0" for side in ("left", "right")]


def test_footprints_and_trails_hold_what_happened_while_they_were_hidden(scene, walk):
    scene.show("footprints", False)
    draw(scene, *walk)
    for layer in ("footprints", "trails"):
        scene.show(layer, True)
    draw(scene, walk[-1], walk[-1], walk[-1])
    visible = latest(scene.updates, "visible")
    assert sum(visible[name] for name in visible if "/footprints/" in name) == 2 * PRINTS_PER_FOOT
    trail = latest(scene.updates, "points")[f"{WORLD}/com/at_com/trails/trail"]
    assert trail.shape == (TRAIL_POINTS - 1, 2, 3)
    assert np.hypot(*trail[0, 0, :2]) > 0.3  # two seconds ago


def test_lines_start_at_the_point_and_follow_the_plan(scene, walk):
    for layer in LAYERS:
        scene.show(layer, True)
    snapshot = walk[200]
    draw(scene, snapshot, snapshot, snapshot)
    points, com = latest(scene.updates, "points"), snapshot.com.position
    for layer, now, later in (("com", com, snapshot.plan.com), ("capture_point", snapshot.dcm, snapshot.plan.dcm)):
        line = points[f"{WORLD}/{layer}/at_com/preview/line"][:, :, :2]
        assert line[:, 0] == pytest.approx(np.vstack([now, later[:-1]]) - com, abs=1e-4)
        assert line[:, 1] == pytest.approx(later - com, abs=1e-4)


def test_no_centre_of_pressure_is_drawn_off_the_soles(scene, walk):
    snapshot = walk[200]
    inside, corners = snapshot.stance.polygon.mean(axis=0), snapshot.stance.polygon

    def drawn(**changes: Any) -> tuple[np.ndarray, bool]:
        draw(scene, replace(snapshot, **changes))
        dot = f"{WORLD}/true_cop/dot"
        return np.array(latest(scene.updates, "position")[dot][:2]), latest(scene.updates, "visible")[dot]

    assert drawn(true_cop=inside)[0] == pytest.approx(inside, abs=1e-4)
    outside = corners[0] + 3.0 * (corners[0] - inside)
    place, is_visible = drawn(true_cop=outside)
    assert is_visible and Polygon(corners).exterior.distance(Point(place)) < 1e-4
    assert np.linalg.norm(place - outside) == pytest.approx(Polygon(corners).distance(Point(outside)), abs=1e-4)
    assert not drawn(true_cop=inside, status=Status.FALLEN)[1]


def test_dots_have_the_colour_of_the_legend_and_a_ring_shows_what_is_in_it():
    disc, ring = dot_picture(DCM), dot_picture(COP, hole=0.5)
    middle = len(disc) // 2
    assert disc[middle, middle].tolist() == [*DCM, 255] and disc[0, 0, 3] == 0
    assert ring[middle, middle, 3] == 0
    assert ring[middle, round(0.125 * len(ring))].tolist() == [*COP, 255]  # between the hole and the edge


@pytest.mark.parametrize("is_double_support", [False, True])
def test_support_polygon_is_the_hull_of_the_soles_on_the_ground_and_margin_lies_inside(scene, walk, is_double_support):
    scene.show("margin", True)
    snapshot = next(each for each in walk[50:] if each.stance.is_double_support is is_double_support)
    draw(scene, snapshot)
    visible, at = latest(scene.updates, "visible"), latest(scene.updates, "position")
    turned, vertices = latest(scene.updates, "wxyz"), latest(scene.updates, "vertices")

    def drawn(layer: str) -> Polygon:
        (name,) = (name for name in visible if name.startswith(f"{WORLD}/{layer}/") and visible[name])
        w, x, y, z = turned[name]
        rotation = Rotation.from_quat([x, y, z, w]).as_matrix()[:2, :2]
        return Polygon(at[name][:2] + vertices[f"{name}/fill"][:, :2] @ rotation.T)

    soles = []
    for side in Side if is_double_support else [snapshot.support.side]:
        foot = snapshot.feet[side]
        c, s = np.cos(foot.yaw), np.sin(foot.yaw)
        soles.append(foot.position + sole_outline(load_robot("hrp2"), side) @ np.array([[c, s], [-s, c]]))
    hull, support, inner = Polygon(np.vstack(soles)).convex_hull, drawn("support"), drawn("margin")
    assert support.symmetric_difference(hull).area < 1e-4
    assert inner.area > 0.0 and inner.buffer(Parameters().cop_margin - 1e-3).within(support.buffer(1e-4))


def test_a_robot_that_lies_has_no_support_polygon(scene, walk):
    fallen = replace(walk[100], status=Status.FALLEN, plan=None)
    for snapshot, expected in ((walk[99], 1), (fallen, 0), (walk[101], 1)):
        draw(scene, snapshot)
        visible = latest(scene.updates, "visible")
        assert sum(is_shown for name, is_shown in visible.items() if name.startswith(f"{WORLD}/support/")) == expected


def test_after_a_fall_the_step_that_was_needed_is_drawn_beyond_the_region(scene, walk):
    support = Footstep(Side.RIGHT, np.array([1.0, 2.0]), np.pi / 2)
    region = np.array([[-0.3, 0.15], [0.4, 0.15], [0.4, 0.45], [-0.3, 0.45]])
    step = needed_step(support, np.array([0.72, 0.3]), region, load_robot("hrp2").sole)
    fallen = replace(walk[100], status=Status.FALLEN, plan=None, needed_step=step)
    for snapshot, is_there in ((walk[99], False), (fallen, True), (walk[0], False)):
        draw(scene, snapshot)
        seen = latest(scene.updates, "visible")
        assert seen[f"{WORLD}/needed_step/region"] is seen[f"{WORLD}/needed_step/step/left_0"] is is_there
        assert not seen[f"{WORLD}/needed_step/step/right_0"]
        if is_there:
            x, y, _ = latest(scene.updates, "position")[f"{WORLD}/needed_step/step/left_0"]
            assert (x, y) == pytest.approx((1.0 - 0.3, 2.0 + step.needed), abs=1e-3)


def test_active_bounds_are_lines_and_a_plan_without_any_has_none(scene, walk):
    scene.show("active", True)
    lines = f"{WORLD}/active/at_com/lines"
    nb_drawn = 0
    for snapshot in walk[::10]:
        draw(scene, snapshot, snapshot, snapshot)
        if latest(scene.updates, "visible")[lines]:
            nb_drawn += 1
            assert latest(scene.updates, "points")[lines].shape[1:] == (2, 3)
    assert nb_drawn > 10
    still = Parameters(alpha=1e3, cop_margin=0.0)
    snapshot = Simulation(load_robot("hrp2"), still).step()  # standing in the middle of both feet
    draw(scene, snapshot, snapshot, snapshot)
    assert latest(scene.updates, "visible")[lines] is False


def shell(side: float) -> trimesh.Trimesh:
    """A box without its lid."""
    box = trimesh.creation.box((side, side, side))
    box.update_faces(box.face_normals[:, 2] < 0.5)
    return box


def test_small_openings_of_a_shell_are_closed_and_large_ones_left():
    assert not shell(0.09).is_watertight
    mesh = closed(shell(0.09))
    assert mesh.is_watertight and mesh.volume == pytest.approx(0.09**3)
    assert not closed(shell(0.5)).is_watertight


def test_quantised_part_is_the_part():
    part = BodyPart(
        1,
        (0, 0, 0),
        np.random.default_rng(0).uniform(-0.4, 0.6, (500, 3)).astype(np.float32),
        np.zeros((7, 3), np.uint32),
    )
    vertices, faces, step = part.quantised()
    assert vertices.dtype == np.int16 and faces.dtype == np.uint16
    assert vertices * step == pytest.approx(part.vertices, abs=2e-5)


def test_body_without_physics_topples_about_the_edge_of_its_support_and_stands_up_again(walk):
    updates, topple, snapshot = SceneUpdates(), Topple("/body"), walk[200]
    fallen = replace(snapshot, status=Status.FALLEN, plan=None)

    def turned(snapshot: Any) -> tuple[Rotation, np.ndarray]:
        topple.update(updates, SimpleNamespace(snapshot=snapshot, elapsed=FRAME_TIME))  # pyright: ignore
        wxyz = latest(updates, "wxyz")["/body"]
        return Rotation.from_quat([*wxyz[1:], wxyz[0]]), np.array(latest(updates, "position")["/body"])

    tilts = [turned(fallen)[0].magnitude() for _ in range(60)]
    assert np.all(np.diff(tilts) >= 0.0) and tilts[-1] == pytest.approx(LYING, abs=1e-3)
    rotation, shift = turned(fallen)
    com = np.array([*snapshot.com.position, snapshot.com_height])
    lying = rotation.apply(com) + shift
    assert 0.0 < lying[2] < 0.4
    way = snapshot.com.position - snapshot.stance.polygon.mean(axis=0)
    assert (lying[:2] - com[:2]) @ way / np.linalg.norm(way) > 0.5  # to where it leant
    assert turned(snapshot)[0].magnitude() == 0.0
