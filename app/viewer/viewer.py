"""Viewer of the live robot: shows the runner's latest snapshot at a steady rate while a browser is connected.

viser listens on a Unix socket that only this user can open, and `app.http.scene_proxy` serves it to the outside.
"""

import asyncio
import contextlib
import io
import logging
import tempfile
import time
import weakref
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from pathlib import Path

import viser

from app.live.driver_lease import DriverLease
from app.live.runner import Runner
from app.viewer.layer_choices import LayerChoices
from app.viewer.panel.panel import Panel
from app.viewer.past_look import PastLook
from app.viewer.scene.drag_push import PULL_PERIOD, DragPush
from app.viewer.scene.frame import RenderQuality
from app.viewer.scene.layers import DEFAULT_LAYERS, PUSH_ROSE
from app.viewer.scene.link_points import LinkPoints
from app.viewer.scene.scene import Scene, add_key_light
from app.viewer.transport.broadcaster import Broadcaster
from app.viewer.transport.client_messages import ClientMessages
from app.viewer.transport.client_registry import ClientRegistry
from app.viewer.transport.scene_updates import SceneUpdates
from app.viewer.transport.viser_private import listening_on, refuse_tunnels
from walkcore.errors import InvalidValueError

logger = logging.getLogger(__name__)

PERIOD = 1.0 / 30.0  # [s] of drawing
PANEL_WIDTH = 308  # pixels: its tabs in one row
ACCENT = (34, 111, 220)
MAX_LOOKS = 8  # browsers that look at the past at once: each costs as much drawing as the live scene
SMOOTHING = 0.02  # weight of the latest frame in the mean cost


class TooManyLooksError(Exception):
    """So many browsers look at the past already that no other one may."""


class Viewer:
    """Owner of viser's server and of the task that draws."""

    def __init__(self, runner: Runner, quality: RenderQuality | None = None, lease: DriverLease | None = None) -> None:
        """Build the scene; nothing is drawn before `start`.

        Args:
            runner: its snapshots are shown, and it gets the requests of the panel.
            quality: amount of detail to render.
            lease: of the controls, which the sliders of the panel heed.
        """
        self._runner = runner
        self.server, self.socket = start_server(runner.robot.title)
        """viser's server, and the Unix socket on which it listens."""
        refuse_tunnels(self.server)
        self.server.gui.configure_theme(
            show_logo=False, show_share_button=False, control_width="small", brand_color=ACCENT
        )
        self._quality = quality or RenderQuality()
        self.scene = Scene(self.server, runner.robot, self._quality)
        self.broadcaster = Broadcaster(self.server)
        self._clients = clients = ClientRegistry(self.server)
        self._looks: dict[str, PastLook] = {}
        spare_light_clients(self.server, clients)
        body, scene = runner.robot.body, self.scene
        points = None if body is None else LinkPoints(body, scene.links, lambda: (scene.rotation, scene.origin))
        self._drag_push = DragPush(self.server, runner, scene.draggable, points)
        self._panel = Panel(self.server, runner, self.scene, clients, lease or DriverLease())
        self.server.gui.main_panel.set_width(PANEL_WIDTH)
        self.server.gui.main_panel.dock_right()  # beside the scene: it covers nothing
        self._loop = self.server.get_event_loop()
        self._drawing: Future[None] | None = None
        self._pulling: Future[None] | None = None
        self.cost = FrameCost()
        """Processor time of the frames that a browser was sent."""

    def client_messages(self, is_operator: bool = True, page: str = "") -> ClientMessages:
        """Check of the messages of one more browser.

        Args:
            is_operator: False for one who may only look.
            page: id of the page that its scene belongs to; its own switches of layers are for that page.
        """
        names = frozenset(mesh.name for mesh in self.scene.draggable)
        view = self._panel.view

        def switch(box: str, is_shown: bool) -> None:
            self._loop.call_soon_threadsafe(view.layers.switch, page, {view.boxes[box]: is_shown})

        return ClientMessages(self.server, names, is_operator, dict.fromkeys(view.boxes, switch))

    @contextlib.contextmanager
    def past_look(self, page: str) -> Iterator[PastLook]:
        """Ticks of the past for the scene of one page, which shows them instead of the present while this is held.

        Args:
            page: id, as its controls send it.

        Raises:
            TooManyLooksError: if so many pages look at the past already.
        """
        if len(self._looks) >= MAX_LOOKS and page not in self._looks:
            raise TooManyLooksError(f"{MAX_LOOKS} browsers look at the past already")
        look = self._looks[page] = PastLook(self._runner.robot, self._quality)
        try:
            yield look
        finally:
            if self._looks.get(page) is look:
                del self._looks[page]

    @property
    def layers(self) -> LayerChoices:
        """Layers that each page is shown."""
        return self._panel.view.layers

    def switch(self, layers: Mapping[str, bool], page: str | None = None) -> Future[dict[str, bool]]:
        """Show or hide layers; the result is the state of all of them.

        Args:
            layers: whether each is shown, by name.
            page: id of the page that is shown them; None for all pages, those to come too.

        Raises:
            InvalidValueError: if there is no such layer.
        """
        for name, is_shown in layers.items():
            if name not in DEFAULT_LAYERS:
                raise InvalidValueError(f"layers.{name}", is_shown, f"must be one of {', '.join(DEFAULT_LAYERS)}")

        async def switch() -> dict[str, bool]:
            if page is None:
                self.layers.switch_all(layers)
                return dict(self.layers.of_new_pages)
            self.layers.switch(page, layers)
            return self.layers.of(page)

        return asyncio.run_coroutine_threadsafe(switch(), self._loop)

    def take_over(self, former: "Viewer") -> Future[None]:
        """Show each page the layers that another viewer showed it."""

        async def take_over() -> None:
            self.layers.take_over(former.layers)

        return asyncio.run_coroutine_threadsafe(take_over(), self._loop)

    def start(self) -> None:
        """Start drawing, in viser's own event loop: what its callbacks change needs no lock."""
        self._drawing = asyncio.run_coroutine_threadsafe(self._run(), self._loop)
        self._pulling = asyncio.run_coroutine_threadsafe(self._pull(), self._loop)

    def stop(self) -> None:
        """Stop drawing and close viser."""
        for task in filter(None, (self._drawing, self._pulling)):
            task.cancel()
        with contextlib.redirect_stdout(io.StringIO()):  # it would print that it has stopped
            self.server.stop()

    async def _pull(self) -> None:
        """Let the spring of a drag that is held act, at a steady rate."""
        due = time.monotonic()
        while True:
            due = max(due + PULL_PERIOD, time.monotonic())
            await asyncio.sleep(due - time.monotonic())
            try:
                self._drag_push.pull()
            except Exception:
                self._drag_push.cancel()
                logger.exception("a drag cannot pull the robot")

    async def _run(self) -> None:
        last, has_failed = time.monotonic(), False
        self.cost.skip()
        due = last
        while True:
            due = max(due + PERIOD, time.monotonic())
            await asyncio.sleep(due - time.monotonic())
            now = time.monotonic()
            elapsed, last = now - last, now
            if not self.broadcaster.nb_clients:
                self.cost.skip()
                continue
            try:
                self._show(elapsed)
                has_failed = False
            except Exception:
                if not has_failed:  # once, not thirty times a second
                    logger.exception("the scene cannot be drawn")
                has_failed = True
            self.cost.add()

    def _show(self, elapsed: float) -> None:
        self.scene.shown = self.layers.drawn({self._clients.page(client) for client in self.broadcaster.clients})
        if PUSH_ROSE in self.scene.shown:
            self._runner.push_roses.request()
        state = self._runner.look()
        self._drag_push.request_preview()
        aim, parameters = self._drag_push.aim, self._runner.parameters
        self.scene.draw(state.snapshot, parameters, elapsed, aim, state.world, state.was, state.push_rose)
        self._panel.update(state, self.cost.mean_ms, self.broadcaster.nb_clients)
        others = self._show_past(elapsed)
        self.broadcaster.send(self.scene.updates, others, self._own_updates)

    def _own_updates(self, client_id: int) -> SceneUpdates:
        return self.layers.updates(self._clients.page(client_id))

    def _show_past(self, elapsed: float) -> dict[int, SceneUpdates]:
        """Draw for the pages that look at the past; the changes for their scenes, by the ids of these."""
        others: dict[int, SceneUpdates] = {}
        for page, look in list(self._looks.items()):
            scenes = self._clients.scenes(page)
            if not scenes:
                continue
            updates = look.draw(elapsed, self.layers.drawn([page]), self._panel.plots)
            if updates is not None:
                others |= dict.fromkeys(scenes, updates)
        return others


