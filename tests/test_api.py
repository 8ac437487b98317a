"""The API as its users meet it: over the socket, with their own clients."""

import io
import time

import httpx
import numpy as np
import pytest
from conftest import Server, ended, live, send_text, wait_for
from prometheus_client.parser import text_string_to_metric_families
from scene_reader import SceneSocket
from test_scenario import CONTRACT

PERIOD = 0.005  # [s]
FOREIGN = "http://elsewhere.example"
RUN_FILES = ("events", "recording.{ending}", "run.json")


def test_health_reports_how_the_walk_keeps_up(api):
    health = api.get("health").json()
    assert health["robot"] == "talos" and health["tick_rate"] == 200.0
    assert 0.0 < health["tick_ms"] <= health["tick_ms_max"]
    assert 50.0 < health["memory_mb"] < 700.0
    assert health["uptime"] > 0.0 and health["misses"] >= 0 and health["clients"] == 0
    slow = health["real_time_factor"] < 0.95
    assert health["status"] == ("degraded" if slow else "ok") and bool(health["reason"]) == slow


def test_live_snapshot_has_every_column_and_the_plan(api):
    api.post("live/pause")
    api.post("live/reset")
    api.put("live/reference", json={"vx": 0.2})
    state = api.post("live/step", json={"ticks": 300}).json()
    assert [name for name in CONTRACT if name not in state] == []
    assert state["tick"] == 300 and state["t"] == pytest.approx(300 * PERIOD)
    assert state["status"] == 0 and state["reason"] == "" and state["fault"] == ""
    assert len(state["q"]) == 39
    timing = state["timing"]
    assert set(timing["stages"]) >= {"gait", "assemble", "solve", "swing_foot", "inverse_kinematics", "true_cop"}
    assert 0.0 < sum(timing["stages"].values()) <= 1.2 * timing["tick_ms"]
    assert set(timing["late"]) == {"1", "5", "50"}
    for name in ("tick_ms_max", "misses", "real_time_factor", "late_ms_max", "relaxed", "failed", "ticks"):
        assert timing[name] >= 0, name
    assert (state["speed"], state["last_push"], state["random_pushes"]) == (1.0, None, None)
    plan = state["plan"]
    assert len(plan["times"]) == len(plan["com"]) == len(plan["cop"]) == 16
    first = plan["footholds"][0]
    assert (first["x"], first["y"], first["yaw"]) == (state["foothold_x"], state["foothold_y"], state["foothold_yaw"])
    assert first["side"] == 1 - state["support_side"]
    assert is_inside(first["region"], (first["x"], first["y"]))
    assert is_inside(plan["support_polygon"], (state["cop_x"], state["cop_y"]))


def is_inside(corners: list[list[float]], point: tuple[float, float]) -> bool:
    """Whether a point lies in a convex polygon whose corners come in order, either way around."""
    turns = [
        (bx - ax) * (point[1] - ay) - (by - ay) * (point[0] - ax)
        for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True)
    ]
    return max(turns) <= 1e-6 or min(turns) >= -1e-6


def test_standing_robot_stands_on_the_hull_of_both_soles(api):
    api.post("live/pause")
    state = api.post("live/reset").json()
    xs, ys = zip(*state["plan"]["support_polygon"], strict=True)
    assert state["phase"] == 0
    assert (min(ys), max(ys)) == pytest.approx((state["right_y"] - 0.062, state["left_y"] + 0.062))
    assert (min(xs), max(xs)) == pytest.approx((-0.111, 0.100))


def test_reference_holds_until_another_is_given(api):
    assert api.put("live/reference", json={"vx": 0.2}).json() == {"vx": 0.2, "vy": 0.0, "yaw_rate": 0.0}
    api.post("live/pause")
    state = api.post("live/step", json={"ticks": 200}).json()
    assert state["reference_vx"] == 0.2 and state["driver"] == "rest"
    api.put("live/reference", json={})
    assert api.post("live/step").json()["reference_vx"] == 0.0


