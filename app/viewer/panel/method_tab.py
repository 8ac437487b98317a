"""The paper's parameters, changed while the robot walks; what the walk refuses is told to the one who asked."""

from collections.abc import Callable
from concurrent.futures import TimeoutError
from dataclasses import dataclass
from functools import partial
from typing import Any

import viser

from app.live.runner import NoResponseError, Runner
from walkcore import Parameters, WalkError
from walkcore.mpc.schemes import SCHEMES

PATIENCE = 2.0  # [s] for the walk to answer


@dataclass(frozen=True, slots=True)
class Number:
    """A parameter that is typed in: its symbol, and what it does."""

    label: str
    hint: str
    parse: Callable[[str], Any] = float


NUMBERS = {
    "alpha": Number("α", "Weight of the jerk in (19): smoother motion"),
    "beta": Number("β", "Weight of the velocity error in (19): follows the reference more closely"),
    "gamma": Number("γ", "Weight of the distance from the CoP to the middle of the foot in (19): safer feet"),
    "delta": Number("δ", "Weight of the error of the mean velocity over two steps; of scheme (31) alone"),
    "cop_tracking": Number("κ CoP", "Weight of the distance from the CoP to the middle of the foot in (11)"),
    "foothold_weight": Number("κ foot", "Weight of moving the planned footholds, in the scheme that may move them"),
    "horizon_samples": Number("N", "Samples of the horizon, T = 0.1 s apart: must reach beyond a step", int),
    "step_duration": Number("t step [s]", "Duration of a step, in whole T, from the next one on"),
    "cop_margin": Number("margin [m]", "Of the CoP from the edges of the sole, in (28)"),
    "swing_height": Number("h foot [m]", "Highest point of the sole in the air"),
}
SWITCHES = {
    "stepping_in_place": ("step in place", "Keep stepping while asked to stay, as the paper's robot does"),
    "dynamic_filter": (
        "dynamic filter",
        "Move the body's CoM by some millimetres to keep the true CoP at the model's",
    ),
}


class MethodTab:
    """Controls with the parameters in force."""

    def __init__(self, server: viser.ViserServer, runner: Runner) -> None:
        """Make the controls."""
        self._runner = runner
        now = self._shown = self._defaults = runner.parameters
        gui = server.gui
        labels = [_label(name) for name in SCHEMES]
        self._scheme = gui.add_dropdown("scheme", labels, hint="Objective, and who decides the footholds")
        with gui.add_form(None) as form:  # else every key that is typed would change the walk
            self._numbers = {
                name: gui.add_text(number.label, _text(getattr(now, name)), hint=number.hint)
                for name, number in NUMBERS.items()
            }
        form.on_submit(self._apply)
        gui.add_button("Apply", hint="So does Enter").on_click(self._apply)
        self._switches = {
            name: gui.add_checkbox(label, getattr(now, name), hint=hint) for name, (label, hint) in SWITCHES.items()
        }
        self._scheme.on_update(self._change_scheme)
        for name, handle in self._switches.items():
            handle.on_update(partial(self._switch, name))
        gui.add_button("Defaults", hint="The parameters that the walk began with").on_click(self._restore)
        gui.add_markdown(_fixed(now))

    def _apply(self, event: viser.GuiEvent[Any]) -> None:
        assert event.client is not None  # nobody submits it from here
        values: dict[str, Any] = {}
        for name, number in NUMBERS.items():
            try:
                value = number.parse(self._numbers[name].value)
            except ValueError:
                self._refuse(event.client, f"{number.label}: {self._numbers[name].value!r} is not a number")
                return
            if _text(value) != _text(getattr(self._shown, name)):
                values[name] = value
        if values:
            self._ask(event.client, values)

    def _switch(self, name: str, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:  # not set by `follow`
            self._ask(event.client, {name: self._switches[name].value})

    def _change_scheme(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is None:
            return
        name, now = self._scheme.value.partition(":")[0], self._runner.parameters
        values: dict[str, Any] = {"scheme": name}
        least = SCHEMES[name].least_horizon(now.timing.samples_per_step)
        looks_ahead_less = SCHEMES[name].nb_steps_ahead < now.formulation.nb_steps_ahead
        if now.horizon_samples < least or looks_ahead_less:
            values["horizon_samples"] = max(self._defaults.horizon_samples, least)
        self._ask(event.client, values)

    def _ask(self, client: viser.ClientHandle, values: dict[str, Any]) -> None:
        try:
            self._runner.change(values).result(timeout=PATIENCE)
        except (WalkError, NoResponseError, TimeoutError) as refusal:
            self._refuse(client, str(refusal) or "the walk does not answer")

    def _refuse(self, client: viser.ClientHandle, reason: str) -> None:
        client.add_notification("Not changed", reason, color="red")
        self._show(self._runner.parameters)

    def _restore(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            self._ask(event.client, self._defaults.to_mapping())

    def follow(self) -> None:
        """Show the parameters in force, whoever changed them."""
        if self._runner.parameters is not self._shown:
            self._show(self._runner.parameters)

    def _show(self, parameters: Parameters) -> None:
        self._shown = parameters
        self._scheme.value = _label(parameters.scheme)
        for name, handle in self._numbers.items():
            handle.value = _text(getattr(parameters, name))
        for name, handle in self._switches.items():
            handle.value = getattr(parameters, name)


def _label(scheme: str) -> str:
    return f"{scheme}: {SCHEMES[scheme].label}"


def _text(value: float) -> str:
    return f"{value:g}"


def _fixed(p: Parameters) -> str:
    """What holds for the whole walk."""
    height = "the robot's own" if p.com_height is None else f"{p.com_height:g} m"
    return (
        f"For the whole walk: T {p.sampling_period:g} s, of which each step begins with one on both feet, "
        f"tick {p.control_period:g} s, CoM height {height}, g {p.gravity:g} m/s²."
    )
