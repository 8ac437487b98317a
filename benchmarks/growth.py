"""Growth of a tick with the horizon: `growth.py --out DIR` writes growth.json and growth.svg.

Two steps of 0.8 s do not fit into 8 samples, so the steps take 0.7 s at all lengths.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib.pyplot as plt
import tyro

from app.bench.bench import by_stage, laps
from walkcore import load_scenario
from walkcore.mpc.qp import SOLVERS

HORIZONS = (8, 16, 32, 64)
STAGES = ("gait", "assemble", "solve", "check", "snapshot", "swing_foot")


@dataclass(frozen=True, slots=True)
class Growth:
    """Measure the stages of a tick of Talos's point mass, for N = 8 to 64 and each solver."""

    out: Path
    """Folder for growth.json and growth.svg."""
    duration: float = 8.0
    """Duration of each walk [s]."""

    def __call__(self) -> None:
        """Measure, write and draw."""
        medians = {solver: {N: self._medians(solver, N) for N in HORIZONS} for solver in SOLVERS}
        self.out.mkdir(parents=True, exist_ok=True)
        (self.out / "growth.json").write_text(json.dumps(medians, indent=2) + "\n")
        figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
        for solver, found in medians.items():
            axes.loglog(HORIZONS, [found[N]["solve"] for N in HORIZONS], "o-", label=f"solve, {solver}")
        for stage in ("assemble", "swing_foot"):
            axes.loglog(HORIZONS, [medians["piqp"][N][stage] for N in HORIZONS], "s--", label=stage)
        axes.set(xlabel="samples of the horizon N", ylabel="median [us]", xticks=HORIZONS, xticklabels=HORIZONS)
        axes.minorticks_off()
        axes.grid(alpha=0.3)
        axes.legend()
        figure.savefig(self.out / "growth.svg")

    def _medians(self, solver: str, N: int) -> dict[str, float]:
        motion = load_scenario("herdt-2010-section-6").without_body()
        timing = replace(motion.parameters, step_duration=0.7, horizon_samples=N, solver=solver)
        scenario = replace(motion, parameters=timing, duration=self.duration)
        medians = {stage: found.median for stage, found in by_stage(laps(scenario)).items()}
        print(f"{solver} N = {N}: " + ", ".join(f"{stage} {medians[stage]:.0f} us" for stage in STAGES))
        return medians


if __name__ == "__main__":
    tyro.cli(Growth)()
