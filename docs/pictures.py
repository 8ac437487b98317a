"""Make the README's pictures: python docs/pictures.py [docs].

Serves the page with contact physics, opens it in headless Chromium, and takes the walk tick by tick while time stands
still: so a slow machine makes the same pictures. Talos walks, a push is caught by steps, a harder one is not: the film.
Then the page as it looks after the first push, on a desktop with the panel and on a phone. Needs the packages of the
tests, and a Chromium.
"""

import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
from PIL import Image
from playwright.sync_api import Browser, Page, ViewportSize, sync_playwright

PERIOD = 0.1  # [s] between pictures of the film
CONTROL_PERIOD = 0.005  # [s]
FILM: ViewportSize = {"width": 1160, "height": 800}  # pixels of the window
WIDTH = 780  # pixels of the film
DESKTOP: ViewportSize = {"width": 1280, "height": 800}
PHONE: ViewportSize = {"width": 390, "height": 844}
CHROMIUM = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SETTLE = 400  # [ms] in which the picture follows a step
ARRIVE = 15_000  # [ms] in which the meshes are loaded and the light has faded in
PATIENCE = 300_000  # [ms] of a machine that renders in software
END = 9.6  # [s]
REFERENCE = {"vx": 0.3}
PUSHES = {3.1: 24.0, 6.6: -58.0}  # N s to the left, by their times [s]: caught, and too hard
STILL = 3.5  # [s]


def walk_until(api: httpx.Client, end: float) -> Iterator[float]:
    """Walk from rest, with a pause at each picture of the film; the time of each [s]."""
    api.post("live/pause").raise_for_status()
    api.post("live/reset").raise_for_status()
    pushes = dict(PUSHES)
    for k in range(round(end / PERIOD)):
        api.put("live/reference", json=REFERENCE).raise_for_status()
        for t in [t for t in pushes if t <= k * PERIOD]:
            api.post("live/push", json={"impulse": [0.0, pushes.pop(t)]}).raise_for_status()
        api.post("live/step", json={"ticks": round(PERIOD / CONTROL_PERIOD)}).raise_for_status()
        yield (k + 1) * PERIOD


def opened(browser: Browser, url: str, size: ViewportSize, *, has_panel: bool = False, is_phone: bool = False) -> Page:
    """The page in a new window, once the robot is there."""
    page = browser.new_page(viewport=size, has_touch=is_phone, is_mobile=is_phone)
    page.set_default_timeout(PATIENCE)
    page.goto(url)
    page.frame_locator("[data-testid=viewer]").locator("canvas").first.wait_for()
    if (page.locator("#panel").get_attribute("aria-pressed") == "true") != has_panel:
        page.locator("#panel").click()
    page.wait_for_timeout(ARRIVE)
    return page


def taken(page: Page) -> Image.Image:
    """The window as it looks now."""
    page.wait_for_timeout(SETTLE)
    return Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def film(browser: Browser, url: str, api: httpx.Client, out: Path) -> None:
    """Write the moving picture."""
    page, size = opened(browser, url, FILM), (WIDTH, round(FILM["height"] * WIDTH / FILM["width"]))
    first, *others = (taken(page).resize(size, Image.Resampling.LANCZOS) for _ in walk_until(api, END))
    page.close()
    duration = round(1000 * PERIOD)
    first.save(out, save_all=True, append_images=others, duration=duration, loop=0, quality=55, method=4)
    print(f"{out}: {len(others) + 1} pictures, {out.stat().st_size / 1e6:.1f} MB")


def stills(browser: Browser, url: str, api: httpx.Client, folder: Path) -> None:
    """Write the picture of the page on a desktop and the one on a phone."""
    desktop = opened(browser, url, DESKTOP, has_panel=True)
    phone = opened(browser, url, PHONE, is_phone=True)
    for _ in walk_until(api, STILL):
        pass
    for page, name in ((desktop, "page.png"), (phone, "phone.png")):
        page.wait_for_timeout(ARRIVE)  # of two windows that are drawn in software
        taken(page).save(folder / name, optimize=True)
        print(f"{folder / name}: {(folder / name).stat().st_size / 1e3:.0f} kB")
        page.close()


@contextmanager
def served() -> Iterator[str]:
    """Serve the page; its address."""
    walk = Path(sys.executable).parent / "walk"
    with tempfile.TemporaryDirectory() as data:
        command = [walk, "serve", "--port", "0", "--plant", "mujoco"]
        environment = os.environ | {"WALK_DATA": data}
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as server:
            try:
                assert server.stdout is not None
                yield next(found[0] for line in server.stdout if (found := re.search(r"http://\S+", line)))
            finally:
                server.terminate()


def main(folder: Path) -> None:
    """Serve, film, write."""
    path = next(found for name in ("chromium", "google-chrome") if (found := shutil.which(name)))
    with (
        served() as url,
        sync_playwright() as playwright,
        httpx.Client(base_url=f"{url}api/v1/", timeout=60.0) as api,
    ):
        browser = playwright.chromium.launch(executable_path=path, args=CHROMIUM)
        stills(browser, url, api, folder)
        film(browser, url, api, folder / "walk.webp")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs"))
