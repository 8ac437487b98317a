"""Earlier ticks of the live walk by REST and in one browser's scene, while the others go on seeing the present."""

import asyncio
import json
import time
from contextlib import suppress
from types import SimpleNamespace

import httpx
import numpy as np
import pytest
from conftest import paused_walk, wait_for
from scene_reader import CAMERA, SceneSocket, latest
from websockets.sync.client import connect

from app.live.session_log import Session, SessionLog
from app.routes.past_run import RunTicks
from app.viewer.past_look import NodesThatExist, PastLook
from app.viewer.scene.frame import LIGHT
from app.viewer.scene.scene import Scene
from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.scenario.recording import record
from walkcore.scenario.scenario import scenario_from_mapping

pytestmark = pytest.mark.server("hrp2")


@pytest.fixture
def walk(api: httpx.Client) -> httpx.Client:
    """A paused walk of 300 ticks, with a push."""
    paused_walk(api, push=3.0, nb_ticks=300)
    return api


def rows(api: httpx.Client) -> bytes:
    """The recording of the walk, in bytes."""
    run = api.post("live/save", json={"name": "walk"}).raise_for_status().json()
    return api.get(f"runs/{run['id']}/recording.csv").raise_for_status().content


def test_a_fork_without_a_change_records_the_same_bytes(walk):
    was = rows(walk)
    assert was.count(b"\n") == 302
    live = walk.post("live/fork", json={"tick": 100}).raise_for_status().json()
    assert live["tick"] == 100 and live["driver"] == "past" and live["fork"]["tick"] == 100
    live = walk.post("live/step", json={"ticks": 200}).json()
    assert live["tick"] == 300 and live["fork"]["now"] == live["fork"]["was"]
    assert rows(walk) == was


def test_a_fork_with_a_change_is_compared_with_the_walk_that_was(walk):
    before = walk.get("live").json()
    live = walk.post("live/fork", json={"tick": 150, "push": {"impulse": [0.0, 30.0]}}).raise_for_status().json()
    assert live["walk"] == before["walk"] + 1
    live = walk.post("live/step", json={"ticks": 150}).json()
    assert live["com_y"] != before["com_y"]
    now, was = live["fork"]["now"], live["fork"]["was"]
    assert now["recovery"]["impulse"] != was["recovery"]["impulse"] and now["cop_margin"] <= was["cop_margin"]
    kinds = [mark["kind"] for mark in walk.get("live/timeline").json()["marks"]]
    assert "fork" in kinds and "push" in kinds


@pytest.mark.parametrize(
    "body",
    [{"tick": 301}, {"tick": 10, "parameters": {"alpha": -1}}, {"tick": 10, "push": {"impulse": [1e6, 0.0]}}, {}],
)
def test_what_cannot_be_gone_on_from_is_refused_and_changes_nothing(walk, body):
    before = walk.get("live").json()
    assert walk.post("live/fork", json=body).status_code == 422
    after = walk.get("live").json()
    assert (after["tick"], after["walk"]) == (before["tick"], before["walk"])


def test_every_tick_can_be_read_and_the_time_line_marks_what_happened(walk):
    line = walk.get("live/timeline").json()
    assert (line["first_tick"], line["last_tick"]) == (0, 300)
    assert [(mark["tick"], mark["kind"]) for mark in line["marks"]] == [(151, "push")]
    recorded = dict(zip(*[text.split(",") for text in rows(walk).decode().split("\n")[0:124:123]], strict=True))
    past = walk.get("live/timeline/122").json()
    assert past["tick"] == 122 and past["com_x"] == float(recorded["com_x"])
    assert walk.get("live/timeline/99999").json()["tick"] == 300


def test_one_browser_looks_at_the_past_and_others_at_the_present(server, walk):
    walk.post("live/resume")
    with connect(server.socket_url("look?client=me")) as look:
        for tick in (20, 250, 21):
            look.send(json.dumps({"tick": tick}))
            past = json.loads(look.recv(30))
            assert past["tick"] == tick and past["driver"] == "past"
        look.send("nonsense")
        assert "error" in json.loads(look.recv(30))
        look.send(json.dumps({"tick": None}))
    wait_for(lambda: walk.get("live").json()["tick"] > 310)


def test_a_saved_run_can_be_looked_at_and_its_time_line_read(server, walk):
    run = walk.post("live/save", json={"name": "walk"}).raise_for_status().json()["id"]
    line = walk.get(f"runs/{run}/timeline").raise_for_status().json()
    assert (line["first_tick"], line["last_tick"]) == (0, 300)
    assert [(mark["tick"], mark["kind"]) for mark in line["marks"]] == [(151, "push")]
    live = walk.get("live/timeline/120").json()
    walk.post("live/reset")
    with connect(server.socket_url("look?client=me")) as look:
        for asked, answers in (
            ({"tick": 120, "run": run}, 120),
            ({"tick": 9999, "run": run}, 300),
            ({"tick": 9999}, 0),
            ({"tick": 1, "run": "unknown"}, None),
        ):
            look.send(json.dumps(asked))
            past = json.loads(look.recv(30))
            assert past.get("tick") == answers and ("error" in past) is (answers is None)
            if asked["tick"] == 120:
                assert past["com_x"] == live["com_x"] and past["q"] == live["q"]


