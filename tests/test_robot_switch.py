"""Another robot walks on the page while the server runs, and robots of the server's own folder."""

import json
import math
import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
import websockets.sync.client
import yaml
from conftest import Server, ended, serving, wait_for
from playwright.sync_api import expect

from app.robot_choices import RobotChoices
from walkcore import load_robot
from walkcore.errors import InvalidValueError
from walkcore.named_files import shipped_files

HRP2 = yaml.safe_load(shipped_files("robots")["hrp2"].read_text(encoding="utf-8"))


def write_robot(folder: Path, file: str, **changes: object) -> None:
    (folder / f"{file}.yaml").write_text(yaml.safe_dump(HRP2 | {"name": file} | changes), encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("robots")
    write_robot(folder, "small", title="Small", mass=30.0, max_push=9.0)
    write_robot(folder, "broken", mass=-1.0)
    write_robot(folder, "misnamed", name="other")
    bent = {"urdf": "bent.urdf", "left_sole": "l", "right_sole": "r", "torso": "t"}
    write_robot(folder, "bodiless", body=bent)
    (folder / "bent.urdf").write_text('<robot name="bent"><link name="t"/></robot>', encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[Server]:
    with serving("--robot", "hrp2", "--scene", "light", WALK_ROBOTS=str(folder)) as server:
        yield server


@pytest.fixture
def api(server: Server) -> Iterator[httpx.Client]:
    """A client of the robot that the server started with, newly put up."""
    with server.client() as client:
        client.put("live/robot", json={"robot": "small"}).raise_for_status()
        client.put("live/robot", json={"robot": "hrp2"}).raise_for_status()
        yield client


def test_another_robot_takes_over_with_its_limits_and_parameters(api, server):
    api.patch("live/parameters", json={"alpha": 1e-5}).raise_for_status()
    api.patch("live/layers", json={"trails": True}).raise_for_status()
    process = api.get("health").json()["control_process"]
    with websockets.sync.client.connect(server.socket_url("stream?rate=30")) as stream:
        assert json.loads(stream.recv())["robot"] == "hrp2"
        response = api.put("live/robot", json={"robot": "small"})
        assert response.json()["title"] == "Small" and response.json()["limits"]["push"] == 9.0
        while json.loads(stream.recv())["robot"] != "small":  # the same stream goes on
            pass
    health = api.get("health").json()
    assert (health["robot"], health["status"]) == ("small", "ok") and health["control_process"] != process
    assert (
        api.get("live/robot").json()
        == response.json()
        == api.get("robots").json()[0] | {"height": response.json()["height"]}
    )
    assert api.get("live/robot/defaults").json()["name"] == "hrp2"
    assert api.get("live/parameters").json() == api.get("live/parameters/defaults").json()
    assert api.get("live/layers").json()["trails"], "the choice of a person who looks goes on"
    assert "limit" in api.post("live/push", json={"impulse": [0, 9.5]}).json()["errors"][0]
    wait_for(lambda: api.get("live").json()["tick"] > 20)
    assert "walk_ticks_total" in httpx.get(f"{server.url}metrics").text


def test_controls_that_were_connected_before_drive_the_robot_that_walks_now(api, server):
    with websockets.sync.client.connect(server.socket_url("teleop?client=page")) as teleop:
        api.put("live/robot", json={"robot": "small"}).raise_for_status()
        teleop.send(json.dumps({"push": {"impulse": [0.0, 50.0]}}))
        wait_for(lambda: api.get("live").json()["last_push"] is not None)
    assert api.get("live").json()["last_push"]["impulse"][1] == pytest.approx(9.0), "clamped to the limit of this robot"


def test_the_walk_of_the_robot_before_can_be_saved_until_the_next_one_is_reset(api):
    api.put("live/reference", json={"vx": 0.1}).raise_for_status()
    wait_for(lambda: api.get("live").json()["tick"] > 100)
    api.put("live/robot", json={"robot": "small"}).raise_for_status()
    run = api.post("live/save", json={"before_reset": True}).raise_for_status().json()
    assert run["robot"] == "hrp2" and run["status"] == "done" and run["duration"] > 0.5
    recording = api.get(f"runs/{run['id']}/recording.csv").raise_for_status().text.splitlines()
    assert max(float(row.split(",")[recording[0].split(",").index("reference_vx")]) for row in recording[1:]) == 0.1
    assert api.post("live/save", json={}).json()["robot"] == "small"
    api.post("live/reset").raise_for_status()
    assert api.post("live/save", json={"before_reset": True}).json()["robot"] == "small"


def test_a_robot_that_was_just_put_up_has_the_one_before_it_to_save(api):
    run = api.post("live/save", json={"before_reset": True}).raise_for_status().json()
    assert run["robot"] == "small", "although the new one chose its plant, which begins its walk anew"


@pytest.mark.parametrize(
    ("robot", "words"),
    [
        ("nobody", "must be one of"),
        ("../small", "must be one of"),
        ("broken", "robot.mass"),
        ("misnamed", "as its file is named"),
        ("bodiless", ""),
        (3, "string"),
    ],
)
def test_a_robot_that_cannot_walk_is_refused_and_the_one_before_walks_on(api, robot, words):
    process = api.get("health").json()["control_process"]
    response = api.put("live/robot", json={"robot": robot})
    assert response.status_code == 422 and words in response.text
    if robot == "nobody":
        assert "hrp2" in response.text and "small" in response.text, "the choices"
    health = api.get("health").json()
    assert (health["robot"], health["control_process"]) == ("hrp2", process)
    assert health["status"] != "unhealthy"  # a busy machine may be behind real time
    tick = api.get("live").json()["tick"]
    wait_for(lambda: api.get("live").json()["tick"] > tick)


def test_the_robot_that_walks_already_walks_on(api):
    process = api.get("health").json()["control_process"]
    assert api.put("live/robot", json={"robot": "hrp2"}).status_code == 200
    assert api.get("health").json()["control_process"] == process


def test_no_robot_is_changed_while_the_control_process_starts_again(api):
    os.kill(api.get("health").json()["control_process"], signal.SIGKILL)
    wait_for(lambda: api.get("health").status_code == 503)
    assert api.put("live/robot", json={"robot": "small"}).status_code == 503
    wait_for(lambda: api.get("health").status_code == 200)
    assert api.get("health").json()["robot"] == "hrp2"


def test_runs_may_name_robots_of_the_folder(api):
    run = api.post("runs", json={"robot": "small", "duration": 0.5}).raise_for_status().json()
    run = ended(api, f"runs/{run['id']}")
    assert (run["status"], run["robot"]) == ("done", "small")
    parameters = api.get(f"runs/{run['id']}/run.json").json()["parameters"]
    assert parameters["mass"] == 30.0
    refused = api.post("runs", json={"robot": "nobody", "duration": 0.5})
    assert refused.status_code == 422 and "small" in refused.text


def test_robots_are_listed_without_those_that_cannot_be_read(api):
    names = [robot["name"] for robot in api.get("robots").json()]
    assert names[0] == "hrp2" and {"small", "talos", "g1"} < set(names)
    assert not {"broken", "misnamed", "other"} & set(names) and len(names) == len(set(names))


def test_a_name_that_ships_is_that_robot_whatever_stands_in_the_folder(tmp_path):
    write_robot(tmp_path, "hrp2", mass=3.0)
    assert RobotChoices(folder=tmp_path).load("hrp2").mass == load_robot("hrp2").mass
    own = load_robot(tmp_path / "hrp2.yaml")
    assert RobotChoices(own).load("hrp2").mass == 3.0, "but for the robot that the server was started with"


def test_a_folder_is_read_anew_at_every_call(tmp_path):
    choices = RobotChoices(folder=tmp_path)
    with pytest.raises(InvalidValueError, match="late"):
        choices.load("late")
    write_robot(tmp_path, "late")
    assert choices.load("late").name == "late"
    write_robot(tmp_path, "late", mass=31.0)
    assert choices.load("late").mass == 31.0
    shutil.rmtree(tmp_path)
    assert "late" not in choices.sources()


@pytest.mark.exhaustive
def test_pages_follow_a_robot_that_is_chosen_in_one_of_them(api, server, visit):
    one, scenes = visit(server.url), []
    other = one.context.new_page()
    for page in (one, other):
        page.on("request", lambda request: scenes.append(request.url) if "/viewer/?" in request.url else None)
        page.goto(server.url)
        expect(page.locator("#robot")).to_have_text(HRP2["title"])
    assert len(scenes) == 2
    one.get_by_test_id("robots").select_option("small")
    for page in (one, other):
        expect(page.locator("#robot")).to_have_text("Small")
        expect(page.locator("#strength")).to_have_attribute("max", "9")
        expect(page.get_by_test_id("robots")).to_have_value("small")
    assert len(scenes) == 4, "each has loaded the scene of the other robot"
    expect(one.get_by_role("button", name=f"Save {HRP2['title']}’s walk")).to_be_visible()
    other.locator("#share").click()
    expect(other.locator(".notice", has_text="robot small")).to_be_visible()
    api.put("live/robot", json={"robot": "hrp2"}).raise_for_status()
    expect(one.locator("#robot")).to_have_text(HRP2["title"])
    linked = one.context.new_page()
    linked.goto(f"{server.url}?robot=small")
    linked.get_by_role("button", name="Apply").click()
    expect(other.locator("#robot")).to_have_text("Small")


def test_pushes_of_the_page_are_in_proportion_to_the_robot(api, server, visit):
    page = visit(server.url)
    strength = page.locator("#strength")
    expect(strength).to_have_value("12")
    expect(strength).to_have_attribute("max", "60")
    api.put("live/robot", json={"robot": "small"}).raise_for_status()
    expect(strength).to_have_value("1.8")  # of 9 N s, in tenths
    page.locator("#presets").click()
    page.get_by_role("button", name="Shove it", exact=True).click()
    wait_for(lambda: api.get("live").json()["last_push"] is not None)
    impulse = math.hypot(*api.get("live").json()["last_push"]["impulse"])
    scenario = next(s for s in api.get("scenarios").json() if s["name"] == "pushes-while-standing")
    first = next(event["push"]["impulse"] for event in scenario["events"] if "push" in event)
    talos = next(robot for robot in api.get("robots").json() if robot["name"] == scenario["robot"])
    assert impulse == pytest.approx(math.hypot(*first) * 9.0 / talos["limits"]["push"])
    expect(page.locator(".notice[data-level=bad]")).to_have_count(0)
