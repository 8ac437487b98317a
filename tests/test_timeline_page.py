"""Time on the page: it stops, passes by ticks and more slowly, is looked back at on its time line, and goes on."""

import base64
import re
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest
from conftest import DESKTOP, UP, Server, live, paused_walk, wait_for
from playwright.sync_api import FilePayload, Page, expect

DOCK = "<!doctype html><html><body><div data-dock-root><div></div></div></body></html>"


@pytest.fixture
def present(visit: Callable[..., Page], server: Server, api: httpx.Client) -> Page:
    """The page without a scene, and a robot that runs."""
    page = visit(server.url, **DESKTOP)
    expect(page.get_by_test_id("status")).to_contain_text(UP)
    return page


def test_time_stops_and_passes_tick_by_tick(present, api):
    page = present
    one_tick = page.get_by_role("button", name="1 tick")
    expect(one_tick).to_be_hidden()
    page.keyboard.press("p")
    expect(one_tick).to_be_visible()
    tick = live(api)["tick"]
    one_tick.click()
    wait_for(lambda: live(api)["tick"] == tick + 1)
    page.keyboard.press("p")
    expect(one_tick).to_be_hidden()
    wait_for(lambda: live(api)["tick"] > tick + 20)
    page.get_by_test_id("stop").click()
    expect(page.get_by_test_id("status")).to_contain_text("paused")
    assert live(api)["running"] is False
    page.get_by_test_id("stop").click()
    expect(page.get_by_test_id("status")).to_contain_text(UP)


def test_samples_speed_and_both_times(present, api):
    page = present
    page.keyboard.press("p")
    wait_for(lambda: not live(api)["running"])
    start = api.post("live/reset").json()
    page.get_by_role("button", name="1 sample").click()
    wait_for(lambda: live(api)["t"] == pytest.approx(start["t"] + 0.1))
    page.get_by_test_id("speed").select_option(label="1/4 ×")
    wait_for(lambda: live(api)["speed"] == 0.25)
    page.keyboard.press("p")
    wait_for(lambda: live(api)["t"] > 0.5)
    expect(page.locator("#factor")).to_have_text(re.compile(r"0\.[12]\d"))
    expect(page.locator("#real-time")).to_have_text(re.compile(r"of 0:0\d\.\d"))
    api.post("live/speed", json={"factor": 0.3})
    expect(page.get_by_test_id("speed")).to_have_value("0.3")  # as somebody else chose
    page.get_by_test_id("speed").select_option(label="1 ×")
    wait_for(lambda: live(api)["speed"] == 1.0)


def test_last_minute_is_saved_with_links_to_its_files(present, api, server):
    page = present
    wait_for(lambda: live(api)["tick"] > 50)
    page.get_by_role("button", name="Save").click()
    notices = page.locator("#notices")
    expect(notices).to_contain_text("Saved the last")
    link = notices.get_by_role("link", name="CSV").get_attribute("href")
    header = httpx.get(f"{server.url.removesuffix('/')}{link}").raise_for_status().text.splitlines()[0]
    assert header.startswith("tick,t,com_x")


@pytest.fixture
def page(visit: Callable[..., Page], server: Server, api: httpx.Client) -> Page:
    """The page without a scene, and a paused walk with a push at tick 151."""
    paused_walk(api, push=6.0, nb_ticks=399)
    page = visit(server.url, DOCK)
    expect(page.locator("#state")).to_have_text("paused")
    page.keyboard.press("t")
    expect(page.locator("#moment-tick")).to_have_text("tick 399")
    return page


def at(page: Page, tick: int) -> None:
    """Wait until a tick is asked for and shown."""
    expect(page.locator("#moment-tick")).to_have_text(f"tick {tick}")
    expect(page.locator("#state")).to_have_text("the past")
    expect(page.locator("#time")).to_have_text(f"0:{tick * 0.005:04.1f}")


def test_the_past_is_gone_through_tick_by_tick_by_marks_and_by_playing(page, api):
    page.keyboard.press(",")
    at(page, 398)
    page.locator("#mark-back").click()
    at(page, 151)
    assert page.locator("#moment-text").inner_text() == "−1.24 s"
    page.keyboard.press(".")
    at(page, 152)
    page.locator("#moment").press("ArrowLeft")
    at(page, 151)
    assert page.locator("#marks i").evaluate_all("all => all.map((mark) => mark.dataset.kind)") == ["push"]
    page.locator("#play-speed").select_option("0.25")
    page.locator("#play").click()
    wait_for(lambda: int(page.locator("#moment-tick").inner_text().split()[1]) > 180)
    page.locator("#play").click()
    assert api.get("live").json()["tick"] == 399, "nothing of the robot changes"
    page.locator("#present").click()
    expect(page.locator("#state")).to_have_text("paused")


def test_the_walk_goes_on_from_a_moment_with_the_push_on_the_ring(page, api):
    walk = api.get("live").json()["walk"]
    page.locator("#go-on").click()
    expect(page.locator("#notices")).to_contain_text("earlier moment")
    page.locator("#mark-back").click()
    at(page, 151)
    page.locator("#go-on-with").select_option("push")
    page.locator("#go-on").click()
    wait_for(lambda: api.get("live").json()["walk"] == walk + 1)
    wait_for(lambda: api.get("live").json()["running"])
    live = api.get("live").json()
    assert live["fork"]["tick"] == 151 and live["fork"]["was"]["recovery"]["impulse"] == [0.0, 6.0]
    strength = float(page.locator("#strength").input_value())
    assert live["fork"]["now"]["recovery"]["impulse"] == pytest.approx([0.0, strength], abs=0.1)
    expect(page.locator("#state")).not_to_have_text("the past")
    expect(page.locator("#fork-was")).to_contain_text("cm")