@pytest.mark.parametrize(
    ("method", "path", "body", "field"),
    [
        ("PUT", "live/reference", '{"vx": 1e6}', "vx"),
        ("PUT", "live/reference", '{"vx": -5}', "vx"),
        ("PUT", "live/reference", '{"vy": 0.9}', "vy"),
        ("PUT", "live/reference", '{"vx": NaN}', "vx"),
        ("PUT", "live/reference", '{"vx": Infinity}', "vx"),
        ("PUT", "live/reference", '{"vx": 1e999}', "vx"),
        ("PUT", "live/reference", '{"vx": 1' + "0" * 400 + "}", "vx"),
        ("PUT", "live/reference", '{"vx": "0.1"}', "vx"),
        ("PUT", "live/reference", '{"vx": true}', "vx"),
        ("PUT", "live/reference", '{"vx": null}', "vx"),
        ("PUT", "live/reference", '{"velocity": 0.1}', "velocity"),
        ("PUT", "live/reference", "[0.1]", "body"),
        ("PUT", "live/reference", '{"vx":', "body"),
        ("PUT", "live/reference", "", "body"),
        ("POST", "live/push", "{}", "impulse"),
        ("POST", "live/push", '{"impulse": [0]}', "impulse"),
        ("POST", "live/push", '{"impulse": [0, 500]}', "impulse"),
        ("POST", "live/push", '{"impulse": [0, NaN]}', "impulse.1"),
        ("POST", "live/push", '{"impulse": [1, 1], "duration": -1}', "duration"),
        ("POST", "live/push", '{"impulse": [1, 1], "duration": 1e9}', "duration"),
        ("POST", "live/push", '{"impulse": [1, 1], "frame": "moon"}', "frame"),
        ("POST", "live/push", '{"impulse": [1, 1], "strength": 1}', "strength"),
        ("POST", "live/step", '{"ticks": 0}', "ticks"),
        ("POST", "live/step", '{"ticks": 1.5}', "ticks"),
        ("POST", "live/step", '{"ticks": 1000000}', "ticks"),
        ("POST", "live/step", '{"samples": 0}', "samples"),
        ("POST", "live/step", '{"samples": 51}', "samples"),
        ("POST", "live/step", '{"ticks": 1, "samples": 1}', "body"),
        ("POST", "live/speed", "{}", "factor"),
        ("POST", "live/speed", '{"factor": 0.05}', "factor"),
        ("POST", "live/speed", '{"factor": 4.5}', "factor"),
        ("POST", "live/speed", '{"factor": NaN}', "factor"),
        ("POST", "live/preview", '{"impulse": [0, 500]}', "impulse"),
        ("POST", "live/preview", '{"impulse": [0, NaN]}', "impulse.1"),
        ("PATCH", "live/layers", '{"moon": true}', "layers.moon"),
        ("PATCH", "live/layers", '{"com": 1}', "com"),
        ("PUT", "live/random-pushes", "{}", "strength"),
        ("PUT", "live/random-pushes", '{"strength": 500}', "strength"),
        ("PUT", "live/random-pushes", '{"strength": -1}', "strength"),
        ("PUT", "live/random-pushes", '{"strength": 1, "interval": 0.01}', "interval"),
        ("PUT", "live/random-pushes", '{"strength": 1, "seed": -1}', "seed"),
        ("POST", "live/save", '{"name": 7}', "name"),
        ("POST", "live/save", '{"title": "mine"}', "title"),
    ],
)
def test_bad_input_is_refused_with_field_value_and_limit_and_changes_nothing(api, method, path, body, field):
    api.post("live/pause")
    response = send_text(api, method, path, body)
    assert response.status_code == 422
    refusal = response.json()
    assert [set(error) for error in refusal["errors"]] == [{"field", "value", "limit"}]
    assert refusal["errors"][0]["field"] == field and refusal["errors"][0]["limit"]
    assert field in refusal["detail"]
    after = api.post("live/step").json()
    assert (after["reference_vx"], after["reference_vy"], after["push_x"], after["push_y"]) == (0, 0, 0, 0)
    assert after["driver"] == "none"


def test_refusal_names_the_limits_of_the_robot(api):
    high = api.get("live/robot").json()["limits"]["vx"][1]
    assert api.put("live/reference", json={"vx": high}).status_code == 200
    (error,) = api.put("live/reference", json={"vx": high + 0.01}).json()["errors"]
    assert error["value"] == high + 0.01 and f"{high:g}" in error["limit"]


def test_push_changes_the_velocity_by_impulse_over_mass(api):
    mass = api.get("live/robot").json()["mass"]
    api.post("live/pause")

    def after(**push: object) -> dict:
        api.post("live/reset")
        api.post("live/step", json={"ticks": 240})
        if push:
            api.post("live/push", json=push).raise_for_status()
        return api.post("live/step").json()

    idle = after()
    for frame in ({}, {"frame": "robot"}, {"frame": "world"}):
        pushed = after(impulse=[3.0, 9.0], **frame)
        assert (pushed["push_x"], pushed["push_y"]) == pytest.approx((3.0, 9.0))
        assert pushed["com_vx"] - idle["com_vx"] == pytest.approx(3.0 / mass)
        assert pushed["com_vy"] - idle["com_vy"] == pytest.approx(9.0 / mass)
        assert api.post("live/step").json()["push_y"] == 0.0


