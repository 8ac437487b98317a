"""Robots, scenarios, sweeps and lessons as files: those that ship by their names, any other by its path."""

from collections.abc import Mapping
from contextlib import suppress
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from walkcore.errors import UnknownNameError


def shipped_files(folder: str) -> dict[str, Traversable]:
    """Files of a folder of this package by their names without ending, in the order of the names."""
    entries = [Path(str(entry)) for entry in (files("walkcore") / folder).iterdir()]
    return {path.stem: path for path in sorted(entries, key=lambda path: path.stem) if path.suffix in (".yaml", ".md")}


def named_file(kind: str, name_or_path: str | Path, named: Mapping[str, Traversable]) -> Traversable:
    """The file of a name, else that of a path.

    Args:
        kind: what it describes, for messages.
        name_or_path: one of the names, or the path of any other file.
        named: files by their names.

    Raises:
        UnknownNameError: if there is neither.
    """
    name, path = str(name_or_path), Path(name_or_path)
    if name in named:
        return named[name]
    if is_file(path):
        return path
    raise UnknownNameError(kind, name, named)


def is_file(path: Path) -> bool:
    """Whether there is a file of that path."""
    with suppress(OSError, ValueError):  # of what can be no path, such as a thousand letters
        return path.is_file()
    return False
