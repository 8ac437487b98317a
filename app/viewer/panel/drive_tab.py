"""Sliders that hold a velocity, and a button that lets go of it."""

from typing import Any

import viser

from app.live.runner import LiveState, Runner
from app.viewer.transport.visitors import Visitors
from walkcore import Reference

DRIVER = "sliders"
SLIDERS = {
    "vx": ("forward", "m/s", 0.01),
    "vy": ("left", "m/s", 0.01),
    "yaw_rate": ("turn left", "rad/s", 0.01),
}


class DriveTab:
    """The velocity asked for."""

    def __init__(self, server: viser.ViserServer, runner: Runner) -> None:
        """Make the controls."""
        self._runner = runner
        self._visitors = Visitors(server)
        self._sliders = {name: self._add_slider(server, name) for name in SLIDERS}
        zero = server.gui.add_button("Zero", hint="Ask the robot to stop")
        zero.on_click(lambda event: self._drive(Reference(), event))
        server.gui.add_markdown("Drag the robot's body to push it; Esc lets go.")

    def _add_slider(self, server: viser.ViserServer, name: str) -> viser.GuiSliderHandle[float]:
        meaning, unit, step = SLIDERS[name]
        low, high = self._runner.robot.max_reference[name]
        has_range = low < high
        hint = f"Velocity asked for, {meaning} [{unit}]; held until changed"
        slider = server.gui.add_slider(
            f"{meaning} [{unit}]",
            min=low,
            max=high if has_range else low + step,
            step=step,
            initial_value=0.0,
            disabled=not has_range,
            hint=hint if has_range else f"{hint}. This robot does not do that yet.",
        )

        @slider.on_update
        def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:  # not from `follow`
                self._drive(Reference(**{key: float(handle.value) for key, handle in self._sliders.items()}), event)

        return slider

    def _drive(self, reference: Reference, event: viser.GuiEvent[Any]) -> None:
        page = "" if event.client is None else self._visitors.page(event.client)
        # A client may send any value, whatever range its slider shows.
        self._runner.drive(self._runner.robot.clamped_reference(reference), DRIVER, client=page)

    def follow(self, state: LiveState) -> None:
        """Let the sliders show what another driver asks for, and tell when the one who set them is gone."""
        driver, client = self._runner.active_driver
        if driver == DRIVER:
            if client and not self._visitors.is_here(client):
                self._runner.drive(state.snapshot.reference, DRIVER)
            return
        for name, slider in self._sliders.items():
            value = round(getattr(state.snapshot.reference, name), 2)
            if slider.value != value:
                slider.value = value
