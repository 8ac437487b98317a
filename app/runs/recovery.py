"""Recovery of runs: each is set right by its row and its folder, whatever moment a server died at.

A folder with run.json is complete; one without it is being removed.
"""

import json
import logging
import math
import re
import shutil
import time
from collections.abc import Container, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.runs.database import ROW_BROKEN
from app.runs.run import Run, RunProgress

logger = logging.getLogger(__name__)

SERVER_DIED = "the server ended while it ran"
FILES_GONE = "its files are gone"


def corrected(runs: Mapping[str, Run], done: Path, own: Container[str]) -> tuple[dict[str, Run], int]:
    """The runs whose rows do not say what their folders say, as they should be. Folders that are no run's are removed.

    Args:
        runs: of the rows, by their ids.
        done: folder with a folder for each run that is done.
        own: ids of runs that this server has changed, and knows better.

    Returns:
        The runs to be corrected by their ids, and the number of those that only their folders tell of.
    """
    right: dict[str, Run] = {}
    for run in runs.values():
        if run.id in own:
            continue
        found = found_run(done / run.id) if run.status == "running" or run.reason == ROW_BROKEN else None
        if found is not None:
            right[run.id] = replace(found, created=run.created or found.created)
        elif run.status == "running":
            right[run.id] = replace(run, status="failed", reason=SERVER_DIED, ended=time.time())
        elif run.size > 0 and not (done / run.id / "run.json").is_file():
            right[run.id] = replace(run, status="failed", reason=FILES_GONE, size=0)
    strays = [f for f in done.iterdir() if f.name not in runs and f.name not in own] if done.is_dir() else []
    nb_found = 0
    for folder in strays:
        if not (folder / "run.json").exists():
            shutil.rmtree(folder, ignore_errors=True)
        elif (run := found_run(folder)) is not None:
            right[run.id] = run
            nb_found += 1
    return right, nb_found


def found_run(folder: Path) -> Run | None:
    """The run that the files of a folder tell of; None where they are not complete."""
    if not re.fullmatch("[0-9a-f]{32}", folder.name):
        return None
    try:
        run_json = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        scenario, ended = run_json["scenario"], (folder / "run.json").stat().st_mtime
        return Run(
            id=folder.name,
            source={**scenario, "name": str(scenario.get("name", "unnamed"))},
            robot=str(run_json["parameters"]["robot"]),
            duration=float(scenario["duration"]),
            created=ended,
            ended=ended,
            progress=RunProgress(1.0),
            size=folder_size(folder),
            **outcome(folder),
        )
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        logger.warning("the files in %s cannot be read as a run: %s", folder, error)
        return None


def outcome(folder: Path) -> dict[str, Any]:
    """Status, reason and metrics of a run, as its run.json tells."""
    run_json = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    broken = [_broken(verdict) for verdict in run_json["expectations"] if not verdict["holds"]]
    return {
        "status": "failed" if broken else "done",
        "reason": "; ".join(broken),
        "metrics": _finite(run_json["metrics"]),
    }


def folder_size(folder: Path) -> int:
    """Size of the files in a folder [bytes]; zero where there is none."""
    return sum(file.stat().st_size for file in folder.iterdir()) if folder.is_dir() else 0


def _broken(verdict: Mapping[str, Any]) -> str:
    measured = "not measured in this run" if verdict["measured"] is None else f"measured {verdict['measured']}"
    return f"expected {verdict['name']}: {verdict['bound']}, {measured}"


def _finite(value: Any) -> Any:
    """Plain values with None in place of numbers that JSON cannot carry."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
