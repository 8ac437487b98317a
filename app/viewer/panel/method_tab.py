"""Parameters of the method, changed while the robot walks; a refusal is shown to the client that made the request."""

from functools import partial
from html import escape
from typing import Any

import viser

from app.descriptions import descriptions
from app.live.runner import Runner
from app.viewer.panel.changes import is_made, number_text, range_hint, refuse
from walkcore import Parameters
from walkcore.mpc.qp import SOLVERS
from walkcore.mpc.schemes import SCHEMES
from walkcore.parameters import FIXED, LIMITS

SYMBOLS = {
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "delta": "δ",
    "cop_tracking": "κ CoP",
    "foothold_weight": "κ foot",
    "horizon_samples": "N",
    "step_duration": "t step [s]",
    "cop_margin": "margin [m]",
    "swing_height": "h foot [m]",
}
"""Labels of parameters that have a shorter one than their name."""
AT_START = "initial_double_support_duration"  # matters before the first step only
NUMBERS = {name: SYMBOLS.get(name, name) for name in LIMITS if name not in (*FIXED, AT_START)}
"""Label of each parameter that is typed in: every number that may change while the robot walks."""
SWITCHES = {"stepping_in_place": "step in place", "dynamic_filter": "dynamic filter"}
MEANINGS = '<dl style="font-size:.76em;line-height:1.45;margin:.4em .9em 1em">{}</dl>'
ROW = '<dt style="font-weight:600">{}</dt><dd style="margin:0 0 .4em;opacity:.75">{}</dd>'
TIMEOUT = 2.0  # [s] for the control process to respond


class MethodTab:
    """Controls that show the parameters in force."""

    def __init__(self, server: viser.ViserServer, runner: Runner) -> None:
        """Make the controls."""
        self._runner = runner
        now = self._shown = self._defaults = runner.parameters
        gui, hints = server.gui, descriptions(Parameters)
        labels = [_label(name) for name in SCHEMES]
        self.scheme = gui.add_dropdown("scheme", labels, initial_value=_label(now.scheme), hint=hints["scheme"])
        """Choice of the scheme, by its name and label."""
        with gui.add_form(None) as form:  # else every key that is typed would change the walk
            self.numbers = {
                name: gui.add_text(label, number_text(getattr(now, name)), hint=range_hint(hints[name], LIMITS[name]))
                for name, label in NUMBERS.items()
            }
            """Text fields by the names of their parameters."""
        form.on_submit(self.apply)
        gui.add_button("Apply", hint="So does Enter").on_click(self.apply)
        self.solver = gui.add_dropdown("solver", list(SOLVERS), initial_value=now.solver, hint=hints["solver"])
        """Choice of the QP solver."""
        self._switches = {
            name: gui.add_checkbox(label, getattr(now, name), hint=hints[name]) for name, label in SWITCHES.items()
        }
        self.scheme.on_update(self.change_scheme)
        self.solver.on_update(self.change_solver)
        for name, handle in self._switches.items():
            handle.on_update(partial(self._switch, name))
        gui.add_button("Defaults", hint="The parameters that the walk began with").on_click(self.restore)
        gui.add_markdown(_fixed(now))
        rows = "".join(ROW.format(escape(label), escape(hints[name])) for name, label in NUMBERS.items())
        gui.add_html(MEANINGS.format(rows))  # a finger cannot hover over a field

    def apply(self, event: viser.GuiEvent[Any]) -> None:
        """Change the parameters whose numbers were typed anew, all at once."""
        assert event.client is not None  # no code of ours submits the form
        values: dict[str, Any] = {}
        for name, label in NUMBERS.items():
            typed, current = self.numbers[name].value, getattr(self._shown, name)
            try:
                value = type(current)(typed)
            except ValueError:
                refuse(event.client, f"{label}: {typed!r} is not a number")
                self._show(self._runner.parameters)
                return
            if number_text(value) != number_text(current):
                values[name] = value
        if values:
            self._change(event.client, values)

    def _switch(self, name: str, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:  # not set by `update`
            self._change(event.client, {name: self._switches[name].value})

    def change_scheme(self, event: viser.GuiEvent[Any]) -> None:
        """Change to the chosen scheme, with a horizon that is long enough for it."""
        if event.client is None:  # set by `update`
            return
        name, now = self.scheme.value.partition(":")[0], self._runner.parameters
        values: dict[str, Any] = {"scheme": name}
        per_step = now.timing.samples_per_step
        needed, needed_now = (scheme.lasting_horizon(per_step) for scheme in (SCHEMES[name], now.formulation))
        if now.horizon_samples < needed or needed < needed_now:
            values["horizon_samples"] = max(self._defaults.horizon_samples, needed)
        self._change(event.client, values)

    def change_solver(self, event: viser.GuiEvent[Any]) -> None:
        """Change to the chosen solver."""
        if event.client is not None:  # not set by `update`
            self._change(event.client, {"solver": self.solver.value})

    def restore(self, event: viser.GuiEvent[Any]) -> None:
        """Change all parameters back to those that the walk began with."""
        if event.client is not None:
            self._change(event.client, self._defaults.to_mapping())

    def _change(self, client: viser.ClientHandle, values: dict[str, Any]) -> None:
        if not is_made(client, self._runner.change(values), TIMEOUT):
            self._show(self._runner.parameters)

    def update(self) -> None:
        """Show the parameters in force, whoever changed them."""
        if self._runner.parameters is not self._shown:
            self._show(self._runner.parameters)

    def _show(self, parameters: Parameters) -> None:
        self._shown = parameters
        self.scheme.value = _label(parameters.scheme)
        self.solver.value = parameters.solver
        for name, handle in self.numbers.items():
            handle.value = number_text(getattr(parameters, name))
        for name, handle in self._switches.items():
            handle.value = getattr(parameters, name)


def _label(scheme: str) -> str:
    return f"{scheme}: {SCHEMES[scheme].label}"


def _fixed(p: Parameters) -> str:
    """Sentence on the parameters that hold for the whole walk."""
    height = "the robot's own" if p.com_height is None else f"{p.com_height:g} m"
    return (
        f"For the whole walk: T {p.sampling_period:g} s, of which each step begins with one on both feet, "
        f"tick {p.control_period:g} s, CoM height {height}, g {p.gravity:g} m/s²."
    )
