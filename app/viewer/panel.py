"""The panel beside the scene: sliders for the velocity, the method, and which layers are drawn."""

from collections.abc import Callable
from functools import partial

import viser

from app.runner import LiveState, Runner
from app.viewer.layers import LAYERS
from app.viewer.method_panel import MethodPanel
from app.viewer.scene import Scene
from walkcore import Reference

DRIVER = "sliders"
SLIDERS = {
    "vx": ("forward", "m/s", 0.01),
    "vy": ("left", "m/s", 0.01),
    "yaw_rate": ("turn left", "rad/s", 0.01),
}


class Panel:
    """The controls, shared by all clients. Their callbacks only leave wishes."""

    def __init__(
        self,
        server: viser.ViserServer,
        runner: Runner,
        scene: Scene,
    ) -> None:
        """Make the controls.

        Args:
            server: of viser.
            runner: is driven by the sliders.
            scene: whose layers are switched.
        """
        self._runner = runner
        with server.gui.add_folder("Drive"):
            self._sliders = {name: self._add_slider(server, name) for name in SLIDERS}
            zero = server.gui.add_button("Zero", hint="Ask the robot to stop")
            zero.on_click(lambda _: self._drive(Reference()))
        with server.gui.add_folder("Method", expand_by_default=False):
            MethodPanel(server, runner)
        with server.gui.add_folder("View", expand_by_default=False):
            for name, layer in LAYERS.items():
                _add_checkbox(server, layer.label, layer.meaning, layer.is_on, partial(scene.show, name))
            _add_checkbox(
                server, "see-through", "Let the centre of mass show through the robot", False, scene.see_through
            )

    def _add_slider(self, server: viser.ViserServer, name: str) -> viser.GuiSliderHandle[float]:
        meaning, unit, step = SLIDERS[name]
        low, high = self._runner.robot.max_reference[name]
        has_range = low < high
        hint = f"Velocity asked for, {meaning} [{unit}]; held until changed"
        slider = server.gui.add_slider(
            name.replace("_", " "),
            min=low,
            max=high if has_range else low + step,
            step=step,
            initial_value=0.0,
            disabled=not has_range,
            hint=hint if has_range else f"{hint}. This robot does not do that yet.",
        )

        @slider.on_update
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None:  # not from `follow`
                self._drive(Reference(**{key: float(handle.value) for key, handle in self._sliders.items()}))

        return slider

    def _drive(self, reference: Reference) -> None:
        # A client may send any value, whatever range its slider shows.
        self._runner.drive(self._runner.robot.clamped_reference(reference), DRIVER)

    def follow(self, state: LiveState) -> None:
        """Let the sliders show what another driver asks for."""
        if state.driver == DRIVER:
            return
        for name, slider in self._sliders.items():
            slider.value = round(getattr(state.snapshot.reference, name), 2)


def _add_checkbox(
    server: viser.ViserServer, label: str, hint: str, is_set: bool, apply: Callable[[bool], None]
) -> None:
    box = server.gui.add_checkbox(label, is_set, hint=hint)

    @box.on_update
    async def _(_: viser.GuiEvent) -> None:  # in the loop that draws
        apply(box.value)
