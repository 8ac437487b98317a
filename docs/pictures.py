"""Make the README's moving picture: python docs/moving_picture.py [docs/walk.webp].

Serves the page with contact physics, opens it in headless Chromium, and takes the walk tick by tick while time stands
still: so a slow machine makes the same film. Talos walks, a push is caught by steps, a harder one is not. Needs the
packages of the tests, and a Chromium.
"""

import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import httpx
from PIL import Image
from playwright.sync_api import Page, ViewportSize, sync_playwright

PERIOD = 0.1  # [s] between pictures
CONTROL_PERIOD = 0.005  # [s]
SIZE: ViewportSize = {"width": 1160, "height": 800}  # pixels of the window
WIDTH = 780  # pixels of the film
CHROMIUM = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SETTLE = 400  # [ms] in which the picture follows a step
PATIENCE = 300_000  # [ms] of a machine that renders in software
END = 9.6  # [s]
REFERENCE = {"vx": 0.3}
PUSHES = {3.1: 24.0, 6.6: -58.0}  # N s to the left, by their times [s]: caught, and too hard


def pictures(page: Page, api: httpx.Client) -> Iterator[Image.Image]:
    """The window, picture by picture."""
    pushes = dict(PUSHES)
    for k in range(round(END / PERIOD)):
        api.put("live/reference", json=REFERENCE).raise_for_status()
        for t in [t for t in pushes if t <= k * PERIOD]:
            api.post("live/push", json={"impulse": [0.0, pushes.pop(t)]}).raise_for_status()
        api.post("live/step", json={"ticks": round(PERIOD / CONTROL_PERIOD)}).raise_for_status()
        page.wait_for_timeout(SETTLE)
        yield Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def film(url: str) -> list[Image.Image]:
    """All pictures of the film, in its size."""
    path = next(found for name in ("chromium", "google-chrome") if (found := shutil.which(name)))
    with sync_playwright() as playwright, httpx.Client(base_url=f"{url}api/v1/", timeout=60.0) as api:
        page = playwright.chromium.launch(executable_path=path, args=CHROMIUM).new_page(viewport=SIZE)
        page.set_default_timeout(PATIENCE)
        page.goto(url)
        page.frame_locator("[data-testid=viewer]").locator("canvas").first.wait_for()
        if page.locator("#panel").get_attribute("aria-pressed") == "true":
            page.locator("#panel").click()  # more room for the robot
        page.wait_for_timeout(15_000)  # the meshes are loaded, and the light has faded in
        api.post("live/pause").raise_for_status()
        api.post("live/reset").raise_for_status()
        height = round(SIZE["height"] * WIDTH / SIZE["width"])
        return [picture.resize((WIDTH, height), Image.Resampling.LANCZOS) for picture in pictures(page, api)]


def main(out: Path) -> None:
    """Serve, film, write."""
    walk = Path(sys.executable).parent / "walk"
    with tempfile.TemporaryDirectory() as data:
        command = [walk, "serve", "--port", "0", "--plant", "mujoco"]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, text=True, env=os.environ | {"WALK_DATA": data}
        ) as server:
            try:
                assert server.stdout is not None
                url = next(found[0] for line in server.stdout if (found := re.search(r"http://\S+", line)))
                first, *others = film(url)
            finally:
                server.terminate()
    duration = round(1000 * PERIOD)
    first.save(out, save_all=True, append_images=others, duration=duration, loop=0, quality=55, method=4)
    print(f"{out}: {len(others) + 1} pictures, {out.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/walk.webp"))