def test_pause_holds_time_and_step_takes_ticks(api):
    paused = api.post("live/pause").json()
    assert paused["running"] is False
    time.sleep(0.1)
    assert live(api)["tick"] == paused["tick"]
    assert api.post("live/step").json()["tick"] == paused["tick"] + 1
    assert api.post("live/step", json={"ticks": 40}).json()["tick"] == paused["tick"] + 41
    assert live(api)["tick"] == paused["tick"] + 41
    assert api.post("live/resume").json()["running"] is True
    wait_for(lambda: live(api)["tick"] > paused["tick"] + 60)


def test_step_is_refused_while_the_robot_runs(api):
    response = api.post("live/step", json={"ticks": 5})
    assert response.status_code == 409 and "pause" in response.json()["detail"]


def test_reset_puts_the_robot_back_with_no_reference(api):
    first = api.post("live/reset").json()
    api.put("live/reference", json={"vx": 0.2})
    wait_for(lambda: live(api)["com_x"] > 0.05)
    api.post("live/pause")
    back = api.post("live/reset").json()
    assert back["tick"] == 0 and back["running"] is False and back["driver"] == "none"
    for name in ("t", *CONTRACT[2:]):
        assert back[name] == first[name], name


def test_same_commands_at_the_same_ticks_give_the_same_snapshots(api):
    def walk() -> dict:
        api.post("live/reset")
        api.put("live/reference", json={"vx": 0.15, "vy": 0.05})
        api.post("live/step", json={"ticks": 200})
        api.post("live/push", json={"impulse": [0.0, 8.0]})
        state = api.post("live/step", json={"ticks": 150}).json()
        return {name: value for name, value in state.items() if name not in ("timing", "walk")}

    api.post("live/pause")
    assert walk() == walk()


def test_simulated_time_advances_and_never_outruns_real_time(api):
    start = time.monotonic()
    t0 = live(api)["t"]
    time.sleep(1.0)
    t1 = live(api)["t"]
    assert 0.0 < t1 - t0 <= time.monotonic() - start + 0.1
    assert api.get("health").json()["real_time_factor"] <= 1.02


@pytest.mark.parametrize(
    ("method", "path"),
    [("PUT", "live/reference"), ("POST", "live/push"), *(("POST", f"live/{verb}") for verb in ("pause", "resume"))],
)
def test_page_of_another_origin_cannot_drive(api, server, method, path):
    body = {"impulse": [0, 1]} if path == "live/push" else {}
    for origin in (FOREIGN, "null", f"http://{server.host}.elsewhere.example"):
        response = api.request(method, path, json=body, headers={"Origin": origin})
        assert response.status_code == 403 and response.json()["detail"]
    assert live(api)["running"] is True and live(api)["driver"] == "none"
    assert api.request(method, path, json=body, headers={"Origin": f"http://{server.host}"}).status_code == 200


def test_every_refusal_has_the_same_shape(api):
    for response in (api.get("nowhere"), api.delete("live"), api.post("live/step"), api.put("live/reference", json=[])):
        assert response.status_code >= 400 and set(response.json()) == {"detail", "errors"}


def test_documentation_lists_every_route(server):
    assert httpx.get(f"{server.url}docs").status_code == 200
    paths = httpx.get(f"{server.url}openapi.json").json()["paths"]
    verbs = ("reference", "push", "pause", "resume", "step", "reset", "parameters", "parameters/defaults")
    verbs += ("speed", "preview", "random-pushes", "save", "layers", "layers/defaults", "lease", "world")
    verbs += ("robot", "robot/defaults", "timeline", "timeline/{tick}", "fork", "booth", "booth/code.svg")
    services = {f"/api/v1/{name}" for name in ("health", "robots", "scenarios", "session", "live")}
    runs = {
        f"/api/v1/runs{rest}"
        for rest in ("", "/upload", "/{run_id}", *(f"/{{run_id}}/{file}" for file in (*RUN_FILES, "timeline")))
    }
    sweeps = {f"/api/v1/sweeps{rest}" for rest in ("", "/{sweep_id}", "/{sweep_id}/events", "/{sweep_id}/{name}")}
    lessons = {"/api/v1/lessons", "/api/v1/lessons/{name}/outcome"}
    expected = services | runs | sweeps | lessons | {f"/api/v1/live/{verb}" for verb in verbs}
    assert set(paths) == expected


