"""Shows the runner's latest snapshot in a viser scene, at a steady rate, while somebody looks.

viser listens on a loopback port of its own, which `app.http.page` serves to the outside.
"""

import asyncio
import contextlib
import io
import logging
import time
from collections.abc import Mapping
from concurrent.futures import Future

import viser
from viser import _messages

from app.live.runner import Runner
from app.viewer.panel.panel import Panel
from app.viewer.panel.view_tab import DEFAULTS
from app.viewer.scene.grab import Grab
from app.viewer.scene.scene import Look, Scene
from app.viewer.transport.audience import Audience
from app.viewer.transport.frame_cost import FrameCost
from app.viewer.transport.light_clients import spare_light_clients
from walkcore.errors import InvalidValueError

logger = logging.getLogger(__name__)

PERIOD = 1.0 / 30.0  # [s], of drawing
CAMERA_POSITION, CAMERA_TARGET = (-2.45, 1.75, 1.55), (0.15, 0.0, 0.78)  # [m], relative to the robot on the ground
FIELD_OF_VIEW = 0.70  # [rad]
PANEL_WIDTH = 308  # pixels: its tabs in one row
ACCENT = (34, 111, 220)


class Viewer:
    """Owns viser's server and the task that draws."""

    def __init__(self, runner: Runner, look: Look | None = None) -> None:
        """Build the scene; nothing is drawn before `start`.

        Args:
            runner: whose snapshots are shown, and whom the panel drives.
            look: how much there is to render.
        """
        self._runner = runner
        self._server = _server(runner.robot.name.capitalize())
        self._scene = Scene(self._server, runner.robot, Look() if look is None else look)
        spare_light_clients(self._server)
        self._audience = Audience(self._server)
        self._grab = Grab(self._server, runner, self._scene.body)
        self._panel = Panel(self._server, runner, self._scene)
        self._server.gui.main_panel.set_width(PANEL_WIDTH)
        self._server.gui.main_panel.dock_right()  # beside the scene: it covers nothing
        camera = self._server.initial_camera
        camera.position, camera.look_at, camera.fov = CAMERA_POSITION, CAMERA_TARGET, FIELD_OF_VIEW
        loop = self._server._websock_server._background_event_loop
        assert loop is not None  # viser has started
        self._loop = loop
        self._drawing: Future[None] | None = None
        self.cost = FrameCost()
        """Of what is drawn while somebody looks."""

    @property
    def port(self) -> int:
        """On which viser listens, on the loopback."""
        return self._server.get_port()

    @property
    def layers(self) -> dict[str, bool]:
        """Which layers are drawn, for all who look."""
        return self._panel.view.layers

    def switch(self, layers: Mapping[str, bool]) -> Future[dict[str, bool]]:
        """Draw layers or hide them; tells all of them.

        Raises:
            InvalidValueError: if there is no such layer.
        """
        for name, is_shown in layers.items():
            if name not in DEFAULTS:
                raise InvalidValueError(f"layers.{name}", is_shown, f"must be one of {', '.join(DEFAULTS)}")

        async def switch() -> dict[str, bool]:
            self._panel.view.switch(layers)
            return self.layers

        return asyncio.run_coroutine_threadsafe(switch(), self._loop)

    def start(self) -> None:
        """Begin to draw, in viser's own event loop: what its callbacks change needs no lock."""
        self._drawing = asyncio.run_coroutine_threadsafe(self._run(), self._loop)

    def stop(self) -> None:
        """Stop drawing and close viser."""
        if self._drawing is not None:
            self._drawing.cancel()
        self._server.stop()

    async def _run(self) -> None:
        last, has_failed = time.monotonic(), False
        self.cost.skip()
        due = last
        while True:
            due = max(due + PERIOD, time.monotonic())
            await asyncio.sleep(due - time.monotonic())
            now = time.monotonic()
            elapsed, last = now - last, now
            if not len(self._audience):
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
        state, parameters = self._runner.latest, self._runner.parameters
        self._scene.draw(state.snapshot, parameters, elapsed)
        self._grab.ask()
        self._scene.aim(state.snapshot, parameters, self._grab.impulse, self._grab.answer)
        self._panel.follow(state, self.cost.mean_ms, len(self._audience))
        self._audience.send(self._scene.stream)


def _server(label: str) -> viser.ViserServer:
    """A viser on the loopback, through which nobody may open a tunnel to the outside."""
    with contextlib.redirect_stdout(io.StringIO()):  # it would print an address that nobody should open
        server = viser.ViserServer(host="127.0.0.1", port=0, label=label, verbose=False)
    server._websock_server.unregister_handler(_messages.ShareUrlRequest)
    server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="small", brand_color=ACCENT)
    return server
