"""Truth of the scene with contact physics: what is drawn is what was measured."""

import numpy as np
import pinocchio as pin
import pytest
from scene_reader import latest

from app.viewer import LIGHT
from app.viewer.panel.plots_tab import PLOTS, plotted
from app.viewer.scene.foot_forces import HEIGHT_OF_WEIGHT
from app.viewer.scene.link_points import LinkPoints
from app.viewer.scene.scene import WORLD, Scene
from walkcore import Command, Parameters, Reference, Simulation, load_robot
from walkcore.motion.whole_body import WholeBody
from walkcore.mpc.stance import Side
from walkcore.plant.world import World

pytest.importorskip("mujoco", reason="mujoco-core is not installed on this platform")

from walkcore.plant.mujoco_model import build  # noqa: E402 (needs the package)

PHYSICS = Parameters(plant="mujoco", twin=True, dynamic_filter=True, initial_double_support_duration=0.3)


@pytest.fixture(scope="module")
def walked():
    simulation = Simulation(load_robot("talos"), PHYSICS)
    return [simulation.step(Command(Reference(vx=0.2))) for _ in range(140)]


@pytest.fixture
def scene(viser_server) -> Scene:
    scene = Scene(viser_server, load_robot("talos"), LIGHT)
    for layer in ("commanded", "measured_dcm"):
        scene.show(layer, True)
    return scene


def test_measured_and_commanded_body_twin_contact_cop_and_forces_are_drawn_where_they_are(scene, walked):
    snapshot = walked[-1]
    plant = snapshot.plant
    scene.draw(snapshot, PHYSICS, 1 / 30)
    at, visible, points = (latest(scene.updates, field) for field in ("position", "visible", "points"))
    bases = {"robot": plant.measured.q, "commanded/body": plant.q_commanded, "twin/body": snapshot.twin.q}
    for body, q in bases.items():
        assert at[f"{WORLD}/{body}/j1"] == pytest.approx(q[:3], abs=1e-5)
    assert at[f"{WORLD}/ground_cop/dot"][:2] == pytest.approx(plant.contact.cop, abs=1e-5)
    omega = snapshot.pendulum.omega
    dcm = plant.measured.com[:2] + plant.measured.com_velocity[:2] / omega - snapshot.com_offset
    assert at[f"{WORLD}/measured_dcm/dot"][:2] == pytest.approx(dcm, abs=1e-5)
    assert at[f"{WORLD}/com/mass"][:2] == pytest.approx(plant.measured.com[:2], abs=1e-5)
    weight = scene_weight = 0.0
    for side in Side:
        bar = f"{WORLD}/forces/{side.name.lower()}"
        assert visible[bar] is (plant.contact.forces[side] > 5.0)
        weight += plant.contact.forces[side] if visible[bar] else 0.0
        scene_weight += float(points[bar][0, 1, 2]) if visible[bar] else 0.0
    robot = load_robot("talos")
    assert scene_weight == pytest.approx(HEIGHT_OF_WEIGHT * weight / (robot.mass * 9.81), abs=0.01)


def test_without_physics_nothing_of_it_is_drawn(scene, walked):
    scene.draw(walked[-1], PHYSICS, 1 / 30)
    scene.draw(walked[-1].twin, PHYSICS, 1 / 30)
    visible = latest(scene.updates, "visible")
    nodes = ("commanded/body", "twin/body", "ground_cop/dot", "measured_dcm/dot", "forces/left", "forces/right")
    assert not any(visible[f"{WORLD}/{node}"] for node in nodes)


def test_strips_are_drawn_where_the_plant_has_them_and_not_in_the_perfect_world(scene, walked):
    model = build(load_robot("talos"), WholeBody(load_robot("talos").body).model, World(strip_height=0.02), 9.81).model
    boxes = [k for k in range(model.ngeom) if model.geom_type[k] == 6 and model.geom_bodyid[k] == 0]
    tops = {round(float(model.geom_pos[k][0]), 6): model.geom_size[k] + model.geom_pos[k] for k in boxes}
    scene.draw(walked[-1], PHYSICS, 1 / 30, world=World(strip_height=0.02))
    node = f"{WORLD}/strips/mesh"
    corners = latest(scene.updates, "vertices")[node].reshape(-1, 8, 3)
    assert latest(scene.updates, "visible")[node] and len(corners) == 24
    for strip in corners:
        middle = round(float(strip[:, 0].mean()), 6)
        assert strip[:, 0].max() == pytest.approx(tops[middle][0])
        assert strip[:, 2].max() == pytest.approx(tops[middle][2])
    scene.draw(walked[-1], PHYSICS, 1 / 30)
    assert not latest(scene.updates, "visible")[node]


def test_ground_that_rises_is_drawn_so_and_a_held_point_stays_where_it_is(scene, walked):
    snapshot, points = (
        walked[-1],
        LinkPoints(load_robot("talos").body, scene.links, lambda: (scene.rotation, scene.origin)),
    )
    scene.draw(snapshot, PHYSICS, 1 / 30, world=World(slope=0.1))
    ahead = scene.rotation @ [1.0, 0.0, 0.0]
    assert ahead[2] == pytest.approx(np.sin(0.1)) and ahead[0] > 0.9
    w, x, y, z = latest(scene.updates, "wxyz")[WORLD]
    np.testing.assert_allclose(pin.Quaternion(w, x, y, z).matrix(), scene.rotation, atol=1e-4)
    assert latest(scene.updates, "position")[WORLD] == pytest.approx(scene.origin, abs=1e-5)
    node, link = next(iter(scene.links.items()))
    held = np.array([0.2, 0.1, 0.9])
    _, point = points.grabbed(node, held, snapshot)
    assert points.in_scene(link, point, snapshot) == pytest.approx(held)


def test_plots_hold_the_contact_cop_the_dcm_error_and_the_forces(walked):
    for snapshot in walked[100:]:
        values = plotted(snapshot)
        assert len(values) == sum(len(plot.lines) for plot in PLOTS.values()) - 1  # the last one is the time of a tick
        assert values[-2:] == [snapshot.plant.contact.forces[side] for side in Side]
        assert np.hypot(*values[-4:-2]) == pytest.approx(np.hypot(*snapshot.plant.dcm_error))
        contact = np.array([values[6], values[11]])
        assert np.hypot(*contact) == pytest.approx(np.hypot(*(snapshot.plant.contact.cop - snapshot.support.position)))
