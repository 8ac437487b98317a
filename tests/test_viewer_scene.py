"""What the scene says of a walk is true of it."""

import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from app.drawing.outlines import carriers, is_caught
from app.viewer import LIGHT
from app.viewer.panel.method_tab import MethodTab
from app.viewer.panel.plots_tab import _row
from app.viewer.panel.view_tab import DEFAULTS, ViewTab
from app.viewer.scene.constraints import binding
from app.viewer.scene.grab import Grab, on_ground
from app.viewer.scene.layers import LAYERS
from app.viewer.scene.markers import points_of, previews_of
from app.viewer.scene.robot_mesh import BodyPart, _closed
from app.viewer.scene.scene import Scene
from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status
from walkcore.mpc.regions import polygon
from walkcore.mpc.stance import sole_vertices

PAPER = Parameters(control_period=0.1)  # ticks are samples: a plan's first sample is the next snapshot
WALK = [(1.0, Reference()), (4.0, Reference(vx=0.25, vy=0.1)), (3.0, Reference(yaw_rate=0.3)), (4.0, Reference())]


def walk(parameters: Parameters = PAPER, robot: str = "hrp2") -> list[Any]:
    simulation = Simulation(load_robot(robot), parameters)
    return [
        simulation.step(Command(reference))
        for seconds, reference in WALK
        for _ in range(round(seconds / parameters.control_period))
    ]


def values(scene: Scene, kind: str) -> dict[str, Any]:
    return {name: value for (message, name, _), value in scene.stream._values.items() if message == kind}


def test_links_are_where_forward_kinematics_puts_them(viser_server):
    robot = load_robot("talos")
    scene = Scene(viser_server, robot, LIGHT)
    simulation = Simulation(robot, Parameters())
    for _ in range(300):
        snapshot = simulation.step(Command(Reference(vx=0.3)))
    scene.draw(snapshot, simulation.parameters, 0.03)
    model = pin.buildModelFromUrdf(str(robot.body.urdf), pin.JointModelFreeFlyer())
    data = model.createData()
    pin.forwardKinematics(model, data, snapshot.q)
    turned, moved = values(scene, "SetOrientationMessage"), values(scene, "SetPositionMessage")
    nodes = list(scene._robot._joints)
    assert len(nodes) > 25
    for name in nodes:
        joint = int(name.rsplit("/j", 1)[1])
        pose = np.eye(4)
        for depth in range(len("/w/robot/".split("/")), len(name.split("/")) + 1):
            node = "/".join(name.split("/")[:depth])
            handle = viser_server.scene._handle_from_node_name[node]
            w, x, y, z = turned[node]
            local = np.eye(4)
            local[:3, :3] = Rotation.from_quat([x, y, z, w]).as_matrix()
            local[:3, 3] = moved.get(node, handle.position)
            pose = pose @ local
        assert pose == pytest.approx(data.oMi[joint].homogeneous, abs=5e-4)


def test_hidden_layers_are_not_sent_and_shown_ones_are(viser_server):
    snapshots = walk()
    scene = Scene(viser_server, load_robot("hrp2"), LIGHT)
    for snapshot in snapshots[10:20]:
        scene.draw(snapshot, PAPER, 0.1)
    hidden = [name for name, layer in LAYERS.items() if not layer.is_on]
    assert {"capture_point", "margin", "regions", "active", "velocity"} <= set(hidden)
    drawn = {message.get("name", "") for message in scene.stream.changes(0)}
    assert not [
        name for name in drawn for layer in ("capture_point", "regions", "active", "velocity") if f"/{layer}/" in name
    ]
    for layer in LAYERS:
        scene.show(layer, True)
    for snapshot in snapshots[20:40]:
        scene.draw(snapshot, PAPER, 0.1)
    drawn = {message.get("name", "") for message in scene.stream.changes(0)}
    for layer in set(LAYERS) - {"push", "trails", "preview"}:  # the two are drawn with each point
        assert [name for name in drawn if name.startswith(f"/w/{layer}/")], layer


