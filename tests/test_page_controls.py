"""Controls and displays of the page; the three-dimensional scene is left out, which costs most."""

import re
from collections.abc import Callable
from typing import Any

import httpx
import pytest
from conftest import DESKTOP, PATIENCE, PHONE, UP, Server, live, serving, start_server, wait_for
from playwright.sync_api import Page, expect
from pointers import Finger, Mouse, centre


@pytest.fixture
def visit(visit: Callable[..., Page], server: Server, api: httpx.Client) -> Callable[..., Page]:
    """Opens the page without its scene, once it tells of the robot."""

    def open_page(url: str = "", before: str = "", **device: Any) -> Page:
        page = visit(url or server.url, before=before, **(device or DESKTOP))
        expect(page.get_by_test_id("status")).to_contain_text(UP)
        return page

    return open_page


def wait_for_reference(api: httpx.Client, **signs: int) -> dict:
    """The first state whose reference has these signs, zero where none is given."""

    def fits(state: dict) -> bool:
        return all(
            (state[f"reference_{name}"] > 0) - (state[f"reference_{name}"] < 0) == signs.get(name, 0)
            for name in ("vx", "vy", "yaw_rate")
        )

    seen: list[dict] = []
    wait_for(lambda: seen.append(live(api)) or fits(seen[-1]))
    return seen[-1]


def test_the_source_touched_last_drives_and_gives_back_what_is_still_held(visit, api):
    page = visit()
    page.keyboard.down("i")
    assert wait_for_reference(api, vx=1)["driver"] == "keyboard"
    mouse, (x, y) = Mouse(page), centre(page.get_by_test_id("joystick"))
    mouse.drag((x, y), (x + 60, y))
    assert wait_for_reference(api, vy=-1)["driver"] == "joystick"
    expect(page.get_by_test_id("driver")).to_have_text("you drive: joystick")
    mouse.lift()
    assert wait_for_reference(api, vx=1)["driver"] == "keyboard"
    page.keyboard.up("i")
    assert wait_for_reference(api)["driver_client"] != ""
    wait_for(lambda: live(api)["driver"] == "none")


def test_keys_drive_while_the_scene_has_the_focus(visit, api):
    page = visit()
    page.mouse.click(640, 300)
    assert page.evaluate("document.activeElement.id") == "viewer"
    ways = {"j": {"yaw_rate": 1}, "d": {"yaw_rate": -1}, "w": {"vx": 1}, "k": {"vx": -1}, "q": {"vy": 1}}
    for key, expected in ways.items():
        page.keyboard.down(key)
        wait_for_reference(api, **expected)
        page.keyboard.up(key)
        wait_for_reference(api)


FROM_THE_FRONT = """
const world = {matrixWorld: {elements: [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1]}}; // z is three.js's y
const camera = {matrixWorld: {elements: [0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1]}}; // looks along -x
const cameraControl = {rotate: () => {}, setLookAt: (...at) => (window.placed = at)};
window.__viserMutable = {nodeRefFromName: {"/w": world}, camera, cameraControl};
"""


def test_stick_and_ring_mean_directions_of_the_picture(visit, api):
    page = visit(before=FROM_THE_FRONT)
    expect(page.locator("body")).to_have_class(re.compile("is-turned"))
    mouse, (x, y) = Mouse(page), centre(page.get_by_test_id("joystick"))
    mouse.drag((x, y), (x, y + 60))  # towards the viewer, whom the robot faces
    wait_for_reference(api, vx=1)
    mouse.lift()
    mouse.drag((x, y), (x + 60, y))
    wait_for_reference(api, vy=1)
    mouse.lift()
    x, y = centre(page.locator("#ring"))
    page.mouse.click(x - 72, y)
    page.keyboard.press("Space")
    wait_for(lambda: live(api)["last_push"] is not None)
    forward, left = live(api)["last_push"]["impulse"]
    assert left < 0.0 and abs(forward) < 0.1


