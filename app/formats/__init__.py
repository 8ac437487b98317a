"""The files that a recording can be written to, by their endings.

Each module of a format loads libraries that take a while, so it is imported when it is first used.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from walkcore import Recording


@dataclass(frozen=True, slots=True)
class Format:
    """One kind of file."""

    ending: str
    media_type: str
    description: str
    write: Callable[[Recording, str, Path], None]
    """A recording and the text of its run.json, which some formats carry, to a path whose folder exists.

    The same recording gives the same bytes.
    """

    @property
    def file(self) -> str:
        """Name in the folder of a run."""
        return f"recording.{self.ending}"


def write_run(recording: Recording, folder: Path, formats: tuple[str, ...] = ("npz", "csv")) -> None:
    """Write run.json and the recording in some formats into a folder, which is made if need be."""
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
    from app.viewer.scene.replay import replay_page

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