def test_layers_that_a_program_switches_are_drawn_or_hidden_and_shown_by_their_switches(viser_server):
    scene = Scene(viser_server, load_robot("hrp2"), LIGHT)
    tab = ViewTab(viser_server, scene)
    assert tab.layers == DEFAULTS
    tab.switch({"capture_point": True, "robot": False})
    wait_until = time.monotonic() + 10.0
    while "robot" in scene._shown and time.monotonic() < wait_until:
        time.sleep(0.01)
    assert scene._shown == {name for name, is_on in tab.layers.items() if is_on}
    assert scene._shown ^ {name for name, is_on in DEFAULTS.items() if is_on} == {"capture_point", "robot"}


def test_previews_are_what_comes_to_be():
    omega = 3.5
    for before, after in zip(walk()[15:40], walk()[16:], strict=False):
        previews = previews_of(before, omega)
        if before.plan.status is not Status.SOLVED or np.any(after.push):
            continue
        assert previews["capture_point"][0] == pytest.approx(points_of(before, omega)["capture_point"], abs=1e-12)
        assert previews["capture_point"][1] == pytest.approx(points_of(after, omega)["capture_point"], abs=1e-9)
        assert previews["com"][1] == pytest.approx(after.com.position, abs=1e-9)


def test_every_sample_of_a_plan_stands_within_what_is_said_to_carry_it():
    robot = load_robot("hrp2")
    nb_alone = nb_both = 0
    for snapshot in walk():
        feet_of = carriers(snapshot, PAPER)
        assert len(feet_of) == len(snapshot.plan.cop)
        if snapshot.plan.status is not Status.SOLVED:
            continue
        for feet, cop in zip(feet_of, snapshot.plan.cop, strict=True):
            corners = np.vstack([sole_vertices(robot.sole, foot) for foot in feet])
            assert polygon(corners).excess(cop) < 1e-4 - PAPER.cop_margin
            nb_alone, nb_both = nb_alone + (len(feet) == 1), nb_both + (len(feet) == 2)
    assert nb_alone > 500 and nb_both > 100


def test_binding_constraints_are_those_that_the_plan_touches():
    robot = load_robot("hrp2")
    lit = [binding(robot, snapshot, PAPER) for snapshot in walk()]
    assert max(map(len, lit)) >= 2
    still = Parameters(control_period=0.1, alpha=1e3, cop_margin=0.0)
    assert binding(robot, Simulation(robot, still).step(), still) == []  # standing in the middle of both feet


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
@pytest.mark.parametrize("pitch", [0.0, 0.4, 1.5])
def test_drag_across_the_screen_is_a_way_on_the_ground(yaw, pitch):
    heading = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    forward = np.cos(pitch) * heading - np.sin(pitch) * np.array([0.0, 0.0, 1.0])
    right = np.array([heading[1], -heading[0], 0.0])
    down = np.cross(forward, right)
    x, y, z, w = Rotation.from_matrix(np.column_stack([right, down, forward])).as_quat()
    camera = np.array([w, x, y, z])
    assert on_ground(0.3 * right, camera) == pytest.approx(0.3 * right[:2])
    assert on_ground(-0.2 * down, camera) == pytest.approx(0.2 * heading[:2])


class Hand:
    """Drags by a client whose camera looks along x."""

    def __init__(self, grab: Grab) -> None:
        camera = Rotation.from_matrix(np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])).as_quat()
        self._client = SimpleNamespace(camera=SimpleNamespace(wxyz=np.roll(camera, 1)))
        self._grab = grab

    def drag(self, phase: str, *way: float, client: int = 1) -> None:
        end = (0.0, -way[0], way[1])  # right, up
        event = SimpleNamespace(
            phase=phase, client_id=client, client=self._client, start_position=(0.0, 0.0, 0.0), end_position=end
        )
        try:
            self._grab._drag(event).send(None)  # type: ignore[arg-type]  # it awaits nothing
        except StopIteration:
            pass


