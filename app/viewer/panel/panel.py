"""Panel beside the scene, in tabs. Its controls are shared by all clients, and only leave requests for the runner."""

from collections.abc import Mapping
from contextlib import suppress
from html import escape
from importlib.metadata import version
from typing import Any

import viser

from app.live.driver_lease import DriverLease, LeaseHeldError
from app.live.live_state import LiveState
from app.live.messages import NoResponseError
from app.live.runner import Runner
from app.viewer.layer_choices import LayerChoices
from app.viewer.panel.changes import NOTICE
from app.viewer.panel.method_tab import MethodTab
from app.viewer.panel.physics_tab import PhysicsTab
from app.viewer.panel.plots_tab import PlotsTab
from app.viewer.scene.layers import DEFAULT_LAYERS, LAYERS
from app.viewer.scene.scene import Scene
from app.viewer.transport.client_registry import ClientRegistry
from app.viewer.transport.scene_updates import SceneUpdates
from app.viewer.transport.viser_private import control_id
from walkcore import Reference

FRAMES_PER_UPDATE = 6  # five updates a second
DRIVER = "sliders"
SLIDERS = {"vx": ("forward", "m/s"), "vy": ("left", "m/s"), "yaw_rate": ("turn left", "rad/s")}
STEP = 0.01  # of a slider
OPTIONS = ("see_through",)  # layers that the button for all of them leaves alone
SWATCH = (
    '<span data-layer="{1}" '
    'style="display:inline-flex;align-items:center;gap:.4em;margin:0 .9em .2em 0;white-space:nowrap">'
    '<i style="width:.72em;height:.72em;border-radius:50%;box-shadow:0 0 0 1.5px #fff,0 0 0 2px #8886;background:{0}">'
    "</i>{1}</span>"
)
LEGEND = '<div class="layer-legend" style="font-size:.76em;line-height:1.5;padding:.5em .6em 0">{}</div>'
TABLE = '<table style="font-size:.8em;line-height:1.55;margin:.5em .7em;font-variant-numeric:tabular-nums">{}</table>'
ROW = '<tr><th style="text-align:left;font-weight:400;opacity:.7;padding-right:1em">{}</th><td>{}</td></tr>'


class Panel:
    """Tabs with everything that a person sets and reads beside the scene."""

    def __init__(
        self,
        server: viser.ViserServer,
        runner: Runner,
        scene: Scene,
        clients: ClientRegistry,
        lease: DriverLease,
    ) -> None:
        """Make the controls.

        Args:
            server: gets the controls.
            runner: gets the requests.
            scene: its layers are switched, and its updates take what the panel shows.
            clients: tell which page a slider was moved on.
            lease: of the controls; without it sliders do not drive while another browser drives alone.
        """
        tabs = server.gui.add_tab_group()
        with tabs.add_tab("Drive"):
            self._drive = DriveTab(server, runner, clients, lease)
        with tabs.add_tab("View"):
            self.view = ViewTab(server, scene, clients)
        with tabs.add_tab("Method"):
            self._method = MethodTab(server, runner)
        with tabs.add_tab("Physics"):
            self._physics = PhysicsTab(server, runner)
        with tabs.add_tab("Plots"):
            self.plots = PlotsTab(server)
        with tabs.add_tab("System"):
            self._system = SystemTab(server, runner)
        self._updates = scene.updates
        self._frame = 0

    def update(self, state: LiveState, frame_ms: float, nb_clients: int) -> None:
        """Show the state of a drawn frame, and the values that others have set.

        Args:
            state: of the robot.
            frame_ms: processor time of a drawn frame [ms].
            nb_clients: number of browsers that are connected.
        """
        self.plots.record(state)
        self._frame += 1
        if self._frame % FRAMES_PER_UPDATE == 0:
            self._drive.update(state)
            self._method.update()
            self._physics.update(self._updates, state)
            self.plots.update(self._updates)
            self._system.update(self._updates, state, frame_ms, nb_clients)


