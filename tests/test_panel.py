"""The panel beside the scene: plots, layers, parameters of the method."""

from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scene_reader import latest

from app.viewer import LIGHT
from app.viewer.panel.method_tab import MethodTab
from app.viewer.panel.panel import ViewTab
from app.viewer.panel.plots_tab import PLOTS, PlotsTab, plotted
from app.viewer.scene.layers import DEFAULT_LAYERS
from app.viewer.scene.robot import TRANSLUCENT
from app.viewer.scene.scene import Scene
from app.viewer.transport.client_registry import ClientRegistry
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import Command, Parameters, Reference, Simulation, WalkError, load_robot

DEFAULT_SHOWN = {name for name, is_on in DEFAULT_LAYERS.items() if is_on}
REFERENCES = [(4.0, Reference(vx=0.25, vy=0.1)), (3.0, Reference(yaw_rate=0.3)), (3.0, Reference())]


@pytest.fixture(scope="module")
def walk() -> list[Any]:
    """Snapshots of a walk with a turn and a stop, one for each sample."""
    simulation = Simulation(load_robot("hrp2"), Parameters(control_period=0.1))
    return [
        simulation.step(Command(reference)) for seconds, reference in REFERENCES for _ in range(round(10 * seconds))
    ]


def test_plots_hold_each_point_once_and_start_anew_after_a_reset(viser_server, walk):
    plots, updates = PlotsTab(viser_server), SceneUpdates()

    def times(snapshots: list[Any]) -> list[float]:
        for snapshot in snapshots:
            plots.record(SimpleNamespace(snapshot=snapshot, timing=SimpleNamespace(tick_ms=1.0)))
        plots.update(updates)
        sent = [message["updates"]["data"] for message in updates.changes(0)]
        assert len(sent) == len(plots.plots)
        assert [len(data) - 1 for data in sent] == [len(plot.lines) for plot in PLOTS.values()]
        return sent[0][0].tolist()

    first = times(walk[:30])
    both = times(walk[30:60])
    assert len(first) == 15 and len(both) == 30 and both[:15] == first
    assert np.all(np.diff(both) > 0.0)
    assert times(walk[59:60] * 4) == both  # paused
    assert max(times(walk[:10])) <= walk[9].t + 1e-6


def test_plots_of_an_ideal_walk_hide_physics_and_take_no_range_from_a_line_without_values(viser_server, walk):
    plots, updates = PlotsTab(viser_server), SceneUpdates()
    for snapshot in walk[:30]:
        plots.record(SimpleNamespace(snapshot=snapshot, timing=SimpleNamespace(tick_ms=1.0)))
    plots.update(updates)
    sent = [message["updates"] for message in updates.changes(0)]
    for (title, plot), values in zip(PLOTS.items(), sent, strict=True):
        assert values["visible"] is (title not in ("DCM error, measured against model [m]", "force on the soles [N]"))
        for line, data in zip(plot.lines, values["data"][1:], strict=True):
            is_scanned = line.series().get("auto", True)
            assert not (values["visible"] and is_scanned and np.isnan(data).any()), f"{title}: {line.label}"


def test_plots_show_the_cop_within_its_bounds_and_the_velocity_with_its_reference(walk):
    for snapshot in walk:
        forward, vx, left, vy, *cops = plotted(snapshot)[:14]
        assert (vx, vy) == (snapshot.reference.vx, snapshot.reference.vy)
        assert np.hypot(forward, left) == pytest.approx(np.linalg.norm(snapshot.com.velocity))
        for cop, true_cop, contact, low, high in (cops[:5], cops[5:]):
            assert np.isnan(contact)  # an ideal plant
            assert low - 1e-6 <= cop <= high + 1e-6 and true_cop == cop  # a point mass


