"""Shows the runner's latest snapshot in a viser scene, at a steady rate, while somebody looks.

viser listens on a loopback port of its own, which `app.proxy` serves to the outside.
"""

import contextlib
import io
import queue
import threading
import time
from collections.abc import Callable

import viser
from viser import _messages

from app.runner import Runner
from app.viewer.light_clients import spare_light_clients
from app.viewer.panel import Panel
from app.viewer.scene import Look, Scene

PERIOD = 1.0 / 30.0  # [s], of drawing
FRAMES_PER_PANEL_UPDATE = 6
CAMERA_POSITION, CAMERA_TARGET = (-2.45, 1.75, 1.55), (0.15, 0.0, 0.78)  # [m], relative to the robot on the ground
FIELD_OF_VIEW = 0.70  # [rad]
ACCENT = (34, 111, 220)


class Viewer:
    """Owns viser's server and the thread that draws."""

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
        self._wishes: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._panel = Panel(self._server, runner, self._wish_to_show, self._wish_to_see_through)
        self._server.gui.main_panel.set_width(270)
        camera = self._server.initial_camera
        camera.position, camera.look_at, camera.fov = CAMERA_POSITION, CAMERA_TARGET, FIELD_OF_VIEW
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="viewer", daemon=True)

    @property
    def port(self) -> int:
        """On which viser listens, on the loopback."""
        return self._server.get_port()

    def start(self) -> None:
        """Begin to draw."""
        self._thread.start()

    def stop(self) -> None:
        """Stop drawing and close viser."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        self._server.stop()

    def _wish_to_show(self, layer: str, is_visible: bool) -> None:
        self._wishes.put(lambda: self._scene.show(layer, is_visible))

    def _wish_to_see_through(self, is_see_through: bool) -> None:
        self._wishes.put(lambda: self._scene.see_through(is_see_through))

    def _run(self) -> None:
        frame, last = 0, time.monotonic()
        while not self._stopping.wait(max(0.0, last + PERIOD - time.monotonic())):
            now = time.monotonic()
            elapsed, last = now - last, now
            if not self._server.get_clients():
                continue  # viser would keep every message for the clients to come
            while not self._wishes.empty():
                self._wishes.get()()
            state = self._runner.latest
            self._scene.draw(state.snapshot, elapsed)
            if frame % FRAMES_PER_PANEL_UPDATE == 0:
                self._panel.follow(state.snapshot.reference, state.driver)
            frame += 1


def _server(label: str) -> viser.ViserServer:
    """A viser on the loopback, through which nobody may open a tunnel to the outside."""
    with contextlib.redirect_stdout(io.StringIO()):  # it would print an address that nobody should open
        server = viser.ViserServer(host="127.0.0.1", port=0, label=label, verbose=False)
    server._websock_server.unregister_handler(_messages.ShareUrlRequest)
    server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="small", brand_color=ACCENT)
    return server
