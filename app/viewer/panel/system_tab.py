"""What runs here and how well it keeps up."""

from html import escape
from importlib.metadata import version

import viser

from app.live.runner import LiveState, Runner
from app.viewer.transport.stream import Stream

TABLE = '<table style="font-size:.8em;line-height:1.55;margin:.5em .7em;font-variant-numeric:tabular-nums">{}</table>'
ROW = '<tr><th style="text-align:left;font-weight:400;opacity:.7;padding-right:1em">{}</th><td>{}</td></tr>'


class SystemTab:
    """A table, told anew several times a second."""

    def __init__(self, server: viser.ViserServer, runner: Runner) -> None:
        """Make the table, empty."""
        self._runner = runner
        self._version = version("walk")
        self._table = server.gui.add_html(_table({"version": self._version}))

    def follow(self, stream: Stream, state: LiveState, frame_ms: float, nb_clients: int) -> None:
        """Tell the latest."""
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
        stream.control(self._table._impl.uuid, content=_table(rows))


def _table(rows: dict[str, str]) -> str:
    cells = "".join(ROW.format(escape(name), escape(value)) for name, value in rows.items())
    return TABLE.format(cells)
