"""Every control of the page is inside the window, reachable and uncovered, at every size and in every state."""

from collections.abc import Callable
from typing import Any

import httpx
import pytest
from axe_playwright_python.sync_playwright import Axe
from conftest import DESKTOP, PHONE, UP, Server, wait_for
from playwright.sync_api import Page, expect
from pointers import centre

# Sizes at which something was out of reach once: tablets and phones, both ways round, with the panel and without.
SIZES = [
    (320, 360), (320, 568), (360, 640), (390, 844), (740, 360), (932, 430), (640, 560), (721, 500), (820, 1180),
    (950, 620), (1081, 700), (1180, 820),
]  # fmt: skip
WIDTHS, HEIGHTS = range(320, 1501, 59), range(360, 1101, 148)
FONTS = ["Liberation Sans Narrow", "DejaVu Sans"]  # the narrowest and the widest here
ALWAYS = {"zero", "stop", "speed", "reset", "help", "panel", "share", "save", "views"}
PADS = {"joystick", "turn", "ring", "push", "rose", "strength", "random"}
TIME_LINE = {
    "moment", "mark-back", "tick-back", "play", "tick-on", "mark-on", "play-speed", "present", "go-on-with", "go-on",
}  # fmt: skip
MORE = {"walking": set(), "paused": {"one-tick", "one-sample"}, "fallen": {"stand-up"}}

# As viser lays out its panel: beside the scene, or on a narrow window below it.
SCENE = """<!doctype html><html><head><style>
  body { margin: 0 } [data-dock-root], [data-dock-root] > * { position: absolute; inset: 0 }
  html:not(.no-panel) [data-dock-root] > * { right: 308px }
  @media (max-width: 576px) { html:not(.no-panel) [data-dock-root] > * { inset: 0 0 44% 0 } }
</style></head><body id=root><div data-dock-root><div>scene</div></div></body></html>"""

TROUBLE = """(required) => {
  const inside = document.querySelector("iframe").contentDocument;
  const inner = inside.querySelector("[data-dock-root] > *").getBoundingClientRect();
  const scene = document.querySelector("main").getBoundingClientRect();
  const found = [];
  const controls = "button, select, input, .joystick, .turn, .ring, .caption, .who, #views, #alarm-text, .track, .when";
  const isThere = (e) =>
    !e.closest("dialog, #notices, #lesson > :not(header)") && e.checkVisibility({visibilityProperty: true}) &&
    (e.textContent || !e.matches(".caption"));
  const shown = [...document.querySelectorAll(controls)].filter(isThere);
  const ids = new Set(shown.map((e) => e.id));
  for (const id of required) if (!ids.has(id)) found.push(`${id} is not there`);
  for (const e of shown) {
    const name = e.id || e.className;
    const { left, right, top, bottom, width, height } = e.getBoundingClientRect();
    const [x, y] = [(left + right) / 2, (top + bottom) / 2];
    const isOnScene = e.closest("main") !== null;
    const isBelow = e.closest(".timeline") !== null;
    const far = isOnScene ? inner.right : innerWidth;
    const low = isOnScene ? scene.top + inner.bottom : isBelow ? innerHeight : scene.top;
    if (isBelow && top < scene.bottom - 0.5) found.push(`${name} is on the scene`);
    if (left < -0.5 || top < -0.5 || right > far + 0.5 || bottom > low + 0.5) found.push(`${name} is outside`);
    if (e.matches("button, select") && Math.min(width, height) < 24) found.push(`${name} is too small`);
    if (e.matches("button") && e.scrollWidth > e.clientWidth + 1) found.push(`${name} is cut off`);
    const points = [[left + 3, y], [right - 3, y], [x, top + 3], [x, bottom - 3]];
    if (!e.matches(".ring")) points.push([x, y]); // whose middle is a button
    for (const [px, py] of points) {
      const hit = document.elementFromPoint(px, py);
      if (!hit || !e.contains(hit)) {
        found.push(`${name} is covered by ${hit?.id || hit?.className || hit?.tagName}`);
        break;
      }
    }
  }
  return found;
}"""


