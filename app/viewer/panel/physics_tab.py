"""Plant, twin and world of the live walk; a refusal is shown to the client that made the request."""

from concurrent.futures import Future
from html import escape
from typing import Any

import viser

from app.descriptions import descriptions
from app.live.live_state import LiveState
from app.live.runner import Runner
from app.viewer.panel.changes import is_made, number_text, range_hint, refuse
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import Parameters
from walkcore.plant.world import LIMITS, PERFECT, SENSORS, World

PLANTS = {"ideal": "ideal model", "mujoco": "contact physics"}
"""Labels of the plants by their names."""
NUMBERS = {
    "friction": "friction",
    "slope": "slope [rad]",
    "strip_height": "strips [m]",
    "payload": "payload [kg]",
    "mass_error": "heavier by",
    "delay": "delay [s]",
}
"""Labels of the numbers of a world."""
TIMEOUT = 15.0  # [s] for the control process to build a plant
NOTE = '<p style="font-size:.78em;line-height:1.5;margin:.2em .9em .6em">{}</p>'


class PhysicsTab:
    """Controls that show the plant, the twin and the world in force."""

    def __init__(self, server: viser.ViserServer, runner: Runner) -> None:
        """Make the controls."""
        self._runner, gui = runner, server.gui
        has_body, hints = runner.robot.body is not None, descriptions(World)
        twin_hint = descriptions(Parameters)["twin"]
        self.plant = gui.add_dropdown(
            "plant", list(PLANTS.values()), disabled=not has_body, hint="Another plant resets the robot"
        )
        """Choice of the plant, by its label."""
        self.twin = gui.add_checkbox("ideal twin", False, disabled=not has_body, hint=twin_hint)
        """Switch of the twin."""
        self._note = gui.add_html(NOTE.format(""))
        self._sent_note = ""
        with gui.add_form(None) as form:  # else every key that is typed would reset the robot
            self.numbers = {
                name: gui.add_text(
                    label,
                    number_text(getattr(PERFECT, name)),
                    disabled=not has_body,
                    hint=range_hint(hints[name], LIMITS[name]),
                )
                for name, label in NUMBERS.items()
            }
            """Text fields by the names of what they hold."""
        self.sensors = gui.add_dropdown("sensors", list(SENSORS), disabled=not has_body, hint=hints["sensors"])
        """Choice of the sensors."""
        form.on_submit(self.apply)
        gui.add_button("Apply", hint="So does Enter; resets the robot into this world", disabled=not has_body).on_click(
            self.apply
        )
        gui.add_button("Flat and perfect", hint="The world that the model assumes", disabled=not has_body).on_click(
            self.restore
        )
        self.plant.on_update(self._change_plant)
        self.twin.on_update(self._switch_twin)
        self._shown: tuple[str, bool, World] | None = None

    def apply(self, event: viser.GuiEvent[Any]) -> None:
        """Reset the robot into the world that was typed."""
        assert event.client is not None  # no code of ours submits the form
        world: dict[str, Any] = {"sensors": self.sensors.value}
        for name, handle in self.numbers.items():
            try:
                world[name] = float(handle.value)
            except ValueError:
                refuse(event.client, f"{NUMBERS[name]}: {handle.value!r} is not a number")
                self._shown = None
                return
        self._wait(event.client, self._runner.begin({}, world))

    def restore(self, event: viser.GuiEvent[Any]) -> None:
        """Reset the robot into the perfect world."""
        assert event.client is not None
        self._wait(event.client, self._runner.begin({}, PERFECT.to_mapping()))

    def _change_plant(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:  # not set by `update`
            names = {label: name for name, label in PLANTS.items()}
            self._wait(event.client, self._runner.change({"plant": names[self.plant.value]}))

    def _switch_twin(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            self._wait(event.client, self._runner.change({"twin": self.twin.value}))

    def _wait(self, client: viser.ClientHandle, response: Future[Any]) -> None:
        if not is_made(client, response, TIMEOUT):
            self._shown = None

    def update(self, updates: SceneUpdates, state: LiveState) -> None:
        """Show what is in force, whoever changed it."""
        note = " ".join(
            f"{words[:1].upper()}{words[1:]}." for words in (state.plant_reason, state.twin_difference) if words
        )
        if note != self._sent_note:
            self._sent_note = note
            updates.control(self._note, content=NOTE.format(escape(note)))
        now = (state.plant, self._runner.parameters.twin, state.world)
        if now == self._shown:
            return
        self._shown = now
        self.plant.value, self.twin.value = PLANTS[state.plant], self._runner.parameters.twin
        self.sensors.value = state.world.sensors  # pyright: ignore[reportAttributeAccessIssue]  # its options are SENSORS
        for name, handle in self.numbers.items():
            handle.value = number_text(getattr(state.world, name))
