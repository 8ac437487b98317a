"""The panel beside the scene, in tabs. Its controls are shared by all clients."""

import viser

from app.live.runner import LiveState, Runner
from app.viewer.panel.drive_tab import DriveTab
from app.viewer.panel.method_tab import MethodTab
from app.viewer.panel.plots_tab import PlotsTab
from app.viewer.panel.system_tab import SystemTab
from app.viewer.panel.view_tab import ViewTab
from app.viewer.scene.scene import Scene

FRAMES_PER_UPDATE = 6  # five a second


class Panel:
    """What a person drives, sees and changes. Callbacks only leave wishes."""

    def __init__(self, server: viser.ViserServer, runner: Runner, scene: Scene) -> None:
        """Make the controls.

        Args:
            server: of viser.
            runner: is driven.
            scene: whose layers are switched, and whose stream takes what the panel tells.
        """
        tabs = server.gui.add_tab_group()
        with tabs.add_tab("Drive"):
            self._drive = DriveTab(server, runner)
        with tabs.add_tab("View"):
            self.view = ViewTab(server, scene)
        with tabs.add_tab("Method"):
            self._method = MethodTab(server, runner)
        with tabs.add_tab("Plots"):
            self._plots = PlotsTab(server, runner.robot)
        with tabs.add_tab("System"):
            self._system = SystemTab(server, runner)
        self._stream = scene.stream
        self._frame = 0

    def follow(self, state: LiveState, frame_ms: float, nb_clients: int) -> None:
        """Tell what the robot does, and let the controls show what others ask for."""
        self._plots.record(state)
        self._frame += 1
        if self._frame % FRAMES_PER_UPDATE == 0:
            self._drive.follow(state)
            self._method.follow()
            self._plots.draw(self._stream)
            self._system.follow(self._stream, state, frame_ms, nb_clients)
