"""A recording that was written, as it was in memory."""

import json
from pathlib import Path

import numpy as np

from walkcore.recording import Recording
from walkcore.scenario import scenario_from_mapping


def read_recording(folder: Path) -> Recording:
    """The recording from recording.npz and run.json; without what the body's joints did, which only metrics need."""
    run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    with np.load(folder / "recording.npz") as columns:
        names = tuple(columns)
        rows = np.column_stack([columns[name] for name in names])
    return Recording(
        scenario=scenario_from_mapping(run["scenario"]),
        columns=names,
        rows=rows,
        parameters=run["parameters"],
        parameter_changes=tuple(run["parameter_changes"]),
        reason=run["metrics"]["reason"],
        body_use=None,
    )
