"""A booth for a time: a screen in a browser, and two phones that come, wait, drive, push and leave. Does anything grow?

Starts a server and Chromium. In each five minutes the phones come and go for three, each in a browser of its own; then
nobody drives, the robot walks by itself, and a push that is too hard lets it fall. Printed is a Markdown table: memory
of server and control process, and of the page of the screen, after its garbage is collected, the JavaScript heap,
nodes of the document and listeners.

    WALK_PLANT=ideal nice python benchmarks/soak_booth.py --minutes 30
"""

import asyncio
import itertools
import os
import platform
import random
import time
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import psutil
import tyro
from playwright.async_api import Browser, CDPSession, Page, async_playwright
from soak_server import FALLEN, PATIENCE, Sample, nb_warnings, sample, served

CHROMIUM = ["--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SCREEN, PHONE = {"width": 640, "height": 360}, {"width": 390, "height": 844}  # small: software renders the screen
CYCLE, BUSY = 300.0, 180.0  # [s] of visits and rest, and of the visits alone
SETTLED = 20.0  # [s] after which a page has loaded all


@dataclass(frozen=True)
class SoakBooth:
    """The options of the command line."""

    minutes: float = 30.0
    robot: str = "talos"
    phones: int = 2
    browser: Path = Path("/usr/bin/chromium")


@dataclass
class Seen:
    """Counts of visits, pushes and falls since the start, and errors."""

    visits: int = 0
    turns: int = 0
    """Visits in which the phone came to drive."""
    pushes: int = 0
    falls: int = 0
    stood: int = 0
    """Times that it stood ten seconds after it was pushed so."""
    errors: list[str] = field(default_factory=list)
    """Errors of pages, and visits that went wrong."""


def main(soak: SoakBooth) -> None:
    """Serve, open the booth, let phones come, and print the table."""
    with served(soak.robot) as (url, process):
        asyncio.run(_soak(soak, url, process))


async def _soak(soak: SoakBooth, url: str, process: psutil.Process) -> None:
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, {soak.robot}\n")
    print(
        "| min | server [MB] | control [MB] | descriptors | threads | browser [MB] | heap of the page [MB] | nodes",
        end="",
    )
    print(" | listeners | visits | turns | pushes | falls | stood up | health |\n|" + "---|" * 15, flush=True)
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=soak.browser, args=CHROMIUM)
        page = await (await browser.new_context(viewport=SCREEN)).new_page()
        seen, began = Seen(), time.monotonic()
        page.on("pageerror", lambda error: seen.errors.append(str(error)))
        await page.goto(f"{url}?booth")
        await page.wait_for_selector("#booth-code[src]", timeout=1e3 * PATIENCE)
        session = await page.context.new_cdp_session(page)
        await asyncio.sleep(SETTLED)
        print(await _row(0.0, url, process, session, seen), flush=True)
        phones = [asyncio.create_task(_come_and_go(browser, url, began, seen)) for _ in range(soak.phones)]
        for cycle in itertools.count():
            await _sleep_until(began + cycle * CYCLE + BUSY)
            await _fall(url, seen)
            await _sleep_until(began + (cycle + 1) * CYCLE)
            print(await _row((cycle + 1) * CYCLE / 60.0, url, process, session, seen), flush=True)
            if (cycle + 1) * CYCLE >= 60.0 * soak.minutes:
                break
        for phone in phones:
            phone.cancel()
        await asyncio.gather(*phones, return_exceptions=True)
        print(f"\nwarnings of the server: {nb_warnings(process)}; errors of the pages: {seen.errors or 'none'}")
        await browser.close()


async def _sleep_until(moment: float) -> None:
    await asyncio.sleep(max(0.0, moment - time.monotonic()))