def start_server(label: str | None = None) -> tuple[viser.ViserServer, Path]:
    """Start a viser on a Unix socket in a folder that only this user can enter."""
    folder = tempfile.TemporaryDirectory(prefix="walk-viser-")
    path = Path(folder.name) / "socket"
    with listening_on(path), contextlib.redirect_stdout(io.StringIO()):  # it would print an address that nobody opens
        server = viser.ViserServer(host="127.0.0.1", port=0, label=label, verbose=False)
    weakref.finalize(server, folder.cleanup)
    return server, path


def spare_light_clients(server: viser.ViserServer, clients: ClientRegistry) -> None:
    """Give each client that renders in software a sun without shadows instead of the one of all."""

    @server.on_client_connect
    async def _(client: viser.ClientHandle) -> None:  # async: in viser's loop, whose buffers belong to one thread
        if clients.is_light(client):
            add_key_light(client.scene, has_shadows=False)


class FrameCost:
    """Processor time of drawn frames: all that viser's thread does from one to the next.

    Belongs to that thread; any other may read.
    """

    def __init__(self) -> None:
        """Start with no frames."""
        self.count = 0
        self.seconds = 0.0
        """Sum over all frames."""
        self.mean_ms = 0.0
        """Mean over the last second or two [ms]."""
        self._since = 0.0

    def skip(self) -> None:
        """Count what was done since the last call, if ever there was one, for no frame."""
        self._since = time.thread_time()

    def add(self) -> None:
        """Count a frame that was drawn and sent."""
        now = time.thread_time()
        spent, self._since = now - self._since, now
        self.count += 1
        self.seconds += spent
        self.mean_ms += max(SMOOTHING, 1.0 / self.count) * (1e3 * spent - self.mean_ms)