def test_parameters_change_while_the_robot_walks(api):
    before = api.get("live/parameters").json()
    assert before["scheme"] == "full"
    changed = api.patch("live/parameters", json={"scheme": "speed_and_jerk", "cop_margin": 0.02})
    assert changed.status_code == 200
    assert changed.json() == before | {"scheme": "speed_and_jerk", "cop_margin": 0.02}
    for refused, field in (
        ({"scheme": "magic"}, "scheme"),
        ({"alhpa": 1.0}, "alhpa"),
        ({"control_period": 0.01}, "control_period"),
    ):
        response = api.patch("live/parameters", json=refused)
        assert response.status_code == 422
        assert response.json()["errors"][0]["field"] == field
    assert api.patch("live/parameters", json={"cop_margin": 0.15}).status_code == 422
    assert api.get("live/parameters").json() == changed.json()
    assert api.patch("live/parameters", json=before).json() == before


def test_scenarios_are_listed_as_they_ship(api):
    shipped = {scenario["name"]: scenario for scenario in api.get("scenarios").json()}
    assert set(shipped) >= {"herdt-2010-section-6", "herdt-2010-section-6-hrp2", "turns-and-stops"}
    assert shipped["herdt-2010-section-6"]["events"][0] == {"t": 0.8, "reference": {"vx": 0.3}}


def test_single_samples_lead_from_one_to_the_next(api):
    api.post("live/pause")
    api.post("live/reset")
    api.post("live/step", json={"ticks": 3})
    assert [api.post("live/step", json={"samples": n}).json()["tick"] for n in (1, 1, 2)] == [20, 40, 80]


def test_speed_slows_simulated_time_and_is_reported(api):
    try:
        assert api.post("live/speed", json={"factor": 0.1}).json()["speed"] == 0.1
        assert api.get("health").json()["speed"] == 0.1
        first = live(api)
        wait_for(lambda: live(api)["real_t"] > first["real_t"] + 1.0)
        last = live(api)
        # Real time is counted at each tick, and they are 50 ms apart.
        assert last["t"] - first["t"] <= 0.1 * (last["real_t"] - first["real_t"]) + 0.011
    finally:
        assert api.post("live/speed", json={"factor": 1.0}).json()["speed"] == 1.0


def test_preview_shows_the_steps_that_would_follow_and_the_robot_feels_nothing(api):
    api.post("live/pause")
    api.post("live/reset")
    api.put("live/reference", json={"vx": 0.2})
    before = api.post("live/step", json={"ticks": 300}).json()
    calm, pushed, hopeless = (
        api.post("live/preview", json={"impulse": [0.0, strength]}).json() for strength in (0.0, 15.0, 60.0)
    )
    assert set(pushed) == {"status", "survives", "plan", "step_duration", "next_step_duration"}
    assert calm["survives"] and pushed["survives"] and not hopeless["survives"]
    assert calm["plan"]["footholds"][0]["y"] != pushed["plan"]["footholds"][0]["y"]
    assert live(api)["tick"] == before["tick"]
    after = api.post("live/step").json()
    assert after["push_y"] == 0.0 and after["last_push"] is None


def test_the_outcome_of_the_last_push_is_reported(api):
    api.post("live/pause")
    api.post("live/reset")
    api.post("live/step", json={"ticks": 100})
    api.post("live/push", json={"impulse": [0.0, 1.0]})
    assert api.post("live/step", json={"ticks": 2}).json()["last_push"] == {
        "t": 0.505,
        "impulse": [0.0, 1.0],
        "survived": True,
        "steps": 0,
        "time": pytest.approx(0.005),
        "shortened": [],
    }
    api.post("live/push", json={"impulse": [0.0, 60.0]})
    api.post("live/step", json={"ticks": 800})
    state = live(api)
    assert state["last_push"]["survived"] is False and state["timing"]["failed"] > 0


def test_random_pushes_come_until_they_are_switched_off(api):
    api.post("live/pause")
    try:
        on = api.put("live/random-pushes", json={"strength": 2.0, "interval": 0.2, "seed": 5}).json()
        assert on["random_pushes"] == {"strength": 2.0, "interval": 0.2, "seed": 5}
        api.post("live/step", json={"ticks": 100})
        assert live(api)["last_push"]["t"] > 0.0
    finally:
        assert api.put("live/random-pushes", json={"strength": 0}).json()["random_pushes"] is None
    drawn = api.put("live/random-pushes", json={"strength": 1.0}).json()["random_pushes"]
    assert drawn["interval"] == 5.0 and drawn["seed"] >= 0
    api.put("live/random-pushes", json={"strength": 0})