async def _row(minute: float, url: str, process: psutil.Process, session: CDPSession, seen: Seen) -> str:
    measured: Sample = await asyncio.to_thread(sample, url, process)
    await session.send("HeapProfiler.enable")
    await session.send("HeapProfiler.collectGarbage")
    await session.send("Performance.enable")
    metrics = {metric["name"]: metric["value"] for metric in (await session.send("Performance.getMetrics"))["metrics"]}
    browser_mb = sum(child.memory_info().rss for child in _chromium()) / 1e6
    cells = [
        *(f"{minute:g}", f"{measured.memory_mb:.0f}", f"{measured.control_memory_mb:.0f}"),
        *(measured.descriptors, measured.threads, f"{browser_mb:.0f}", f"{metrics['JSHeapUsedSize'] / 1e6:.1f}"),
        *(f"{metrics['Nodes']:.0f}", f"{metrics['JSEventListeners']:.0f}"),
        *(seen.visits, seen.turns, seen.pushes, seen.falls, seen.stood, measured.status),
    ]
    return f"| {' | '.join(map(str, cells))} |"


def _chromium() -> list[psutil.Process]:
    return [child for child in psutil.Process().children(recursive=True) if "chrom" in child.name()]


async def _come_and_go(browser: Browser, url: str, began: float, seen: Seen) -> None:
    """One visitor after the other, while it is busy."""
    while True:
        since = (time.monotonic() - began) % CYCLE
        if since > BUSY - 60.0:
            await asyncio.sleep(CYCLE - since)
        await asyncio.sleep(random.uniform(1.0, 10.0))
        seen.visits += 1
        try:
            await _visit(browser, url, seen)
        except Exception as error:  # the soak goes on, and its table says so
            seen.errors.append(f"{type(error).__name__}: {error}".splitlines()[0])


async def _visit(browser: Browser, url: str, seen: Seen) -> None:
    """Scan the code, wait, drive for a while, push now and then, and leave."""
    async with httpx.AsyncClient(base_url=url, timeout=PATIENCE) as api:
        link = (await api.get("api/v1/live/booth")).json()["phone"]
    context = await browser.new_context(viewport=PHONE, has_touch=True, is_mobile=True)
    try:
        page = await context.new_page()
        page.on("pageerror", lambda error: seen.errors.append(str(error)))
        await page.goto(f"{url}{link.removeprefix('/')}", timeout=1e3 * PATIENCE)
        await page.wait_for_selector("body[data-place=driving]", timeout=2e3 * PATIENCE)
        seen.turns += 1
        ends_at = time.monotonic() + random.uniform(10.0, 40.0)
        while time.monotonic() < ends_at and await page.get_attribute("body", "data-place") == "driving":
            await _hold(page, "#joystick" if random.random() < 0.7 else "#turn")
            if random.random() < 0.5 and await page.is_enabled("#push"):
                await page.click("#push", timeout=1e3 * PATIENCE)
                seen.pushes += 1
    finally:
        await context.close()


async def _hold(page: Page, control: str) -> None:
    """Hold a control to one side for some seconds."""
    box = await page.locator(control).bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    await page.mouse.move(x, y)
    await page.mouse.down()
    await page.mouse.move(x + random.uniform(-0.4, 0.4) * box["width"], y - random.uniform(-0.2, 0.4) * box["height"])
    await asyncio.sleep(random.uniform(1.0, 4.0))
    await page.mouse.up()


async def _fall(url: str, seen: Seen) -> None:
    """Wait until nobody drives, push too hard, and see whether the robot stands up by itself."""
    async with httpx.AsyncClient(base_url=f"{url}api/v1/", timeout=PATIENCE) as api:
        limit = (await api.get("live/robot")).json()["limits"]["push"]
        for _ in range(30):
            if (await api.post("live/push", json={"impulse": [0.0, limit]})).status_code < 300:
                break
            await asyncio.sleep(1.0)
        else:
            seen.errors.append("no push was taken for 30 s")
            return
        await asyncio.sleep(3.0)
        seen.falls += (await api.get("live")).json()["status"] == FALLEN
        await asyncio.sleep(10.0)
        seen.stood += (await api.get("live")).json()["status"] != FALLEN


if __name__ == "__main__":
    main(tyro.cli(SoakBooth))
