"""Walk every shipped scenario and hold its recording against one made earlier, byte by byte.

    python benchmarks/same_bytes.py BEFORE      # with the code before a change: writes the recordings
    python benchmarks/same_bytes.py BEFORE      # with the code after it: compares, and exits with 1 at a difference

For changes that must not change a decision. recording.csv holds every bit of every column; of run.json the versions
are left out. A recording is the same on the same machine only: numpy picks its kernels by the processor.
"""

import json
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from app.commands.run_commands import simulate_all
from app.runs.run_jobs import Simulate
from app.settings import usable_cores
from walkcore import load_scenario, scenario_names


def main() -> None:
    """Write the recordings into a folder that is not there yet, or compare with those in it."""
    before = Path(sys.argv[1])
    if not before.exists():
        _walk(before)
        print(f"{len(scenario_names())} recordings written to {before}; run this again after the change")
        return
    with tempfile.TemporaryDirectory() as folder:
        _walk(Path(folder))
        differences = {name: list(_differences(before / name, Path(folder) / name)) for name in scenario_names()}
    for name, found in differences.items():
        print(f"{name:28} {'; '.join(found) if found else 'the same'}")
    sys.exit(any(differences.values()))


def _walk(out: Path) -> None:
    jobs = [Simulate(load_scenario(name).source, out / name) for name in scenario_names()]
    for _, done in simulate_all(jobs, usable_cores(), shows_progress=True):
        done.result()


def _differences(before: Path, after: Path) -> Iterator[str]:
    """Differences between two runs."""
    if not before.is_dir():
        yield "was not there before"
        return
    if (before / "recording.csv").read_bytes() != (after / "recording.csv").read_bytes():
        yield from _different_columns(before, after)
    old, new = (_flat(json.loads((folder / "run.json").read_text())) for folder in (before, after))
    changed = [key for key in old | new if old.get(key) != new.get(key) and not key.startswith("versions")]
    if changed:
        yield f"run.json: {', '.join(changed[:5])}{' ...' if len(changed) > 5 else ''}"


def _different_columns(before: Path, after: Path) -> Iterator[str]:
    with np.load(before / "recording.npz") as old, np.load(after / "recording.npz") as new:
        if set(old) != set(new):
            yield f"columns {sorted(set(old) ^ set(new))}"
        for name in set(old) & set(new):
            if len(old[name]) != len(new[name]):
                yield f"{len(new[name])} ticks instead of {len(old[name])}"
                return
            differs = ~((old[name] == new[name]) | (np.isnan(old[name]) & np.isnan(new[name])))
            if differs.any():
                largest = np.nanmax(np.abs(old[name] - new[name]))
                yield f"{name} from row {int(np.argmax(differs))}, at most {largest:.1e}"


def _flat(value: Any, path: str = "") -> Mapping[str, Any]:
    """Values by their paths."""
    if isinstance(value, dict):
        return {key: item for name, part in value.items() for key, item in _flat(part, f"{path}.{name}").items()}
    return {path.removeprefix("."): value}


if __name__ == "__main__":
    main()