@pytest.fixture
def page(visit: Callable[..., Page], server: Server, api: httpx.Client) -> Page:
    """The page, with an empty scene and panel."""
    page = visit(server.url, SCENE)
    expect(page.locator("#robot")).to_have_text("Talos")
    return page


def bring_about(state: str, page: Page, api: httpx.Client) -> None:
    """Let the robot walk, pause, or fall."""
    api.post("live/reset")
    api.post("live/resume")
    if state == "fallen":
        api.post("live/push", json={"impulse": [0.0, 60.0]})
        wait_for(lambda: api.get("live").json()["status"] == 2)
    elif state == "paused":
        api.post("live/push", json={"impulse": [0.0, 12.0]})
        wait_for(lambda: (api.get("live").json()["last_push"] or {}).get("survived") is not None)
        api.post("live/pause")
    words = {"walking": "standing", "paused": "paused", "fallen": "fallen"}[state]
    expect(page.locator("#state")).to_contain_text(words)


def trouble(
    page: Page,
    sizes: list[tuple[int, int]],
    state: str,
    fonts: list[str],
    more: frozenset[str] = frozenset(),
    lowest: int = 480,
) -> list[str]:
    """All that is wrong at some sizes, with the panel and without; `more` is open, with the pads from a height on."""
    found = []
    for font in fonts:
        page.evaluate("(font) => (document.documentElement.style.fontFamily = font)", font)
        for has_panel in (False, True):
            if page.evaluate("document.body.classList.contains('has-panel')") is not has_panel:
                page.evaluate("document.getElementById('panel').click()")
            for width, height in sizes:
                page.set_viewport_size({"width": width, "height": height})
                page.evaluate("new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)))")
                required = ALWAYS | {"time-back"} | MORE[state] | (more if width > 576 or not has_panel else set())
                if not has_panel and state != "fallen" and (not more or height >= lowest):
                    required |= PADS
                wrong = page.evaluate(TROUBLE, sorted(required))
                found += [f"{width}x{height} {state} {'panel ' * has_panel}{font}: {each}" for each in wrong]
    return found


def test_controls_fit_windows_at_which_they_once_did_not(page, api):
    found = []
    for state in MORE:
        bring_about(state, page, api)
        found += trouble(page, SIZES, state, FONTS[1:])
    assert found == []


def test_the_time_line_fits_too_and_lies_on_nothing(page, api):
    bring_about("paused", page, api)
    api.post("live/fork", json={"tick": 1})  # whose numbers stand below the time line
    page.locator("#time-back").click()
    expect(page.locator("#fork-numbers")).to_be_visible()
    assert trouble(page, SIZES, "paused", FONTS[1:], frozenset(TIME_LINE)) == []


REACHED = """async (names) => {
  const card = document.getElementById("lesson"), { left, right, top, bottom } = card.getBoundingClientRect();
  const inside = document.querySelector("iframe").contentDocument;
  const inner = inside.querySelector("[data-dock-root] > *").getBoundingClientRect();
  const scene = document.querySelector("main").getBoundingClientRect();
  const isInside = left >= 0 && top >= scene.top && right <= inner.right && bottom <= scene.top + inner.bottom;
  const found = isInside ? [] : ["the card is outside"];
  if (card.scrollWidth > card.clientWidth) found.push("the card is too narrow");
  const isLonger = card.scrollHeight > card.clientHeight; // scripts scroll what a person cannot
  const canScroll = ["auto", "scroll"].includes(getComputedStyle(card).overflowY);
  if (isLonger && !canScroll) found.push("the card cannot be scrolled");
  for (const e of card.querySelectorAll(names)) {
    e.scrollIntoView({ block: "center" });
    const box = e.getBoundingClientRect();
    const hit = document.elementFromPoint((box.left + box.right) / 2, (box.top + box.bottom) / 2);
    if (!e.contains(hit)) found.push(`${e.id || e.tagName} cannot be reached`);
  }
  card.scrollTop = 0;
  return found;
}"""