def test_views_are_chosen_by_button_and_key_and_remembered(visit):
    page = visit(before=FROM_THE_FRONT)
    views = page.get_by_test_id("views")
    scene = page.frames[1]
    scene.wait_for_function("typeof placed !== 'undefined' && placed[0] < 0")  # behind the robot
    views.get_by_role("button", name="Front").click()
    scene.wait_for_function("placed[0] > 0")  # before it
    page.keyboard.press("4")
    scene.wait_for_function("placed[1] > 2.3")  # above it
    page.reload()
    expect(views.get_by_role("button", name="Top")).to_have_attribute("aria-pressed", "true")


@pytest.mark.exhaustive
@pytest.mark.parametrize("across", [0, 25])
def test_the_mouse_walks_the_robot_backward_in_physics_until_it_lets_go(visit, across):
    pytest.importorskip("mujoco", reason="mujoco-core is not installed on this platform")
    with serving("--scene", "light", "--plant", "mujoco") as server, server.client() as api:
        page = visit(server.url)
        mouse, (x, y) = Mouse(page), centre(page.get_by_test_id("joystick"))
        begin = live(api)["measured_com_x"]
        mouse.drag((x, y), (x + across, y + 60))
        wait_for_reference(api, vx=-1, **({"vy": -1} if across else {}))
        wait_for(lambda: live(api)["measured_com_x"] < begin - 0.3)
        mouse.lift()
        wait_for_reference(api)
        wait_for(lambda: live(api)["phase"] == 0)
        state = live(api)
        assert state["status"] == 0 and abs(state["measured_com_vx"]) < 0.05
        assert state["left_force"] + state["right_force"] == pytest.approx(90.27 * 9.81, rel=0.1)


def test_zero_stops_a_held_key_until_the_next_touch(visit, api):
    page = visit()
    page.keyboard.down("i")
    wait_for_reference(api, vx=1)
    page.keyboard.press("h")
    wait_for_reference(api)
    wait_for(lambda: live(api)["driver"] == "none")
    page.keyboard.down("u")
    wait_for_reference(api, vx=1, vy=1)
    page.keyboard.up("u")
    page.keyboard.up("i")


def test_the_zero_button_ends_a_reference_of_whoever_gave_it(visit, api):
    page = visit()
    api.put("live/reference", json={"vx": 0.1})
    wait_for_reference(api, vx=1)
    page.get_by_test_id("zero").click()
    wait_for_reference(api)


def test_status_tells_speed_and_tick_time(visit, api):
    status = visit().get_by_test_id("status")
    api.put("live/reference", json={"vx": 0.15})
    expect(status).to_contain_text(re.compile(r"reference\s*0\.15"))
    expect(status).to_contain_text(re.compile(r"tick\s*\d+\.\d"))


@pytest.mark.exhaustive
def test_two_browsers_and_a_phone_see_who_drives(visit, api):
    watching, keys, phone = visit(), visit(), visit(**PHONE)
    keys.keyboard.down("i")
    expect(keys.get_by_test_id("driver")).to_have_text("you drive: keyboard")
    for other in (watching, phone):
        expect(other.get_by_test_id("driver")).to_have_text("another browser drives: keyboard")
    finger, (x, y) = Finger(phone), centre(phone.get_by_test_id("joystick"))
    shown = [page.get_by_test_id("driver") for page in (phone, keys)]
    drivers: list[str] = []

    def is_taken_over() -> bool:
        # A page that the machine holds up for longer than its hold lasts loses the robot to the key, which is held,
        # too: then the finger takes hold anew.
        drivers.append(live(api)["driver"])
        if drivers[-1] != "joystick" and ("joystick" in drivers or len(drivers) > 100):
            finger.lift()
            finger.drag((x, y), (x, y + 50))
            drivers.clear()
        return [each.inner_text() for each in shown] == ["you drive: joystick", "another browser drives: joystick"]

    finger.drag((x, y), (x, y + 50))
    wait_for(is_taken_over)
    seen = [live(api)["driver"] for _ in range(10)]
    # The key that is held must not pull the robot to and fro: the finger that lost it once does not get it back.
    assert re.fullmatch("j*[kn]*", "".join(driver[0] for driver in seen)), seen
    finger.lift()
    wait_for_reference(api, vx=1)
    keys.keyboard.up("i")
    wait_for_reference(api)


