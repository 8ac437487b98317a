"""The scene in a real browser: drags of the robot's body, and the panel beside it. viser complains of the former."""

import time

import numpy as np
import pytest
from conftest import PATIENCE, SMALL_PHONE, wait_for
from playwright.sync_api import expect
from pointers import Finger, Mouse, centre

from app.viewer.scene.layers import LAYERS

LOSE_FOCUS = "window.dispatchEvent(new Event('blur'))"


def chest_of(page):
    box = page.get_by_test_id("viewer").bounding_box()
    x, y = centre(page.get_by_test_id("viewer"))
    return x, y - 0.12 * box["height"]


def push_by(pointer, chest, api):
    """Drag to the right and let go, until the meshes are loaded and the drag pushes the robot."""

    def pushed():
        pointer.drag(chest, (chest[0] + 90, chest[1]))
        time.sleep(0.5)
        pointer.lift()
        time.sleep(0.5)
        return api.get("live").json()["last_push"]

    give_up = time.monotonic() + PATIENCE
    while not (push := pushed()):
        assert time.monotonic() < give_up, "nothing takes hold of the robot"
    return push


def assert_right_and_back(push):
    """The eye is behind the left shoulder: right on the screen is to the right of the robot, and back."""
    x, y = push["impulse"]
    assert 5.0 < np.hypot(x, y) < -2.0 * y and x < 0.0


@pytest.mark.exhaustive
def test_finger_that_drags_the_body_pushes_it_that_way(visit_scene, api):
    page = visit_scene(is_strict=False, **SMALL_PHONE)
    assert_right_and_back(push_by(Finger(page), chest_of(page), api))
    assert_panel_covers_nothing(page)


@pytest.mark.exhaustive
def test_mouse_that_drags_the_body_pushes_it_that_way_unless_escape_or_a_lost_focus_lets_go(visit_scene, api):
    page = visit_scene(is_strict=False)
    pointer, chest = Mouse(page), chest_of(page)
    before = push_by(pointer, chest, api)
    assert_right_and_back(before)
    for let_go in (lambda: page.keyboard.press("Escape"), lambda: page.frames[1].evaluate(LOSE_FOCUS)):
        pointer.drag(chest, (chest[0] - 90, chest[1]))
        time.sleep(0.5)
        let_go()
        time.sleep(1.0)
        pointer.lift()
        time.sleep(1.0)
        assert api.get("live").json()["last_push"]["t"] == before["t"]
    assert_panel_covers_nothing(page)
    for name in ("View", "Plots"):
        tab = page.frame_locator("[data-testid=viewer]").get_by_role("tab", name=name)
        tab.click()
        expect(tab).to_have_attribute("aria-selected", "true")


BOXES = """[...document.querySelectorAll('[data-dock-region], [data-engine], .mantine-Paper-root')]
    .map((element) => [element.matches('canvas') ? 'scene' : 'panel', element.getBoundingClientRect().toJSON()])"""


def boxes_in_scene(page):
    """The places of scene and panel on the page; None while one of them is not there."""
    frame = page.get_by_test_id("viewer").bounding_box()
    found = dict(reversed(page.frames[1].evaluate(BOXES)))  # the outermost of the panel counts
    for box in found.values():
        box["x"] += frame["x"]
        box["y"] += frame["y"]
    return found


def overlap(one, other):
    return all(
        one[start] < other[start] + other[size] - 1 and other[start] < one[start] + one[size] - 1
        for start, size in (("x", "width"), ("y", "height"))
    )


def assert_panel_covers_nothing(page):
    """Neither the scene, which is beside it or above, nor the controls that are there."""
    page.locator("#panel").click()
    controls = [page.get_by_test_id(name) for name in ("joystick", "push", "zero", "reset", "stop")]

    def is_clear():
        boxes = boxes_in_scene(page)
        if {"scene", "panel"} - set(boxes) or not boxes["panel"]["width"]:
            return False
        taken = [boxes["scene"], *(each.bounding_box() for each in controls if each.is_visible())]
        return not any(overlap(boxes["panel"], box) for box in taken)

    wait_for(is_clear)


@pytest.mark.exhaustive
def test_each_layer_is_listed_once_with_its_colour_beside_its_switch(visit_scene):
    page = visit_scene(is_strict=False)
    page.locator("#panel").click()
    inner = page.frame_locator("[data-testid=viewer]")
    inner.get_by_role("tab", name="View").click()
    for layer in LAYERS.values():
        listed = inner.get_by_text(layer.label, exact=True).filter(visible=True)
        expect(listed).to_have_count(1)
        colour = listed.evaluate("(label) => getComputedStyle(label, '::after').backgroundColor")
        assert colour == (f"rgb{layer.colour}" if layer.colour else "rgba(0, 0, 0, 0)"), layer.label
