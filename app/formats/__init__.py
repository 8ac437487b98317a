"""Files of a run: the formats that a recording can be written to, by their endings, and the folder that holds them.

Each format that needs libraries has a module of its own, imported when it is first used, since they take a while to
load.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from app.formats.stored_run import StoredRun, as_written, read_run
from walkcore import Recording

__all__ = ["COUNTS", "FORMATS", "Format", "StoredRun", "as_written", "read_run", "unit", "write_run"]

# Units of the columns, for formats that carry them: that of the first pattern that a name matches.
UNITS = (
    (r"(tick|phase|support_side|samples_on_support|steps_to_stand|(twin_)?status)", ""),
    (r"(twin_)?q_(commanded_)?[3-6]", ""),
    (r"(twin_)?q_(commanded_)?[0-2]", "m"),
    (r"(twin_)?q_(commanded_)?\d+", "rad"),
    (r"(t|time_to_touchdown|(next_)?step_duration)", "s"),
    (r"push_[xy]", "N s"),
    (r"reference_yaw_rate", "rad/s"),
    (r"((measured_)?com|reference)_v[xy]", "m/s"),
    (r"(left|right)_force", "N"),
    (r"com_a[xy]", "m/s^2"),
    (r"jerk_[xy]", "m/s^3"),
    (r".*_yaw", "rad"),
    (r".*_[xyz]", "m"),
)
COUNTS = frozenset({"tick", "phase", "support_side", "samples_on_support", "steps_to_stand", "status"})
"""Columns of whole numbers."""


def unit(column: str) -> str:
    """Unit of a column; empty for counts, codes and quaternions."""
    return next(unit for pattern, unit in UNITS if re.fullmatch(pattern, column))


@dataclass(frozen=True, slots=True)
class Format:
    """One kind of file."""

    ending: str
    media_type: str
    description: str
    write: Callable[[Recording, str, Path], None]
    """Writes a recording and the text of its run.json, which some formats carry, to a path whose folder exists.

    The same recording gives the same bytes.
    """

    @property
    def file(self) -> str:
        """Name in the folder of a run."""
        return f"recording.{self.ending}"


def write_run(recording: Recording, folder: Path, formats: tuple[str, ...] = ("npz", "csv")) -> None:
    """Write the files of a run into a folder.

    Args:
        recording: of the run.
        folder: for run.json and the recording; made if need be.
        formats: endings of the recording's files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    run_json = recording.run_json()
    for ending in formats:
        FORMATS[ending].write(recording, run_json, folder / FORMATS[ending].file)
    (folder / "run.json").write_text(run_json, encoding="utf-8")


def _write_npz(recording: Recording, _: str, path: Path) -> None:
    recording.write_npz(path)


def _write_csv(recording: Recording, _: str, path: Path) -> None:
    recording.write_csv(path)


def _write_parquet(recording: Recording, run_json: str, path: Path) -> None:
    from app.formats.parquet_file import write

    write(recording, run_json, path)


def _write_mcap(recording: Recording, run_json: str, path: Path) -> None:
    from app.formats.mcap_file import write

    write(recording, run_json, path)


def _write_html(recording: Recording, _: str, path: Path) -> None:
    from app.viewer.replay_page import replay_page

    path.write_text(replay_page(recording), encoding="utf-8")


FORMATS = MappingProxyType(
    {
        format.ending: format
        for format in (
            Format("npz", "application/octet-stream", "NumPy: one array a column", _write_npz),
            Format("csv", "text/csv", "one line a tick", _write_csv),
            Format("parquet", "application/vnd.apache.parquet", "for pandas, polars, DuckDB", _write_parquet),
            Format("mcap", "application/octet-stream", "for Foxglove", _write_mcap),
            Format("html", "text/html", "a replay in 3-D that needs no server", _write_html),
        )
    }
)