FAKE_GAMEPAD = """
const pad = {id: "Fake pad", index: 0, connected: true, mapping: "standard", axes: [0, 0, 0, 0],
             buttons: Array.from({length: 12}, () => ({pressed: false, value: 0}))};
window.pads = [null, pad];
window.pad = pad;
navigator.getGamepads = () => window.pads;
"""


def test_gamepad_drives_beyond_its_dead_zone_and_pushes_and_pauses(visit, api):
    page = visit(before=FAKE_GAMEPAD)
    expect(page.locator("#notices")).to_contain_text("Gamepad connected: Fake pad")
    page.evaluate("pad.axes = [0.05, -0.1, 0.1, 0]")
    page.wait_for_timeout(300)
    assert live(api)["driver"] == "none"
    page.evaluate("pad.axes = [0, -1, 0, 0]")
    assert wait_for_reference(api, vx=1)["driver"] == "gamepad"
    page.evaluate("pads = []")
    expect(page.locator("#notices")).to_contain_text("Gamepad gone")
    wait_for_reference(api)
    page.evaluate("pad.axes = [0, 0, 0, 0]; pads = [pad]; pad.buttons[9] = {pressed: false, value: 0}")
    page.wait_for_timeout(200)
    page.evaluate("pad.buttons[9] = {pressed: true, value: 1}")
    wait_for(lambda: not live(api)["running"])
    page.evaluate("pad.buttons[0] = {pressed: true, value: 1}")
    wait_for(lambda: api.post("live/step").json()["push_y"] > 0.0)


def test_gamepad_is_tested_and_remapped_and_the_page_remembers_it(visit, api):
    page = visit(before=FAKE_GAMEPAD)
    page.get_by_role("button", name="Gamepad", exact=True).click()
    dialog = page.locator("#gamepad-dialog")
    expect(dialog).to_contain_text("Fake pad")
    page.evaluate("pad.axes = [0, 0.75, 0, 0]; pad.buttons[3] = {pressed: true, value: 1}")
    expect(dialog.get_by_role("meter", name="Axis 1")).to_have_js_property("value", 0.75)
    expect(dialog.locator("#gamepad-buttons .on")).to_have_text("3")
    assert live(api)["driver"] == "none", "the robot listens while the pad is being tested"
    page.evaluate("pad.axes = [0, 0, 0, 0]; pad.buttons[3] = {pressed: false, value: 0}")
    dialog.get_by_role("button", name="forward: axis 1 −").click()
    expect(dialog).to_contain_text("move a stick: forward")
    page.evaluate("pad.axes = [0, 0, 0, 0.9]")
    expect(dialog.get_by_role("button", name="forward: axis 3 +")).to_be_visible()
    page.evaluate("pad.axes = [0, 0, 0, 0]")
    dialog.get_by_role("button", name="zero: button 1").click()
    page.evaluate("pad.buttons[5] = {pressed: true, value: 1}")
    expect(dialog.get_by_role("button", name="zero: button 5")).to_be_visible()

    page.reload()
    expect(page.get_by_test_id("status")).to_contain_text(UP)
    page.evaluate("pad.axes = [0, 0, 0, -1]")
    wait_for_reference(api, vx=-1)
    page.evaluate("pad.buttons[5] = {pressed: true, value: 1}")
    wait_for_reference(api)


def test_page_tells_where_a_browser_gives_no_gamepads(visit):
    page = visit(before="Object.defineProperty(window, 'isSecureContext', {value: false})")
    page.get_by_role("button", name="Gamepad", exact=True).click()
    expect(page.get_by_test_id("gamepad-note")).to_contain_text("https")


def test_page_that_is_no_longer_seen_lets_go(visit, api):
    page = visit()
    page.keyboard.down("i")
    wait_for_reference(api, vx=1)
    page.evaluate("""Object.defineProperty(document, 'hidden', {value: true, configurable: true});
                     document.dispatchEvent(new Event('visibilitychange'))""")
    wait_for_reference(api)
    page.keyboard.up("i")


