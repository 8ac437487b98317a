"""The files of a run that is done, by their endings."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Format:
    """One file."""

    ending: str
    file: str
    media_type: str


FORMATS = (
    Format("npz", "recording.npz", "application/zip"),
    Format("csv", "recording.csv", "text/csv; charset=utf-8"),
    Format("json", "run.json", "application/json"),
)