@pytest.fixture
def runner():
    robot = load_robot("talos")
    pushes: list[Any] = []
    changes: list[dict[str, Any]] = []

    def change(wished: dict[str, Any]) -> Any:
        changes.append(wished)
        parameters = Parameters().changed(wished)
        runner.parameters = parameters
        return SimpleNamespace(result=lambda timeout: parameters)

    def push(push: Any) -> None:
        pushes.append(robot.check_push(push))

    runner = SimpleNamespace(
        robot=robot, pushes=pushes, push=push, parameters=Parameters(), changes=changes, change=change
    )
    runner.defaults = runner.parameters
    return runner


@pytest.fixture
def hand(viser_server, runner, monkeypatch):
    monkeypatch.setattr(viser_server, "get_clients", lambda: {1: None, 2: None})
    return Hand(Grab(viser_server, runner, []))


def test_letting_go_of_a_drag_pushes_along_it_and_no_harder_than_allowed(hand, runner):
    hand.drag("start", 0.0, 0.0)
    hand.drag("update", 0.2, 0.0)
    assert runner.pushes == [] and hand._grab.impulse == pytest.approx([0.0, -12.0])
    hand.drag("end", 0.0, 0.3)
    assert runner.pushes[0].impulse == pytest.approx([18.0, 0.0]) and runner.pushes[0].frame == "world"
    hand.drag("start", 0.0, 0.0)
    hand.drag("end", 7.0, 0.0)
    assert np.linalg.norm(runner.pushes[1].impulse) == pytest.approx(runner.robot.max_push)
    for angle in np.linspace(0.0, 6.0, 50):  # in no direction is it beyond the limit by a rounding
        hand.drag("start", 0.0, 0.0)
        hand.drag("end", 3.0 * np.cos(angle), 3.0 * np.sin(angle))
    assert len(runner.pushes) == 52
    assert hand._grab.impulse is None


@pytest.mark.parametrize("end", [(0.0, 0.0), (0.01, 0.03), (np.nan, 0.0), (1e9, 0.0)])
def test_drag_that_goes_back_or_nowhere_gives_nothing(hand, runner, end):
    hand.drag("start", 0.0, 0.0)
    hand.drag("update", 0.4, 0.0)
    hand.drag("end", *end)
    assert runner.pushes == []


def test_escape_another_hand_and_a_lost_browser_give_nothing(hand, runner, viser_server, monkeypatch):
    hand.drag("start", 0.3, 0.0)
    hand._grab._let_go()
    hand.drag("update", 0.3, 0.0)
    hand.drag("end", 0.3, 0.0)
    hand.drag("start", 0.3, 0.0)
    hand.drag("start", 0.3, 0.0, client=2)
    hand.drag("end", 0.3, 0.0)
    assert runner.pushes == []
    monkeypatch.setattr(viser_server, "get_clients", lambda: {1: None})
    hand.drag("end", 0.3, 0.0, client=2)
    assert runner.pushes == []


def shell(side: float) -> trimesh.Trimesh:
    """A box without its lid."""
    box = trimesh.creation.box((side, side, side))
    box.update_faces(box.face_normals[:, 2] < 0.5)
    return box


def test_small_openings_of_a_shell_are_closed_and_large_ones_left():
    assert not shell(0.09).is_watertight
    closed = _closed(shell(0.09))
    assert closed.is_watertight and closed.volume == pytest.approx(0.09**3)
    assert not _closed(shell(0.5)).is_watertight


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


def test_plots_show_the_cop_within_its_bounds_and_the_velocity_that_is_asked():
    robot = load_robot("hrp2")
    for snapshot in walk():
        forward, asked, left, asked_left, *cops = _row(robot, snapshot)
        assert (asked, asked_left) == (snapshot.reference.vx, snapshot.reference.vy)
        assert np.hypot(forward, left) == pytest.approx(np.linalg.norm(snapshot.com.velocity))
        for cop, true_cop, low, high in (cops[:4], cops[4:]):
            assert low - 1e-6 <= cop <= high + 1e-6 and true_cop == cop  # a point mass