def test_hint_leaves_with_the_first_use_for_good(visit):
    page = visit()
    driver, push = page.get_by_test_id("driver"), page.get_by_test_id("last-push")
    expect(driver).to_have_text("Drag to walk, or hold W")
    expect(push).to_have_text("Aim the ring, then push")
    page.keyboard.press("j", delay=300)
    page.keyboard.press("Space")
    expect(driver).to_have_text("nobody drives")
    expect(push).not_to_have_text("Aim the ring, then push")
    page.reload()
    expect(driver).to_have_text("nobody drives")


def test_a_second_finger_pushes_while_the_first_one_holds_the_stick(visit, api):
    page = visit(**PHONE)
    finger, (x, y) = Finger(page), centre(page.get_by_test_id("joystick"))
    finger.drag((x, y), (x, y - 50))
    wait_for(lambda: live(api)["reference_vx"] > 0.0)
    finger.tap_beside((x, y - 50), centre(page.get_by_test_id("push")))
    wait_for(lambda: live(api)["last_push"] is not None)
    assert page.get_by_test_id("joystick").evaluate("(stick) => stick.classList.contains('held')")
    finger.lift()


def test_page_tells_what_became_of_the_last_push(visit, api):
    page = visit()
    page.get_by_test_id("push").click()
    expect(page.get_by_test_id("last-push")).to_have_text(re.compile(r"12 N·s: caught (in \d steps?|without a step)"))
    assert live(api)["last_push"]["impulse"] == pytest.approx([0.0, 12.0], abs=1e-6), "to the left"
    api.post("live/push", json={"impulse": [0.0, -60.0]})
    expect(page.get_by_test_id("last-push")).to_have_text("fell to 60 N·s")
    expect(page.get_by_test_id("status")).to_contain_text("fallen")
    expect(page.get_by_test_id("stand-up")).to_be_visible()
    page.get_by_test_id("reset").click()
    expect(page.get_by_test_id("status")).to_contain_text(UP)


SHOW_LIMIT = """async ([degrees, value, isOn]) => {
  const { PushRose } = await import("/static/push.js");
  const rose = { survived: [40, 20, 10, 60], bound: [50, 30, 12, 90] };  // ahead, left, back, right
  const dial = { degrees, strength: { value, max: 60, step: 1 } };
  const shown = new PushRose({ dial, client: "", request: async () => ({}) });
  shown.button.ariaPressed = isOn;
  shown.show({ push_rose: rose, status: 0 });
  const caption = document.getElementById("push-limit");
  return [caption.textContent, caption.dataset.outcome];
}"""


def test_beside_the_dial_stands_how_hard_a_push_in_its_direction_would_be_survived(visit):
    page = visit()
    expect(page.get_by_test_id("push-limit")).to_be_hidden()
    aims = ((0, 12), (45, 12), (180, 12), (-90, 60), (-135, 12))
    found = {aim: page.evaluate(SHOW_LIMIT, [*aim, "true"]) for aim in aims}
    assert found == {
        (0, 12): ["survives 40 of 50 N·s from here", ""],
        (45, 12): ["survives 30 of 40 N·s from here", ""],
        (180, 12): ["too hard: survives 10 of 12 N·s from here", "bad"],
        (-90, 60): ["survives all of 60 N·s from here", ""],
        (-135, 12): ["survives 35 of 51 N·s from here", ""],
    }
    assert page.evaluate(SHOW_LIMIT, [0, 12, "false"]) == ["", ""], "of others, who draw the rose"


def test_the_button_at_the_dial_draws_the_rose_in_its_own_browser_as_the_panel_does(visit, api):
    other, page = visit(), visit()
    rose = page.get_by_test_id("rose")
    with page.expect_request("**/live/layers*") as switched:
        rose.click()
    expect(rose).to_have_attribute("aria-pressed", "true")
    layers = switched.value.url.removeprefix(f"{page.url}api/v1/")
    assert "client=" in layers
    wait_for(lambda: api.get(layers).json()["push_rose"])
    assert not api.get("live/layers").json()["push_rose"], "nobody else sees it"
    expect(other.get_by_test_id("rose")).to_have_attribute("aria-pressed", "false")
    page.keyboard.press("n")
    expect(rose).to_have_attribute("aria-pressed", "false")
    wait_for(lambda: not api.get(layers).json()["push_rose"])
    api.patch(layers, json={"push_rose": True})  # as a switch of the panel does, in the scene's frame
    page.frame_locator("#viewer").locator("#root").dispatch_event("click")
    expect(rose).to_have_attribute("aria-pressed", "true")