def test_whoever_drives_is_back_in_the_present(page, api):
    page.keyboard.press(",")
    at(page, 398)
    page.keyboard.down("w")
    expect(page.locator("#state")).to_have_text("paused")
    page.keyboard.up("w")


def test_a_reset_ends_the_past(page, api):
    page.keyboard.press(",")
    at(page, 398)
    api.post("live/reset")
    expect(page.locator("#state")).to_have_text("paused")
    expect(page.locator("#notices")).to_contain_text("began anew")


def test_a_saved_run_is_opened_from_the_menu(page, api):
    run = api.post("live/save", json={"name": "kept"}).raise_for_status().json()["id"]
    api.post("live/reset")
    page.locator("#time-back").click()
    page.locator("#time-back").click()
    page.locator(f"#past-of option[value='{run}']").wait_for(state="attached")
    page.locator("#past-of").select_option(run)
    at(page, 0)
    page.locator("#mark-on").click()
    expect(page.locator("#moment-text")).to_have_text("0.76 s")
    page.locator("#present").click()
    expect(page.locator("#moment-text")).to_have_text("now")


@pytest.fixture
def files(api: httpx.Client) -> list[FilePayload]:
    """Files of a walk: the recording, and its run.json."""
    run = api.post("live/save", json={"name": "from elsewhere"}).raise_for_status().json()["id"]
    names = ("recording.npz", "run.json")
    contents = [api.get(f"runs/{run}/{name}").raise_for_status().content for name in names]
    api.delete(f"runs/{run}").raise_for_status()
    return [
        FilePayload(name=name, mimeType="application/octet-stream", buffer=content)
        for name, content in zip(names, contents, strict=True)
    ]


def test_a_recording_that_is_chosen_is_opened_and_the_robot_goes_on_from_it(page, api, files):
    api.post("live/reset")
    page.locator("#recording-file").set_input_files(files)
    at(page, 0)
    assert page.locator("#past-of option:checked").inner_text() == "from elsewhere"
    page.locator("#mark-on").click()
    at(page, 151)
    page.locator("#go-on").click()
    expect(page.locator("#go-on")).to_be_disabled()
    wait_for(lambda: (api.get("live").json()["fork"] or {}).get("tick") == 151)
    expect(page.locator("#go-on")).to_have_text("Go on from here")
    expect(page.locator("#moment-text")).to_have_text("now")


def test_a_recording_that_is_dropped_on_the_scene_says_why_there_is_no_going_on_without_its_run_json(page, files):
    frame = page.locator("#viewer").element_handle().content_frame()
    assert frame is not None
    transfer = frame.evaluate_handle(
        """([name, content]) => {
          const transfer = new DataTransfer();
          transfer.items.add(new File([Uint8Array.from(atob(content), (c) => c.charCodeAt(0))], name));
          return transfer;
        }""",
        ["walk.npz", base64.b64encode(files[0]["buffer"]).decode()],
    )
    scene = frame.locator("body")
    scene.dispatch_event("dragover", {"dataTransfer": transfer})
    expect(page.locator("body")).to_contain_class("is-dropping")
    scene.dispatch_event("drop", {"dataTransfer": transfer})
    at(page, 0)
    expect(page.locator("body")).not_to_contain_class("is-dropping")
    assert page.locator("#past-of option:checked").inner_text() == "walk"
    page.locator("#go-on").click()
    expect(page.locator("#notices")).to_contain_text("without run.json")


def drop(page: Page, *paths: Path) -> None:
    """Drop files and folders of this machine on the scene, as a person does from a file manager."""
    session = page.context.new_cdp_session(page)
    data = {"items": [], "files": [str(path) for path in paths], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        session.send("Input.dispatchDragEvent", {"type": kind, "x": 500, "y": 300, "data": data})


def test_a_folder_that_is_dropped_is_opened_if_a_run_is_among_its_files(page, files, tmp_path):
    run, other = tmp_path / "run", tmp_path / "other"
    for folder in (run, other):
        folder.mkdir()
        for k in range(1000):  # a browser tells a hundred files of a folder at a time
            (folder / f"{k}.txt").touch()
    for file in files:
        (run / file["name"]).write_bytes(file["buffer"])
    drop(page, other)
    expect(page.locator("#notices")).to_contain_text("no recording here")
    drop(page, run)
    at(page, 0)
    assert page.locator("#past-of option:checked").inner_text() == "from elsewhere"
    expect(page.locator("body")).not_to_contain_class("is-dropping")


def test_what_is_no_recording_is_refused_with_its_reason(page):
    for name, reason in (("picture.png", "no recording here"), ("walk.csv", "must be a recording")):
        payload = FilePayload(name=name, mimeType="text/plain", buffer=b"hello")
        page.locator("#recording-file").set_input_files([payload])
        expect(page.locator("#notices")).to_contain_text(reason)
    expect(page.locator("#open-file")).to_be_enabled()
