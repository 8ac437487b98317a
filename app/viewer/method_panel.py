"""The part of the panel that changes the method while the robot walks: scheme, weights, margin."""

from typing import Any

import viser

from app.runner import Runner
from walkcore import WalkError
from walkcore.schemes import SCHEMES

PAPER = {
    "full": "(19), the paper's",
    "speed_and_jerk": "(19) without gamma",
    "speed_only": "(17)",
    "mean_speed": "(31), mean velocity",
    "adapted_steps": "planned steps, moved at a cost",
    "fixed_steps": "(11), planned steps",
    "preview_control": "preview control, no constraints",
}
WEIGHTS = {"alpha": "jerk", "beta": "velocity error", "gamma": "CoP to the middle of the foot"}
SWITCHES = {
    "stepping_in_place": "Keep stepping while asked to stay, as the paper's robot does",
    "dynamic_filter": "Move the body's CoM by some millimetres to keep the true CoP at the model's",
}


class MethodPanel:
    """Controls that are shared by all clients; what the walk refuses is told to the one who asked."""

    def __init__(self, server: viser.ViserServer, runner: Runner) -> None:
        """Make the controls, with the parameters in force."""
        self._runner = runner
        now = self._defaults = runner.parameters
        gui = server.gui
        labels = [f"{name}: {PAPER[name]}" for name in sorted(SCHEMES, key=list(PAPER).index)]
        self._scheme = gui.add_dropdown("scheme", labels, hint="Objective, and who decides the footholds")
        self._weights = {
            name: gui.add_number(name, getattr(now, name), min=0.0, step=1e-7, hint=f"Weight of the {meaning}")
            for name, meaning in WEIGHTS.items()
        }
        self._margin = gui.add_slider(
            "margin", 0.0, 0.05, 0.005, now.cop_margin, hint="Of the CoP from the edges of the sole [m]"
        )
        self._switches = {
            name: gui.add_checkbox(name.replace("_", " "), getattr(now, name), hint=hint)
            for name, hint in SWITCHES.items()
        }
        for handle in (self._scheme, self._margin, *self._weights.values(), *self._switches.values()):
            handle.on_update(self._change)
        gui.add_button("Defaults", hint="The paper's parameters").on_click(self._restore)

    def _asked(self) -> dict[str, Any]:
        scheme = self._scheme.value.partition(":")[0]
        step = self._runner.parameters.samples_per_step
        return {
            "scheme": scheme,
            "horizon_samples": (4 if scheme == "mean_speed" else 2) * step,  # (31) looks four steps ahead
            "cop_margin": self._margin.value,
            **{name: handle.value for name, handle in (self._weights | self._switches).items()},
        }

    def _change(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is None:  # set by `_restore`
            return
        try:
            self._runner.change(self._asked()).result(timeout=1.0)
        except WalkError as refusal:
            event.client.add_notification("Not changed", str(refusal), color="red")

    def _restore(self, _: Any) -> None:
        p = self._defaults
        self._scheme.value = f"{p.scheme}: {PAPER[p.scheme]}"
        self._margin.value = p.cop_margin
        for name, handle in (self._weights | self._switches).items():
            handle.value = getattr(p, name)
        self._runner.change(p.to_mapping())