@pytest.mark.exhaustive
def test_push_pressed_before_the_connection_is_open_is_given_once_it_is(visit, api):
    page, held = visit(), []
    page.route("**/teleop_worker.js*", lambda route: held.append(route))
    before = api.get("live").json()["last_push"]
    page.reload()
    expect(page.get_by_test_id("status")).to_contain_text(UP)
    page.get_by_test_id("push").click()
    held[0].continue_()
    wait_for(lambda: api.get("live").json()["last_push"] != before)


@pytest.mark.exhaustive
def test_random_pushes_are_a_mode_that_every_browser_shows(visit, api):
    page, other = visit(), visit()
    page.get_by_test_id("random").click()
    for each in (page, other):
        expect(each.get_by_test_id("random")).to_have_attribute("aria-pressed", "true")
    assert live(api)["random_pushes"]["strength"] == 12.0
    page.get_by_label("Strength of the push in newton seconds").focus()
    page.keyboard.press("ArrowRight")
    wait_for(lambda: live(api)["random_pushes"]["strength"] == 13.0)
    other.get_by_test_id("random").click()
    wait_for(lambda: live(api)["random_pushes"] is None)


def test_link_carries_what_was_chosen_and_asks_before_it_changes_the_robot(visit, api, server):
    before, layers = api.get("live/parameters").json(), api.get("live/layers").json()
    try:
        api.patch("live/parameters", json={"scheme": "speed_and_jerk", "alpha": 2e-6})
        api.put("live/reference", json={"vx": 0.1})
        page = visit(**DESKTOP, permissions=["clipboard-read", "clipboard-write"])
        wait_for(lambda: live(api)["driver"] == "rest")
        chosen_layers = {"velocity": True, "trails": True, "robot": False}
        api.patch(f"live/layers?client={client_of(page)}", json=chosen_layers).raise_for_status()
        page.keyboard.press("3")
        page.get_by_role("button", name="Copy link").click()
        expect(page.locator("#notices")).to_contain_text("Link copied: scheme speed and jerk")
        link = page.evaluate("navigator.clipboard.readText()")
        chosen = "scheme=speed_and_jerk&alpha=0.000002&show=trails+velocity&hide=robot&vx=0.1&view=side"
        assert link == f"{server.url}#{chosen}"

        api.patch("live/parameters", json=before)
        api.put("live/reference", json={})
        other = visit(link)
        wait_for(lambda: api.get(f"live/layers?client={client_of(other)}").json() == layers | chosen_layers)
        expect(other.locator("#notices")).to_contain_text("changes the robot for everybody")
        assert api.get("live/parameters").json() == before
        expect(other.get_by_role("button", name="Side")).to_have_attribute("aria-pressed", "true")
        other.get_by_role("button", name="Apply").click()
        expect(other.locator("#notices")).to_contain_text("Applied")
        assert api.get("live/parameters").json() == before | {"scheme": "speed_and_jerk", "alpha": 2e-6}
        assert api.get("live/layers").json() == layers, "those of others"
        wait_for_reference(api, vx=1)
        assert other.url == server.url
    finally:
        api.patch("live/parameters", json=before)


def client_of(page: Page) -> str:
    """Name of a page's controls, by the address of its scene's websocket."""
    found = re.search(r"client%3D([\w-]+)", page.locator("#viewer").get_attribute("src") or "")
    assert found is not None
    return found[1]


@pytest.mark.exhaustive
def test_preset_of_a_link_is_played_when_it_is_asked_for(visit, api, server):
    page = visit(f"{server.url}#preset=shove")
    notices = page.locator("#notices")
    expect(notices).to_contain_text("Shove it: it starts the robot anew")
    page.wait_for_timeout(1500)
    assert live(api)["last_push"] is None
    notices.get_by_role("button", name="Play").click()
    wait_for(lambda: (live(api)["last_push"] or {}).get("impulse") == pytest.approx([20.0, 0.0], abs=0.1))
    page.keyboard.press("w", delay=300)  # who drives ends it
    wait_for(lambda: live(api)["driver"] == "none")
    wait_for(lambda: live(api)["t"] > 7.0)
    assert live(api)["last_push"]["impulse"] == pytest.approx([20.0, 0.0], abs=0.1)


