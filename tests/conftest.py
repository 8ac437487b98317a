"""Helpers of many tests: a real server, started as a user starts it, a browser, and time."""

import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

import httpx
import pytest
import viser
from hypothesis import HealthCheck, settings
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from app.commands.cli import main
from app.runs import Run, RunLimits, Runs
from app.viewer import LIGHT
from app.viewer.scene.scene import Scene
from walkcore import Push, load_robot
from walkcore.analysis.survival import NominalWalk
from walkcore.mpc.plan import Status
from walkcore.scenario.recording import Recording

WALK = Path(sys.executable).parent / "walk"
START = 180.0  # [s] a slow or busy machine may take
PATIENCE = 120.0  # [s] on a busy machine, after which something hangs
EXHAUSTIVE = 7200.0  # [s] for a case that takes minutes where nothing else runs
SCENE = "<!doctype html><html><head></head><body id=root>the scene</body></html>"
UP = re.compile("walking|standing")
DESKTOP = {"viewport": {"width": 1280, "height": 800}}
SMALL_DESKTOP = {"viewport": {"width": 640, "height": 480}}
PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
SMALL_PHONE = PHONE | {"viewport": {"width": 360, "height": 640}}
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


expect.set_options(timeout=1e3 * PATIENCE)
settings.register_profile("no test fails on a time", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("no test fails on a time")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give exhaustive cases time."""
    for item in items:
        if item.get_closest_marker("exhaustive") is not None:
            item.add_marker(pytest.mark.timeout(EXHAUSTIVE))


@dataclass
class Server:
    """`walk serve` in a process of its own."""

    process: subprocess.Popen
    output: list[str] = field(default_factory=list)
    url: str = ""

    @property
    def host(self) -> str:
        return self.url.removeprefix("http://").removesuffix("/")

    def client(self, headers: Mapping[str, str] | None = None) -> httpx.Client:
        return httpx.Client(base_url=f"{self.url}api/v1/", headers=headers, timeout=30.0)

    def socket_url(self, path: str) -> str:
        return f"ws://{self.host}/api/v1/live/{path}"


def start_server(*options: str, **environment: str) -> Server:
    """Start a server on a free port, and read its output from then on."""
    process = subprocess.Popen(
        [WALK, "serve", "--port", "0", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"WALK_PLANT": "ideal"} | environment,  # whatever this machine keeps up with
    )
    server = Server(process)
    is_open = threading.Event()

    def read() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            server.output.append(line)
            if "http://" in line and line.startswith("walk:"):
                server.url = line.split()[-1]
                is_open.set()
        is_open.set()

    threading.Thread(target=read, daemon=True).start()
    if not is_open.wait(START) or not server.url:
        process.kill()
        raise AssertionError(f"no address: {server.output}")
    assert httpx.get(f"{server.url}api/v1/health", timeout=START).status_code == 200
    return server


@contextmanager
def serving(*options: str, **environment: str) -> Iterator[Server]:
    """A server on a free port, which is stopped at the end and must have had no trouble until then."""
    server = start_server(*options, **environment)
    try:
        yield server
    finally:
        server.process.terminate()
        code = server.process.wait(PATIENCE)
    output = "".join(server.output)
    assert code == -signal.SIGTERM, f"the server had ended before: {output}"
    assert not {"Traceback", "Warning"} & set(re.findall(r"\w+", output)), output


@dataclass
class Said:
    """Exit code and output of a command."""

    returncode: int
    stdout: str
    stderr: str


def walk(*arguments: object) -> Said:
    """The command, as the script `walk` calls it."""
    out, err = io.StringIO(), io.StringIO()
    with patch.object(sys, "argv", ["walk", *map(str, arguments)]), redirect_stdout(out), redirect_stderr(err):
        with pytest.raises(SystemExit) as ended:
            main()
    return Said(int(ended.value.code or 0), out.getvalue(), err.getvalue())


def bearer(token: str) -> dict[str, str]:
    """Header by which a program shows a token; none without one."""
    return {"Authorization": f"Bearer {token}"} if token else {}


@contextmanager
def runs_in(folder: Path, **changes: Any) -> Iterator[Runs]:
    """Runs of a folder without a server; nothing is simulated before they are started."""
    sizes = {"nb_workers": 1, "nb_queued": 9, "nb_kept": 99, "bytes_kept": 10**9, "limits": RunLimits()}
    runs = Runs(folder, **(sizes | changes))
    try:
        yield runs
    finally:
        runs.stop()


def ended_run(runs: Runs, run_id: str) -> Run:
    """A run, once nothing more will change."""
    wait_for(lambda: runs.get(run_id).has_ended)
    return runs.get(run_id)


def ended(api: httpx.Client, path: str) -> dict[str, Any]:
    """A run or a sweep over REST, once nothing more will change."""
    wait_for(lambda: api.get(path).json()["status"] not in ("queued", "running"))
    return api.get(path).json()


def send_text(api: httpx.Client, method: str, path: str, text: str) -> httpx.Response:
    """Send a body as it is, also where it is not JSON."""
    return api.request(method, path, content=text, headers={"Content-Type": "application/json"})


def add_finished(runs: Runs, recording: Recording) -> Run:
    """A run that is done, without a process that simulates it."""
    scenario = recording.scenario
    run = runs.store.add(scenario.source, scenario.robot.name, scenario.duration, status="running")
    recording.write(runs.store.unfinished(run.id))
    runs.store.finish(run.id, None)
    return runs.get(run.id)


def wait_for(condition: Callable[[], bool], patience: float = PATIENCE) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


class Clock:
    """Time on the wall that passes only where a test lets it [s]."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture(scope="session", autouse=True)
def data_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Folder for the runs of the tests' servers, instead of the user's."""
    folder = tmp_path_factory.mktemp("data")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("WALK_DATA", str(folder))
        yield folder


@pytest.fixture
def viser_server() -> Iterator[viser.ViserServer]:
    """A viser server of its own, for scenes without a served robot."""
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield server
    server.stop()


@pytest.fixture
def scene(viser_server: viser.ViserServer) -> Scene:
    """Scene of a point mass."""
    return Scene(viser_server, load_robot("hrp2"), LIGHT)


@pytest.fixture(scope="module")
def server(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One server with runs of its own for the tests of a file, with the robot and settings of its mark `server`."""
    mark = request.node.get_closest_marker("server") or pytest.mark.server().mark
    settings = {"WALK_DATA": str(tmp_path_factory.mktemp("server") / "data"), **mark.kwargs}
    with serving("--robot", *(mark.args or ("talos",)), "--scene", "light", **settings) as server:
        yield server


def live(api: httpx.Client) -> dict[str, Any]:
    """The live snapshot, whose numbers are all JSON."""
    return json.loads(api.get("live").text, parse_constant=refuse_constant)


def refuse_constant(name: str) -> None:
    """Refuse NaN and infinities, which Python would read."""
    raise AssertionError(f"{name} is not JSON")


@pytest.fixture
def api(server: Server) -> Iterator[httpx.Client]:
    """A client of a robot that stands at its start and runs."""
    with server.client() as client:
        client.post("live/reset").raise_for_status()
        client.post("live/resume").raise_for_status()
        yield client


def paused_walk(api: httpx.Client, push: float, nb_ticks: int) -> None:
    """Walk from the start with a push to the left at tick 151 [N s], and pause."""
    api.post("live/pause")
    api.post("live/reset")
    api.put("live/reference", json={"vx": 0.2})
    api.post("live/step", json={"ticks": 150})
    api.post("live/push", json={"impulse": [0.0, push]})
    api.post("live/step", json={"ticks": nb_ticks - 150})


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """One browser for the tests of a file."""
    path = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    assert path is not None, "no browser; `make browser` installs one"
    with sync_playwright() as playwright:
        # Without a sandbox, so that it starts as root, too; it sees our own page only.
        arguments = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = playwright.chromium.launch(executable_path=path, args=arguments)
        yield browser
        browser.close()


@pytest.fixture
def visit(browser: Browser) -> Iterator[Callable[..., Page]]:
    """Opens pages, each in a browser of its own, and holds them to raise no errors until the test is over.

    In place of the scene, which costs most, they have `SCENE` or another stand-in; None draws it. Strict ones may not
    write errors to the console, either, nor be refused anything. `before` is a script that goes before theirs.
    """
    contexts: list[BrowserContext] = []
    complaints: list[str] = []

    def open_page(
        url: str, scene: str | None = SCENE, before: str = "", is_strict: bool = False, **device: Any
    ) -> Page:
        context = browser.new_context(**device)
        contexts.append(context)
        context.set_default_timeout(1e3 * PATIENCE)
        context.on("weberror", lambda error: complaints.append(str(error.error)))
        if is_strict:
            context.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
            context.on("response", lambda given: complaints.append(given.url) if given.status >= 400 else None)
        if scene is not None:
            context.route("**/viewer/**", lambda route: route.fulfill(body=scene, content_type="text/html"))
        context.add_init_script(before)
        page = context.new_page()
        page.goto(url)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert complaints == []


@pytest.fixture
def visit_scene(visit: Callable[..., Page], server: Server, api: httpx.Client) -> Callable[..., Page]:
    """Opens the page of the server with its scene, in a small window by default, once that is drawn."""

    def open_page(is_strict: bool = True, **device: Any) -> Page:
        page = visit(server.url, scene=None, is_strict=is_strict, **(device or SMALL_DESKTOP))
        expect(page.get_by_test_id("status")).to_contain_text(UP)
        expect(page.frame_locator("[data-testid=viewer]").locator("canvas").first).to_be_visible()
        return page

    return open_page


def survives_to_the_end(walk: NominalWalk, phase: float, push: Push) -> bool:
    """The same decision as of `walk.survives`, after all of the time for which the robot has to stay on its feet."""
    has_survived = False
    for now, monitor in walk.after(phase, push):
        if now.status is Status.FALLEN:
            return False
        has_survived = monitor.last is not None and monitor.last.survived is True
    return has_survived