def test_no_more_than_a_few_look_at_once(server, walk):
    looks = [connect(server.socket_url(f"look?client={i}")) for i in range(9)]
    for look in looks[:8]:
        look.send(json.dumps({"tick": 5}))
        assert json.loads(look.recv(30))["tick"] == 5
    with pytest.raises(Exception, match="1013"):
        looks[8].recv(30)
    for look in looks:
        look.close()


class NoPlots:
    def show(self, *_):
        pass


def packed_walk(robot, parameters: Parameters) -> tuple[SessionLog, Simulation]:
    simulation = Simulation(robot, parameters)
    log = SessionLog(simulation)
    for tick in range(160):
        command = Command(Reference(vx=0.2), Push(np.array([0.0, 60.0])) if tick == 100 else None)
        log.begin()
        log.end(command, simulation.step(command))
    return log, simulation


@pytest.mark.parametrize("name", ["hrp2", "talos"])
def test_the_scene_of_the_past_changes_all_that_the_live_one_changes(viser_server, name):
    robot = load_robot(name)
    parameters = robot.parameters.changed({"control_period": 0.02})
    log, simulation = packed_walk(robot, parameters)
    snapshots = [tick.snapshot for seg in Session.unpacked(log.last_minute()).segments for tick in seg.ticks]
    live = Scene(viser_server, robot, LIGHT)
    for layer in ("regions", "active", "trails", "see_through"):
        live.show(layer, True)
    for snapshot in snapshots:
        live.draw(snapshot, parameters, 0.02)
    look = PastLook(robot, LIGHT)
    assert look.draw(0.02, live.shown, NoPlots()) is None
    look.show(snapshots[40], parameters, simulation.world)
    for _ in range(3):
        updates = look.draw(0.02, live.shown, NoPlots())
    assert snapshots[-1].status.name == "FALLEN"
    hidden = {n for n, is_visible in latest(updates, "visible").items() if not is_visible}
    for field in ("position", "wxyz", "visible", "color", "opacity"):
        theirs, ours = latest(live.updates, field), latest(updates, field)
        missing = {n for n in theirs if n not in ours and not any(f"{n}/".startswith(f"{h}/") for h in hidden)}
        missing = {n for n in missing if not any(h.startswith(f"{n}/") for h in hidden)}  # a frame of what is hidden
        assert missing == set(), field
    look.leave()
    assert look.draw(0.02, live.shown, NoPlots()) is None


def test_a_look_that_ends_while_it_is_drawn_is_drawn_to_its_end(monkeypatch):
    robot = load_robot("hrp2")
    simulation, look = Simulation(robot), PastLook(robot, LIGHT)
    look.show(simulation.step(Command()), simulation.parameters, simulation.world)
    draw = Scene.draw

    def draw_and_leave(*arguments, **rest):
        draw(*arguments, **rest)
        look.leave()  # by the thread of a request

    monkeypatch.setattr(Scene, "draw", draw_and_leave)
    assert look.draw(0.02, frozenset(), NoPlots()) is not None
    assert look.draw(0.02, frozenset(), NoPlots()) is None


@pytest.mark.parametrize("page", ["me", "another"])
def test_the_scene_of_the_page_that_looks_is_sent_the_past_and_no_other(server, walk, page):
    """The world moves back below a robot that walks on: where it is in the scene tells which tick is shown."""

    def is_shown(socket, x: float) -> bool:
        """Whether the world comes to lie so far behind the robot's start [m]."""
        end = time.monotonic() + 2.0
        while time.monotonic() < end:
            with suppress(TimeoutError):
                for message in socket.read(timeout=0.1):
                    if message.get("name") == "/w" and "position" in message:
                        places.append(-message["position"][0])
        return abs(places[-1] - x) < 0.03

    places: list[float] = []
    now, past = walk.get("live").json()["com_x"], walk.get("live/timeline/40").json()["com_x"]
    assert now - past > 0.2
    address = f"ws://{server.host}/viewer?client={page}"
    with (
        SceneSocket(address, origin=server.url.rstrip("/")) as scene,
        connect(server.socket_url("look?client=me")) as look,
    ):
        scene.send(CAMERA)  # only then viser counts it as a client
        assert is_shown(scene, now)
        look.send(json.dumps({"tick": 40}))
        assert is_shown(scene, past if page == "me" else now)
        look.send(json.dumps({"tick": None}))
        assert is_shown(scene, now)


def test_nodes_that_exist_take_everything():
    nodes = NodesThatExist()
    nodes.scene.add_frame("/a", visible=False).position = (0.0, 0.0, 0.0)
    nodes.initial_camera.fov = 1.0


def test_a_recorded_run_is_shown_with_the_parameters_that_were_in_force(tmp_path):
    changes = [{"t": t, "parameters": {"alpha": alpha}} for t, alpha in ((0.4, 2e-6), (0.8, 3e-6))]
    walk = {"robot": "hrp2", "duration": 1.0, "parameters": {"control_period": 0.02}, "events": changes}
    record(scenario_from_mapping(walk)).write(tmp_path)
    runs = SimpleNamespace(file=lambda _, name: tmp_path / name)
    ticks = asyncio.run(RunTicks.opened("a", runs, load_robot("hrp2")))  # pyright: ignore[reportArgumentType]
    alphas = [asyncio.run(ticks.at(tick))[1].alpha for tick in (0, 19, 20, 39, 40, 49)]
    assert alphas == [Parameters.alpha] * 2 + [2e-6] * 2 + [3e-6] * 2
