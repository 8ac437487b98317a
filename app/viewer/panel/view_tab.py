"""Which layers are drawn, and what their colours mean."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import viser

from app.viewer.scene.layers import LAYERS
from app.viewer.scene.scene import Scene

SEE_THROUGH = "see_through"
DEFAULTS = {name: layer.is_on for name, layer in LAYERS.items()} | {SEE_THROUGH: False}
RESET = "What was drawn when the server started"
SWATCH = (
    '<span style="display:inline-flex;align-items:center;gap:.4em;margin:0 .9em .2em 0;white-space:nowrap">'
    '<i style="width:.72em;height:.72em;border-radius:50%;box-shadow:0 0 0 1.5px #fff,0 0 0 2px #8886;background:{}">'
    "</i>{}</span>"
)


class ViewTab:
    """A switch for each layer, below the legend."""

    def __init__(self, server: viser.ViserServer, scene: Scene) -> None:
        """Make the switches."""
        server.gui.add_html(_legend())
        self._boxes = {
            name: _add_checkbox(server, layer.label, layer.meaning, layer.is_on, partial(scene.show, name))
            for name, layer in LAYERS.items()
        }
        self._boxes[SEE_THROUGH] = _add_checkbox(
            server, "see-through", "Let the centre of mass show through the robot", False, scene.see_through
        )

        for label, hint, layers in (
            ("All", "Draw everything", dict.fromkeys(LAYERS, True)),
            ("Defaults", RESET, DEFAULTS),
        ):
            self._add_button(server, label, hint, layers)

    def _add_button(self, server: viser.ViserServer, label: str, hint: str, layers: Mapping[str, bool]) -> None:
        button = server.gui.add_button(label, hint=hint)

        @button.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:  # in the loop that draws
            self.switch(layers)

    @property
    def layers(self) -> dict[str, bool]:
        """Which layers are drawn."""
        return {name: box.value for name, box in self._boxes.items()}

    def switch(self, layers: Mapping[str, bool]) -> None:
        """Draw layers or hide them, as their switches do; belongs to viser's event loop."""
        for name, is_shown in layers.items():
            self._boxes[name].value = is_shown


def _legend() -> str:
    swatches = [SWATCH.format(f"rgb{layer.colour}", layer.label) for layer in LAYERS.values() if layer.colour]
    return f'<div style="font-size:.76em;line-height:1.5;padding:.5em .6em 0">{"".join(swatches)}</div>'


def _add_checkbox(
    server: viser.ViserServer, label: str, hint: str, is_set: bool, apply: Callable[[bool], None]
) -> viser.GuiCheckboxHandle:
    box = server.gui.add_checkbox(label, is_set, hint=hint)

    @box.on_update
    async def _(_: viser.GuiEvent[Any]) -> None:  # in the loop that draws
        apply(box.value)

    return box
