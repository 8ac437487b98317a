"""Growth of a tick, a drawn frame and the server's load with the number of browsers: `clients.py --out DIR`.

Measured on a served robot that walks, each browser with both of its streams, by `deadlines.py`.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import deadlines
import matplotlib.pyplot as plt
import tyro
from empty_loop import empty_loop


@dataclass(frozen=True, slots=True)
class Clients:
    """Measure for some numbers of browsers."""

    out: Path
    """Folder for clients.json and clients.svg."""
    numbers: tuple[int, ...] = (1, 5, 20)
    seconds: float = 30.0
    """Duration of each measurement [s]."""

    def __call__(self) -> None:
        """Measure, write and draw."""
        found = [self._measured(number) for number in self.numbers]
        self.out.mkdir(parents=True, exist_ok=True)
        (self.out / "clients.json").write_text(json.dumps(found, indent=2) + "\n")
        self._draw(found)

    def _measured(self, number: int) -> dict[str, Any]:
        with deadlines.server("talos") as url, deadlines.crowd(url, number), empty_loop() as empty:
            found = deadlines.measured(url, number, self.seconds, empty)
        print(deadlines.table(found), flush=True)
        return found

    def _draw(self, found: list[dict[str, Any]]) -> None:
        figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
        axes.plot(self.numbers, [one["frame_ms"] for one in found], "o-", label="a drawn frame, for all browsers [ms]")
        axes.plot(self.numbers, [one["last"]["tick_ms"] for one in found], "s-", label="a tick of the robot [ms]")
        axes.plot(self.numbers, [one["cpu"]["server"] for one in found], "^--", label="the server [share of a core]")
        axes.set(xlabel="browsers", xticks=self.numbers, ylim=(0.0, None))
        axes.grid(alpha=0.3)
        axes.legend()
        figure.savefig(self.out / "clients.svg")


if __name__ == "__main__":
    tyro.cli(Clients)()
