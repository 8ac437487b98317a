"""Cost of a first visit of the page to a browser: bytes, time until it can be driven, frames a second, light and full.

Needs a running server; its own `--scene` decides the meshes. Each visit is by a browser context of its own, so
nothing is cached. Whoever says how fast it was says how busy the machine was, too: it is printed.

    walk serve --port 8000 & python benchmarks/page.py http://localhost:8000/ --visits 3
"""

import argparse
import os
import shutil
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

from playwright.sync_api import Browser, Page, sync_playwright

VIEWPORT = {"width": 1280, "height": 800}
SETTLED = 5.0  # [s] after the first frame, until the meshes are there and frames are counted
PATIENCE = 120.0  # [s]
SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]

IS_DRIVEN = "/walking|standing/.test(document.getElementById('state').textContent)"
HAS_SCENE = "document.querySelector('iframe')?.contentDocument?.querySelector('canvas[data-engine]') !== null"
COUNT_FRAMES = """(milliseconds) => new Promise((done) => {
    const scene = document.querySelector("iframe").contentWindow;
    const start = performance.now();
    let frames = 0;
    const count = () => {
        frames += 1;
        const passed = performance.now() - start;
        if (passed < milliseconds) scene.requestAnimationFrame(count);
        else done((1000 * frames) / passed);
    };
    scene.requestAnimationFrame(count);
})"""


def main() -> None:
    """Visit, and print a line for each render quality."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("url")
    parser.add_argument("--visits", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=5.0, help="over which frames are counted")
    parser.add_argument("--gpu", action="store_true", help="render with the graphics card")
    options = parser.parse_args()
    browser_path = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as playwright:
        arguments = ["--no-sandbox", *([] if options.gpu else SOFTWARE)]
        browser = playwright.chromium.launch(executable_path=browser_path, args=arguments)
        for quality in ("light", "full"):
            visits = [visit(browser, options.url, quality, options.seconds) for _ in range(options.visits)]
            bytes_, ready, scene, frames = map(statistics.median, zip(*visits, strict=True))
            print(
                f"{quality}: can be driven after {ready:.2f} s, scene after {scene:.2f} s, "
                f"{bytes_ / 1e6:.2f} MB until {SETTLED:g} s after that, {frames:.1f} frames/s "
                f"(medians of {options.visits}; load average {os.getloadavg()[0]:.1f})"
            )
        browser.close()


def visit(browser: Browser, url: str, quality: str, seconds: float) -> tuple[float, float, float, float]:
    """Bytes over the wire until the scene has settled, seconds until it can be driven and seen, frames a second."""
    context = browser.new_context(viewport=VIEWPORT)  # type: ignore[arg-type]  # a TypedDict of the same keys
    page = context.new_page()
    page.add_init_script(f"localStorage.setItem('walk.look', '{quality}')")
    counted = count_bytes(page)
    start = time.monotonic()
    page.goto(url, wait_until="commit")
    ready, scene = (until(page, condition) - start for condition in (IS_DRIVEN, HAS_SCENE))
    page.wait_for_timeout(1e3 * SETTLED)  # events come while it waits
    nb_bytes = counted()
    frames = page.evaluate(COUNT_FRAMES, 1000 * seconds)
    context.close()
    return nb_bytes, ready, scene, frames


def until(page: Page, condition: str) -> float:
    """Time at which a condition first held [s]."""
    page.wait_for_function(condition, polling=20, timeout=1e3 * PATIENCE)
    return time.monotonic()


def count_bytes(page: Page) -> Callable[[], float]:
    """Count what comes over the wire: responses as they were packed, and messages of websockets."""
    session = page.context.new_cdp_session(page)
    total = 0.0

    def add(nb_bytes: float) -> None:
        nonlocal total
        total += nb_bytes

    def received(event: dict[str, Any]) -> None:
        data = event["response"]["payloadData"]
        add(len(data) * 3 / 4 if event["response"]["opcode"] == 2 else len(data))  # binary comes in base64

    session.on("Network.loadingFinished", lambda event: add(event["encodedDataLength"]))
    session.on("Network.webSocketFrameReceived", received)
    session.send("Network.enable")
    return lambda: total


if __name__ == "__main__":
    sys.exit(main())