def lesson_trouble(page: Page, sizes: list[tuple[int, int]], fonts: list[str]) -> list[str]:
    """All that is wrong with an open lesson and what is around it."""
    page.locator("#presets").click()
    page.locator("#lessons-list button").first.click()
    expect(page.locator("#lesson")).to_be_visible()
    found = trouble(page, sizes, "walking", fonts, frozenset({"lesson-end"}), lowest=660)
    for width, height in sizes:
        page.set_viewport_size({"width": width, "height": height})
        if page.evaluate("document.body.classList.contains('has-panel')"):
            page.evaluate("document.getElementById('panel').click()")
        page.evaluate("new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)))")
        found += [f"{width}x{height}: {each}" for each in page.evaluate(REACHED, "label, #lesson-run")]
    return found


def test_a_lesson_fits_and_all_of_it_can_be_reached(page, api):
    bring_about("walking", page, api)
    assert lesson_trouble(page, SIZES, FONTS[1:]) == []


@pytest.mark.exhaustive
def test_a_lesson_fits_every_window(page, api):
    bring_about("walking", page, api)
    assert lesson_trouble(page, [(width, height) for height in HEIGHTS for width in WIDTHS], FONTS[1:]) == []


@pytest.mark.exhaustive
@pytest.mark.parametrize("state", MORE)
def test_controls_fit_every_window(page, api, state):
    bring_about(state, page, api)
    sizes = [(width, height) for height in HEIGHTS for width in WIDTHS]
    assert trouble(page, sizes, state, FONTS) == []


@pytest.mark.exhaustive
def test_the_time_line_fits_every_window(page, api):
    bring_about("paused", page, api)
    api.post("live/fork", json={"tick": 1})
    page.locator("#time-back").click()
    sizes = [(width, height) for height in HEIGHTS for width in WIDTHS]
    assert trouble(page, sizes, "paused", FONTS, frozenset(TIME_LINE)) == []


# With the stand-in of all tests in place of the scene.


def opened(visit: Callable[..., Page], server: Server, **device: Any) -> Page:
    """The page, once it tells of the robot, which tests before may have left paused or fallen."""
    with server.client() as api:
        api.post("live/resume")
        api.post("live/reset")
    page = visit(server.url, **device)
    expect(page.get_by_test_id("status")).to_contain_text(UP)
    return page


def test_controls_keep_to_the_scene_where_the_panel_is_beside_it(visit, server):
    page = opened(visit, server, **DESKTOP)
    page.get_by_role("button", name="Panel").click()
    page.frames[1].evaluate("""document.body.innerHTML =
        '<div data-dock-root><div style="position: absolute; inset: 0 300px 40px 0"></div></div>'""")
    push, dock = page.get_by_test_id("push"), page.get_by_test_id("stop")
    wait_for(lambda: centre(push)[0] < 1280 - 300 and centre(push)[1] < 800 - 40)
    assert centre(dock)[0] == pytest.approx((1280 - 300) / 2, abs=100)


@pytest.mark.parametrize(("device", "colours"), [(DESKTOP, "light"), (PHONE, "dark")], ids=["desktop", "phone"])
def test_axe_finds_nothing_serious(visit, server, device, colours):
    page = opened(visit, server, **device, color_scheme=colours, reduced_motion="reduce")
    found = {"page": serious(page)}
    page.get_by_role("button", name="Help").click()
    found["help"] = serious(page)
    page.get_by_role("button", name="Gamepad …").click()
    found["gamepad"] = serious(page)
    assert found == {"page": [], "help": [], "gamepad": []}


def serious(page: Page) -> list[str]:
    violations = Axe().run(page, options={"iframes": False}).response["violations"]
    return [
        f"{v['id']}: {node['target']} {node['failureSummary']}"
        for v in violations
        if v["impact"] in ("serious", "critical")
        for node in v["nodes"]
    ]


def test_everything_is_reached_by_the_keyboard(visit, server):
    page = opened(visit, server, **DESKTOP)
    reached = set()
    for _ in range(40):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id"))
    controls = {"joystick", "turn", "zero", "stop", "speed", "reset", "ring", "push", "strength", "random"}
    assert reached >= controls | {"presets", "gamepad", "share", "save", "help", "panel"}
