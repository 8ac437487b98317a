"""What is drawn from one frame to the next while a robot walks."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.viewer import LIGHT
from app.viewer.panel.plots_tab import PlotsTab
from app.viewer.scene.footprints import PRINTS_PER_FOOT
from app.viewer.scene.push_watch import PushWatch
from app.viewer.scene.scene import SECTION, WORLD, Scene
from app.viewer.transport.stream import Stream
from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot

FRAME = 7  # ticks
ASKED = Reference(vx=0.3, vy=0.1, yaw_rate=0.3)


@pytest.fixture(scope="module")
def walk() -> list[Any]:
    """Drawn snapshots of 10 s."""
    simulation = Simulation(load_robot("hrp2"), Parameters())
    return [simulation.step(Command(ASKED)) for _ in range(2000)][::FRAME]


def of_kind(stream: Stream, kind: str) -> dict[str, Any]:
    return {m["name"]: m for m in stream.changes(0) if m["type"] == kind}


@pytest.mark.parametrize("duration", [0.0, 0.03])
def test_pushes_between_two_frames_are_found_and_nothing_else(duration):
    robot = load_robot("hrp2")
    simulation, watch = Simulation(robot, Parameters()), PushWatch(robot.mass)
    impulse, found = np.array([-3.0, 7.0]), []
    for tick in range(1600):
        given = Push(impulse, duration, "world") if tick == 1003 else None
        snapshot = simulation.step(Command(ASKED, given))
        if tick % FRAME == 0:
            found.append(watch.impulse(snapshot))
    told = [one for one in found if one is not None]
    assert sum(told) == pytest.approx(impulse, rel=0.1) and len(told) <= 2
    assert found[1008 // FRAME] is not None


def test_the_robot_stays_in_the_middle_of_an_endless_ground(viser_server, walk):
    scene = Scene(viser_server, load_robot("hrp2"), LIGHT)
    for snapshot in walk:
        scene.draw(snapshot, Parameters(), 1 / 30)
        at = of_kind(scene.stream, "SetPositionMessage")
        middle = np.array(at[WORLD]["position"][:2])
        assert np.hypot(*(middle + snapshot.com.position)) < 0.3
        ground = np.array(at[f"{WORLD}/ground"]["position"][:2])
        assert np.all(np.abs(ground + middle) <= SECTION / 2 + 1e-5) and np.all(ground % SECTION == 0.0)
    assert np.hypot(*walk[-1].com.position) > 1.0
    scene.draw(walk[0], Parameters(), 1 / 30)  # reset: no slow way back
    middle = np.array(of_kind(scene.stream, "SetPositionMessage")[WORLD]["position"][:2])
    assert np.hypot(*(middle + walk[0].com.position)) < 1.0


def test_footprints_are_where_feet_stood(viser_server, walk):
    scene = Scene(viser_server, load_robot("hrp2"), LIGHT)
    stood: list[list[float]] = []
    for snapshot in walk:
        scene.draw(snapshot, Parameters(), 1 / 30)
        stood += [foot.position.tolist() for foot in snapshot.feet.values() if foot.height == 0.0]
    seen = of_kind(scene.stream, "SetSceneNodeVisibilityMessage")
    at = of_kind(scene.stream, "SetPositionMessage")
    prints = [name for name, m in seen.items() if "/footprints/" in name and m["visible"]]
    assert len(prints) == 2 * PRINTS_PER_FOOT
    for name in prints:
        assert np.min(np.linalg.norm(np.array(stood) - at[name]["position"][:2], axis=1)) < 1e-4
    places = {at[name]["position"][:2] for name in prints}
    assert len(places) == len(prints)


def test_plots_hold_each_point_once_and_begin_anew_after_a_reset(viser_server, walk):
    robot, stream = load_robot("hrp2"), Stream()
    plots = PlotsTab(viser_server, robot)

    def draw(snapshots: list[Any]) -> list[float]:
        for snapshot in snapshots:
            plots.record(SimpleNamespace(snapshot=snapshot, timing=SimpleNamespace(tick_ms=1.0)))
        plots.draw(stream)
        told = [m["updates"]["data"] for m in stream.changes(0) if m["type"] == "GuiUpdateMessage"]
        assert len(told) == len(plots._plots)
        return told[0][0].tolist()

    first = draw(walk[:30])
    both = draw(walk[30:60])
    assert len(first) == 15 and len(both) == 30 and both[:15] == first
    assert np.all(np.diff(both) > 0.0)
    assert draw(walk[59:60] * 4) == both  # paused
    assert max(draw(walk[:10])) <= walk[9].t + 1e-6
