"""How a tick and a drawn frame grow with the browsers that look: `clients.py --out DIR` measures and draws it.

Ticks and frames are of two runs: a served robot with `deadlines.py`, and drawing alone with `viewer.py`.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import deadlines
import matplotlib.pyplot as plt
import tyro
import viewer
from empty_loop import empty_loop

from app.viewer import Viewer


@dataclass(frozen=True, slots=True)
class Clients:
    """Measure for some numbers of browsers."""

    out: Path
    """Folder for clients.json and clients.svg."""
    numbers: tuple[int, ...] = (1, 5, 20)
    seconds: float = 30.0
    """Of each measurement."""

    def __call__(self) -> None:
        """Measure, write and draw."""
        found = {"frames": self._frames(), "ticks": [self._ticks(number) for number in self.numbers]}
        self.out.mkdir(parents=True, exist_ok=True)
        (self.out / "clients.json").write_text(json.dumps(found, indent=2) + "\n")
        self._draw(found)

    def _frames(self) -> list[dict[str, Any]]:
        shown = Viewer(viewer.Replay())  # pyright: ignore[reportArgumentType]
        spent = viewer.time_parts(shown._scene, shown._audience)
        shown.start()
        frames = [viewer.measure(shown, spent, number, self.seconds) for number in self.numbers]
        shown.stop()
        return frames

    def _ticks(self, number: int) -> dict[str, Any]:
        with deadlines.server("talos") as url, deadlines.crowd(url, number), empty_loop() as empty:
            return deadlines.measured(url, number, self.seconds, empty)

    def _draw(self, found: dict[str, list[dict[str, Any]]]) -> None:
        figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
        frames, ticks = found["frames"], found["ticks"]
        axes.plot(self.numbers, [frame["ms_per_frame"] for frame in frames], "o-", label="server, a frame")
        axes.plot(self.numbers, [frame["parts_ms"]["all drawing"] for frame in frames], "o--", label="of which drawing")
        axes.plot(self.numbers, [frame["parts_ms"]["sending"] for frame in frames], "o--", label="of which sending")
        axes.plot(self.numbers, [tick["last"]["tick_ms"] for tick in ticks], "s-", label="control, a tick")
        axes.set(xlabel="browsers", ylabel="[ms]", xticks=self.numbers, ylim=(0.0, None))
        axes.grid(alpha=0.3)
        axes.legend()
        figure.savefig(self.out / "clients.svg")


if __name__ == "__main__":
    tyro.cli(Clients)()