def test_each_page_has_its_own_layers_in_its_scene_and_in_its_switches(viser_server):
    scene = Scene(viser_server, load_robot("talos"), LIGHT)
    layers = ViewTab(viser_server, scene, ClientRegistry(viser_server)).layers
    layers.switch("one", {"velocity": True, "robot": False, "trails": True, "see_through": True})
    assert layers.of("one") == DEFAULT_LAYERS | {"velocity": True, "robot": False, "trails": True, "see_through": True}
    assert layers.of("two") == layers.of_new_pages == DEFAULT_LAYERS
    chosen = {name for name, is_shown in layers.of("one").items() if is_shown}
    assert layers.drawn(["one"]) == chosen and layers.drawn(["two"]) == DEFAULT_SHOWN
    assert layers.drawn(["one", "two"]) == chosen | DEFAULT_SHOWN
    for page, is_changed in (("one", True), ("two", False)):
        updates = layers.updates(page)
        visible, opacity = latest(updates, "visible"), latest(updates, "opacity")
        assert visible["/w/velocity"] is is_changed and visible["/w/robot"] is not is_changed
        trails = [is_shown for name, is_shown in visible.items() if name.endswith("/at_com/trails")]
        assert trails == [is_changed] * 6 and len(opacity) > 20
        assert {value for value in opacity.values()} == {TRANSLUCENT if is_changed else None}
        boxes = [m["updates"]["value"] for m in updates.changes(0) if m["type"] == "GuiUpdateMessage"]
        assert boxes == list(layers.of(page).values())
    layers.switch_all({"margin": True})
    assert all(layers.of(page)["margin"] for page in ("one", "two", "three"))


def test_another_scene_takes_the_choices_over(viser_server):
    scene = Scene(viser_server, load_robot("hrp2"), LIGHT)
    before, after = (ViewTab(viser_server, scene, ClientRegistry(viser_server)).layers for _ in range(2))
    before.switch("one", {"robot": False})
    before.switch_all({"margin": True})
    after.take_over(before)
    for page in ("one", "two"):
        assert after.of(page) == before.of(page)


class Client:
    """Browser that changes the method and is shown refusals."""

    def __init__(self) -> None:
        self.shown: list[str] = []

    def add_notification(self, title: str, body: str, color: str, auto_close_seconds: float) -> None:
        self.shown.append(body)


@pytest.fixture
def runner():
    changes: list[dict[str, Any]] = []

    def change(values: dict[str, Any]) -> Future[Parameters]:
        changes.append(values)
        response: Future[Parameters] = Future()
        try:
            runner.parameters = runner.parameters.changed(values)
            response.set_result(runner.parameters)
        except WalkError as refusal:
            response.set_exception(refusal)
        return response

    runner = SimpleNamespace(robot=load_robot("talos"), parameters=Parameters(), changes=changes, change=change)
    return runner


def test_typed_parameters_are_applied_together_and_refusals_shown(viser_server, runner):
    tab, client = MethodTab(viser_server, runner), Client()
    event: Any = SimpleNamespace(client=client)
    tab.apply(event)
    assert runner.changes == []  # nothing was typed
    tab.numbers["alpha"].value, tab.numbers["horizon_samples"].value = "2e-5", "24"
    tab.apply(event)
    assert runner.changes == [{"alpha": 2e-5, "horizon_samples": 24}] and client.shown == []
    tab.update()

    tab.numbers["gamma"].value = "a lot"
    tab.apply(event)
    assert "not a number" in client.shown[0] and tab.numbers["gamma"].value == "1e-06"
    tab.numbers["gamma"].value = "-1"
    tab.apply(event)
    assert "gamma" in client.shown[1] and tab.numbers["gamma"].value == "1e-06"

    tab.restore(event)
    tab.update()
    assert runner.parameters == Parameters() and tab.numbers["alpha"].value == "1e-06"


def test_scheme_that_looks_far_ahead_gets_the_horizon_that_it_needs_and_returns_it(viser_server, runner):
    tab, event = MethodTab(viser_server, runner), SimpleNamespace(client=Client())
    for scheme, horizon in (("mean_velocity", 32), ("fixed_steps", 24), ("full", 16), ("preview_control", 24)):
        tab.scheme.value = next(label for label in tab.scheme.options if label.startswith(scheme))
        tab.change_scheme(event)
        assert runner.parameters.scheme == scheme and runner.parameters.horizon_samples == horizon
