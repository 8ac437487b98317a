"""The page in a real browser, as a person uses it.

Browsers without a graphics card render the scene on the processors that the walk needs too:
a small window and the light scene leave enough of them. Waits count simulated time, not time on the wall.
"""

import io
import time
from collections.abc import Callable

import httpx
import numpy as np
import pytest
from conftest import PATIENCE, SMALL_DESKTOP, SMALL_PHONE, live, wait_for
from PIL import Image
from playwright.sync_api import Locator
from pointers import Finger, Mouse, centre

TICKS_PER_SECOND = 200
SAMPLE = 0.05  # [s] between looks at the robot


def watch(api: httpx.Client, seconds: float, until: Callable[[dict], bool] = lambda _: False) -> list[dict]:
    """Snapshots over some simulated time, or until a condition holds."""
    states = [live(api)]
    give_up = time.monotonic() + PATIENCE
    while states[-1]["tick"] < states[0]["tick"] + seconds * TICKS_PER_SECOND and not until(states[-1]):
        assert time.monotonic() < give_up, "simulated time stands still"
        time.sleep(SAMPLE)
        states.append(live(api))
    return states


def moved(states: list[dict]) -> np.ndarray:
    return np.array([states[-1][name] - states[0][name] for name in ("com_x", "com_y")])


def test_robot_is_visibly_there_and_moves(visit_scene, api):
    page = visit_scene()
    viewer = page.get_by_test_id("viewer")
    with_robot = until_drawn(viewer)
    assert len(np.unique(with_robot.reshape(-1, 3), axis=0)) > 500
    wait_for(lambda: page.frames[1].evaluate(DOTS_DRAWN_OVER) >= 4)
    api.put("live/reference", json={"vx": 0.2})
    watch(api, 1.5)
    assert np.mean(np.abs(picture(viewer) - with_robot) > 24) > 0.002


def picture(element: Locator) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(element.screenshot())).convert("RGB"), dtype=int)


DOTS_DRAWN_OVER = """() => Object.entries(window.__viserMutable.nodeRefFromName).filter(([name, node]) => {
  let isOver = false; // the feet, and neither lit nor toned down
  node?.traverse((part) => (isOver ||= part.material?.depthTest === false && part.material.toneMapped === false));
  return name.endsWith("/dot/face") && isOver;
}).length"""


def until_drawn(element: Locator) -> np.ndarray:
    """A picture in which there is more to see than ground and grid: the robot's dark and light parts."""
    give_up = time.monotonic() + PATIENCE
    while np.ptp(image := picture(element)) < 150 or len(np.unique(image.reshape(-1, 3), axis=0)) <= 500:
        assert time.monotonic() < give_up, "nothing was drawn"
        time.sleep(0.5)
    return image


POINTERS = {"mouse": (SMALL_DESKTOP, Mouse), "finger": (SMALL_PHONE, Finger)}
DRAGS = {
    "forward": ((0, -1), (1, 0)),
    "right": ((1, 0), (0, -1)),
    "backward": ((0, 1), (-1, 0)),
    "left": ((-1, 0), (0, 1)),
}
EACH_TIME = {("mouse", "right")}  # the other directions only in `make test-all`


@pytest.mark.parametrize(
    ("device", "pointer_kind", "drag", "direction"),
    [
        pytest.param(
            *POINTERS[pointer],
            *DRAGS[way],
            id=f"{pointer}-{way}",
            marks=[] if (pointer, way) in EACH_TIME else pytest.mark.exhaustive,
        )
        for pointer in POINTERS
        for way in DRAGS
    ],
)
def test_robot_walks_where_the_joystick_points_and_stops_when_let_go(
    visit_scene, api, device, pointer_kind, drag, direction
):
    page = visit_scene(**device)
    x, y = centre(page.get_by_test_id("joystick"))
    start = live(api)

    def progress(state: dict) -> float:
        return float(moved([start, state]) @ direction)

    pointer = pointer_kind(page)
    pointer.drag((x, y), (x + 60 * drag[0], y + 60 * drag[1]))
    states = watch(api, 8.0, until=lambda state: progress(state) > 0.3)
    pointer.lift()
    along, across = progress(states[-1]), moved([start, states[-1]]) @ (-direction[1], direction[0])
    assert along > 0.2 and abs(across) < 0.6 * along
    assert any(state["driver"] == "joystick" for state in states)

    released = watch(api, 2.0, until=lambda state: state["driver"] == "none")[-1]
    assert (released["reference_vx"], released["reference_vy"]) == (0.0, 0.0)
    watch(api, 2.4)
    assert np.linalg.norm(moved(watch(api, 1.6))) < 0.06  # two steps on the spot
    assert live(api)["status"] == 0


CAMERA = """() => {
  const {camera, nodeRefFromName} = window.__viserMutable;
  const [back, world] = [camera.matrixWorld.elements.slice(8, 11), nodeRefFromName["/w"].matrixWorld.elements];
  const along = (axis) => -back.reduce((sum, part, i) => sum + part * world[axis + i], 0);
  return Math.atan2(along(4), along(0));
}"""


@pytest.mark.exhaustive
def test_camera_turns_with_the_robot_unless_the_view_is_free(visit_scene, api):
    page = visit_scene()
    until_drawn(page.get_by_test_id("viewer"))

    def heading() -> float:
        state = live(api)
        return (state["left_yaw"] + state["right_yaw"]) / 2

    def difference() -> float:
        """From the robot's heading to where the camera looks [rad]."""
        return page.frames[1].evaluate(CAMERA) - heading()

    start = difference()
    assert abs(start) < 0.6  # from behind
    api.put("live/reference", json={"yaw_rate": 0.3})
    watch(api, 6.0, until=lambda state: state["left_yaw"] > 0.9)
    api.put("live/reference", json={})
    wait_for(lambda: abs(difference() - start) < 0.15)
    page.keyboard.press("5")
    was = page.frames[1].evaluate(CAMERA)
    api.put("live/reference", json={"yaw_rate": -0.3})
    watch(api, 4.0, until=lambda state: state["left_yaw"] < 0.4)
    assert page.frames[1].evaluate(CAMERA) == pytest.approx(was, abs=1e-3)