class Client:
    """Who changes the method, and what it is told."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def add_notification(self, title: str, body: str, color: str) -> None:
        self.told.append(body)


def test_typed_parameters_are_applied_together_and_refusals_told(viser_server, runner):
    tab, client = MethodTab(viser_server, runner), Client()
    event = SimpleNamespace(client=client)
    tab._apply(event)
    assert runner.changes == []  # nothing was typed
    tab._numbers["alpha"].value, tab._numbers["horizon_samples"].value = "2e-5", "24"
    tab._apply(event)
    assert runner.changes == [{"alpha": 2e-5, "horizon_samples": 24}] and client.told == []

    tab._numbers["gamma"].value = "a lot"
    tab._apply(event)
    assert "not a number" in client.told[0] and tab._numbers["gamma"].value == "1e-06"
    tab._numbers["gamma"].value = "-1"
    tab._apply(event)
    assert "gamma" in client.told[1] and tab._numbers["gamma"].value == "1e-06"

    tab._restore(event)
    tab.follow()
    assert runner.parameters == runner.defaults and tab._numbers["alpha"].value == "1e-06"


def test_scheme_of_mean_velocity_gets_the_horizon_that_it_needs(viser_server, runner):
    tab, event = MethodTab(viser_server, runner), SimpleNamespace(client=Client())
    tab._scheme.value = next(label for label in tab._scheme.options if label.startswith("mean_velocity"))
    tab._change_scheme(event)
    assert runner.parameters.scheme == "mean_velocity" and runner.parameters.horizon_samples == 32


def test_every_layer_has_a_meaning_and_those_of_one_colour_are_told_apart():
    assert all(layer.meaning for layer in LAYERS.values())
    colours = [layer.colour for name, layer in LAYERS.items() if layer.colour and name != "velocity"]
    assert len(set(colours)) == len(colours)


@pytest.mark.parametrize(
    ("impulse", "verdict"),
    [([0.0, 10.0], "stands"), ([15.0, 0.0], "steps"), ([25.0, 0.0], "fall")],
    ids=["light", "harder", "hopeless"],
)
def test_preview_of_a_push_on_a_standing_robot_tells_what_comes_of_it(viser_server, impulse, verdict):
    robot, parameters = load_robot("hrp2"), Parameters()
    scene, simulation = Scene(viser_server, robot, LIGHT), Simulation(robot, parameters)
    now, command = simulation.step(), Command(push=Push(impulse))
    answer = simulation.preview(command)
    scene.aim(now, parameters, np.array(impulse), answer)
    assert scene.stream._values["SceneNodeUpdateMessage", "/w/push/preview/at_com/label", "text"].endswith(verdict)
    shown = [name for name, is_shown in values(scene, "SetSceneNodeVisibilityMessage").items() if is_shown]
    assert bool([name for name in shown if "/steps/" in name]) is bool(answer.plan.footholds)
    capture = values(scene, "SetPositionMessage")["/w/push/preview/capture_point"][:2]
    omega = np.sqrt(parameters.gravity / now.com_height)
    assert capture == pytest.approx(now.com.position + np.array(impulse) / robot.mass / omega, abs=1e-4)

    came = [simulation.step(command), *(simulation.step() for _ in range(400))]
    assert is_caught(robot, answer, parameters) is (came[-1].status is not Status.FALLEN)
    assert (verdict == "stands") is all(snapshot.phase is Phase.STANDING for snapshot in came)


def test_every_sample_is_carried_while_the_steps_become_shorter():
    simulation = Simulation(load_robot("hrp2"))
    for tick in range(900):
        if tick == 620:  # in the middle of a step, which keeps its duration
            simulation.change(simulation.parameters.changed({"step_duration": 0.4}))
        snapshot = simulation.step(Command(Reference(vx=0.1)))
        assert snapshot.plan is not None
        assert len(carriers(snapshot, simulation.parameters)) == len(snapshot.plan.times)