@pytest.mark.exhaustive
def test_preset_asks_other_robots_for_their_fastest_and_no_more(visit, api):
    limits = {robot["name"]: robot["limits"] for robot in api.get("robots").json()}
    scaled = visit().evaluate(
        """async (limits) => {
          const { scaled } = await import("/static/presets.js");
          const fastest = (side) => ({ vx: limits.talos.vx[side], vy: limits.talos.vy[side] });
          const asked = (to, side) => scaled({ reference: fastest(side) }, limits.talos, to).reference;
          return Object.entries(limits).map(([name, to]) => [name, asked(to, 0), asked(to, 1)]);
        }""",
        limits,
    )
    assert len(scaled) == len(limits)
    for name, *both in scaled:
        for side, asked in enumerate(both):
            assert asked == {key: limits[name][key][side] for key in ("vx", "vy")}, name


def test_tour_is_offered_once_and_what_waits_for_time_says_so(visit, api):
    page = visit()
    page.get_by_role("button", name="Show me").click()
    for step in range(1, 6):
        expect(page.locator("#tour")).to_contain_text(f"{step} of 5")
        page.locator("#tour-next").click()
    expect(page.locator("#tour")).to_be_hidden()
    page.keyboard.press("p")
    wait_for(lambda: not live(api)["running"])
    expect(page.get_by_test_id("status")).to_contain_text("paused")
    page.get_by_test_id("push").click()
    expect(page.locator("#notices")).to_contain_text("This waits until you resume")
    page.reload()
    expect(page.get_by_test_id("status")).to_contain_text("paused")
    expect(page.locator("#notices")).not_to_contain_text("New here")


def test_refusal_is_shown_in_words(visit, server):
    page = visit(f"{server.url}#scheme=magic")
    page.get_by_role("button", name="Apply").click()
    expect(page.locator("#notices")).to_contain_text('scheme = "magic": must be one of')


def test_software_renderer_gets_the_light_view_unless_told_otherwise(visit):
    page = visit()
    viewer = page.get_by_test_id("viewer")
    expect(viewer).to_have_attribute("data-quality", "light")
    expect(viewer).to_have_attribute("src", re.compile("viewer%2Flight"))
    page.keyboard.press("?")
    page.get_by_label("Render quality").select_option("full")
    expect(viewer).to_have_attribute("data-quality", "full")
    page.reload()
    expect(viewer).to_have_attribute("data-quality", "full")


SLOW_GRAPHICS_CARD = """
WebGL2RenderingContext.prototype.getParameter = () => "A graphics card";
const soon = window.requestAnimationFrame;
window.requestAnimationFrame = (draw) => setTimeout(() => soon(draw), 200);
"""


@pytest.mark.exhaustive
def test_slow_scene_is_loaded_anew_with_less_to_draw(visit):
    page = visit(before=SLOW_GRAPHICS_CARD)
    viewer = page.get_by_test_id("viewer")
    expect(viewer).to_have_attribute("data-quality", "full")
    expect(viewer).to_have_attribute("data-quality", "light")
    expect(page.locator("#notices")).to_contain_text("slow")


@pytest.mark.exhaustive
def test_page_says_that_the_connection_is_lost_and_finds_a_server_that_restarts(visit):
    server = start_server("--robot", "hrp2")
    port = server.host.rpartition(":")[2]
    try:
        page = visit(server.url)
        status = page.get_by_test_id("status")
        server.process.terminate()
        server.process.wait(PATIENCE)
        expect(status).to_contain_text("no connection")
        expect(page.get_by_role("alert")).to_contain_text("retrying")
        server = start_server("--robot", "hrp2", "--port", port)
        expect(status).to_contain_text(UP)
        page.keyboard.down("i")
        with server.client() as api:
            wait_for_reference(api, vx=1)
    finally:
        server.process.terminate()
        server.process.wait(PATIENCE)
