"""A recording that was written, as it was in memory."""

import json
from pathlib import Path

import numpy as np

from walkcore.scenario.recording import Recording
from walkcore.scenario.scenario import scenario_from_mapping


def read_run(folder: Path) -> tuple[Recording, str]:
    """The recording, and the text of run.json; without what the body's joints did, which is summed up in there."""
    run_json = (folder / "run.json").read_text(encoding="utf-8")
    run = json.loads(run_json)
    with np.load(folder / "recording.npz") as columns:
        names = tuple(columns)
        rows = np.column_stack([columns[name] for name in names])
    recording = Recording(
        scenario=scenario_from_mapping(run["scenario"]),
        columns=names,
        rows=rows,
        parameters=run["parameters"],
        parameter_changes=tuple(run["parameter_changes"]),
        reason=run["metrics"]["reason"],
        body_use=None,
    )
    return recording, run_json