class DriveTab:
    """Sliders that hold a reference velocity, and a button that sets it to zero."""

    def __init__(self, server: viser.ViserServer, runner: Runner, clients: ClientRegistry, lease: DriverLease) -> None:
        """Make the controls."""
        self._runner, self._clients, self._lease = runner, clients, lease
        self._sliders = {name: self._add_slider(server, name) for name in SLIDERS}
        zero = server.gui.add_button("Zero", hint="Ask the robot to stop")
        zero.on_click(lambda event: self._drive(Reference(), event.client))
        server.gui.add_markdown("Drag the robot to push it where you hold it; Esc lets go.")

    def _add_slider(self, server: viser.ViserServer, name: str) -> viser.GuiSliderHandle[float]:
        direction, unit = SLIDERS[name]
        low, high = self._runner.robot.max_reference[name]
        has_range = low < high
        hint = f"Reference velocity, {direction} [{unit}]; held until changed"
        slider = server.gui.add_slider(
            f"{direction} [{unit}]",
            min=low,
            max=high if has_range else low + STEP,
            step=STEP,
            initial_value=0.0,
            disabled=not has_range,
            hint=hint if has_range else f"{hint}. This robot does not do that yet.",
        )

        @slider.on_update
        def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:  # not set by `update`
                values = {key: float(handle.value) for key, handle in self._sliders.items()}
                self._drive(Reference(**values), event.client)

        return slider

    def _drive(self, reference: Reference, client: viser.ClientHandle | None) -> None:
        page = "" if client is None else self._clients.page(client.client_id)
        try:
            if reference != Reference():  # zero stops the robot, whoever drives
                self._lease.check(page)
            # A client may send any value, whatever range its slider shows.
            self._runner.drive(self._runner.robot.clamped_reference(reference), DRIVER, client=page)
        except (LeaseHeldError, NoResponseError) as refusal:
            if client is not None:
                client.add_notification("Not driven", str(refusal), color="red", auto_close_seconds=NOTICE)

    def update(self, state: LiveState) -> None:
        """Show the reference of another driver; name no client any more once the one that moved the sliders is gone."""
        driver, client = self._runner.active_driver
        if driver == DRIVER:
            if client and not self._clients.is_open(client):
                with suppress(NoResponseError):  # the next frame tries again
                    self._runner.drive(state.snapshot.reference, DRIVER)
            return
        for name, slider in self._sliders.items():
            value = round(getattr(state.snapshot.reference, name), 2)
            if slider.value != value:
                slider.value = value


class ViewTab:
    """Switch for each layer, below the legend of their colours. Each page has its own choice.

    Our page hides the legend and puts each colour beside its switch, which viser cannot.
    """

    def __init__(self, server: viser.ViserServer, scene: Scene, clients: ClientRegistry) -> None:
        """Make the switches."""
        self._clients = clients
        swatches = [SWATCH.format(f"rgb{layer.colour}", layer.label) for layer in LAYERS.values() if layer.colour]
        server.gui.add_html(LEGEND.format("".join(swatches)))
        boxes = {
            name: server.gui.add_checkbox(layer.label, layer.is_on, hint=layer.meaning)
            for name, layer in LAYERS.items()
        }
        self.layers = LayerChoices(scene, boxes)
        """Layers that each page is shown."""
        self.boxes = {control_id(box): name for name, box in boxes.items()}
        """Name of the layer that each switch is for, by the switch's id: viser does not hear of them."""
        all_layers = {name: True for name in LAYERS if name not in OPTIONS}
        self._add_button(server, "All", "Draw everything", all_layers)
        self._add_button(server, "Defaults", "Layers shown when the server started", DEFAULT_LAYERS)

    def _add_button(self, server: viser.ViserServer, label: str, hint: str, layers: Mapping[str, bool]) -> None:
        button = server.gui.add_button(label, hint=hint)

        @button.on_click
        async def _(event: viser.GuiEvent[Any]) -> None:  # async: in the loop that draws
            if event.client is not None:
                self.layers.switch(self._clients.page(event.client.client_id), layers)


class SystemTab:
    """Table of what runs here and how well it keeps up with real time."""

    def __init__(self, server: viser.ViserServer, runner: Runner) -> None:
        """Make the table, empty."""
        self._runner = runner
        self._version = version("walk")
        self._table = server.gui.add_html(_table({"version": self._version}))

    def update(self, updates: SceneUpdates, state: LiveState, frame_ms: float, nb_clients: int) -> None:
        """Show the latest values; see `Panel.update`."""
        timing, counts = state.timing, state.counts
        rows = {
            "version": self._version,
            "robot": self._runner.robot.name,
            "scheme": self._runner.parameters.scheme,
            "tick": f"{timing.tick_ms:.2f} ms, at most {timing.tick_ms_max:.1f}",
            **{f"· {stage}": f"{ms:.3f} ms" for stage, ms in timing.stages.items()},
            "real time": f"{timing.real_time_factor:.2f} × at speed {state.speed:g}",
            "drawn frame": f"{frame_ms:.2f} ms",
            "late ticks": f"{timing.misses}",
            "relaxed": f"{counts.relaxed} ticks",
            "falls": f"{counts.failed}",
            "viewers": f"{nb_clients}",
            **({"fault": state.fault} if state.fault else {}),
        }
        updates.control(self._table, content=_table(rows))


def _table(rows: Mapping[str, str]) -> str:
    return TABLE.format("".join(ROW.format(escape(name), escape(value)) for name, value in rows.items()))