def test_a_saved_session_is_a_run_that_replays_to_the_same_decisions(api):
    api.post("live/pause")
    api.post("live/reset")
    api.put("live/reference", json={"vx": 0.2})
    api.post("live/step", json={"ticks": 150})
    api.patch("live/parameters", json={"cop_margin": 0.02})
    api.post("live/push", json={"impulse": [0.0, 5.0]})
    api.post("live/step", json={"ticks": 150})
    response = api.post("live/save", json={"name": "driven"})
    api.patch("live/parameters", json=api.get("live/parameters/defaults").json())
    assert response.status_code == 201
    run = response.json()
    assert (run["status"], run["name"]) == ("done", "driven")
    address = response.headers["Location"].removeprefix("/api/v1/")
    assert api.get(address).json()["id"] == run["id"]
    driven = recording(api, address)
    assert driven["tick"].tolist() == list(range(301)) and driven["push_y"].sum() == pytest.approx(5.0)
    replay = api.post("runs", json=run["scenario"])
    address = replay.headers["Location"].removeprefix("/api/v1/")
    assert ended(api, address)["status"] == "done"
    replayed = recording(api, address)
    different = [name for name in driven.files if driven[name].tobytes() != replayed[name].tobytes()]
    assert different == [], {name: np.nanmax(np.abs(driven[name] - replayed[name])) for name in different}


def recording(api: httpx.Client, run: str) -> np.lib.npyio.NpzFile:
    return np.load(io.BytesIO(api.get(f"{run}/recording.npz").content))


def test_a_walk_can_be_saved_after_its_reset_under_a_name_of_ours(api):
    api.post("live/pause")
    api.post("live/step", json={"ticks": 30})
    api.post("live/reset")
    run = api.post("live/save", json={"before_reset": True}).json()
    assert run["name"].startswith("live 20") and run["duration"] > 0.14
    api.delete(f"runs/{run['id']}")


def test_metrics_are_reported_to_prometheus(api, server):
    response = httpx.get(f"{server.url}metrics")
    assert response.headers["content-type"].startswith("text/plain")
    families = {family.name: family for family in text_string_to_metric_families(response.text)}
    state = live(api)
    value = {name: family.samples[0].value for name, family in families.items()}
    assert 0 < value["walk_ticks"] <= state["timing"]["ticks"]
    assert value["walk_speed"] == 1.0 and value["walk_running"] == 1.0 and value["walk_fault"] == 0.0
    assert 0.0 < value["walk_real_time_factor"] <= 1.05
    assert value["walk_clients"] == 0.0
    assert {sample.labels["stage"] for sample in families["walk_stage_seconds"].samples} == set(
        state["timing"]["stages"]
    )
    for name in ("walk_memory_bytes", "walk_cpu_seconds"):
        assert {sample.labels["process"] for sample in families[name].samples} == {"server", "control"}
        assert all(sample.value > 0.0 for sample in families[name].samples)
    buckets = [s.value for s in families["walk_tick_lateness_seconds"].samples if s.name.endswith("_bucket")]
    assert buckets == sorted(buckets) and len(buckets) == 4 and buckets[-1] == value["walk_ticks"]
    for name in ("walk_tick_misses", "walk_relaxed_solves", "walk_failed_solves", "walk_tick_seconds"):
        assert value[name] >= 0.0


def drawn_frames(server: Server) -> tuple[float, float]:
    """Number of drawn frames, and the processor time of all [s]."""
    text = httpx.get(f"{server.url}metrics").text
    families = {family.name: family.samples for family in text_string_to_metric_families(text)}
    count, seconds = families["walk_frame_seconds"]
    assert count.name.endswith("_count") and seconds.name.endswith("_sum")
    return count.value, seconds.value


def test_metrics_report_the_cost_of_drawn_frames_while_a_browser_looks(server):
    with SceneSocket(f"ws://{server.host}/viewer") as browser:
        before = drawn_frames(server)
        wait_for(lambda: bool(browser.read()) and drawn_frames(server)[0] >= before[0] + 10)
        after = drawn_frames(server)
    assert 0.0 < (after[1] - before[1]) / (after[0] - before[0]) < 1.0

    def nothing_is_drawn() -> bool:
        first = drawn_frames(server)
        time.sleep(0.2)
        return drawn_frames(server) == first

    wait_for(nothing_is_drawn)
