"""Recordings from anywhere: columns and run.json of a file that somebody else wrote, within bounds.

    .npz      one array a column; read without NumPy's loader, which believes what the file says of its own size
    .csv      names of the columns, then a line for each tick
    .parquet  columns, and run.json in its metadata
    .mcap     `/walk/row`, and run.json attached
    .zip      a folder of a run: a recording in one of these formats, and run.json

What a file is is told by its first bytes. Sizes are checked before anything of that size is read. A compressed file
may still be more than it says: whoever reads one does it in a process whose memory and time are limited.
"""

import json
import math
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from app.formats.parquet_file import RUN
from walkcore.errors import InvalidValueError, WalkError
from walkcore.values import Vector

MAX_COLUMNS = 600  # a body with 40 joints in physics beside a twin has 220
MAX_HEADER = 10_000  # bytes of the header of an array
MAX_RUN_JSON = 4_000_000  # bytes: a minute that was driven by a stick has 2 MB
MAX_LINE = 40 * MAX_COLUMNS  # characters of a line of text
ZIP, PARQUET, MCAP = b"PK\x03\x04", b"PAR1", b"\x89MCAP0\r\n"
RECORDINGS = (".npz", ".parquet", ".mcap", ".csv")
RUN_JSON = "run.json"
TOPIC = "/walk/row"
KINDS = "must be a recording as .npz, .csv, .parquet or .mcap, or a .zip of one with its run.json"
BROKEN = (OSError, ValueError, EOFError, LookupError, RuntimeError, NotImplementedError, zlib.error, zipfile.BadZipFile)
"""Raised by the readers of broken files; encrypted ones and methods that Python does not know are among them."""


@dataclass(frozen=True, slots=True, eq=False)
class ForeignRecording:
    """Content of a file, of which only the shape is checked."""

    columns: Mapping[str, Vector]
    """Each of shape (ticks,)."""
    run_json: str | None
    """Text of run.json; None of a file without."""


def read_foreign(path: Path, max_ticks: int, max_bytes: int) -> ForeignRecording:
    """The recording in a file.

    Args:
        path: of the file.
        max_ticks: most rows that it may have.
        max_bytes: most bytes that its content may have, unpacked.

    Raises:
        InvalidValueError: naming what is wrong with it.
    """
    limits = _Limits(max_ticks, max_bytes)
    try:
        found = _read(path, limits)
    except WalkError:
        raise
    except BROKEN as error:
        raise InvalidValueError("file", _told(error), f"cannot be read: {KINDS}") from error
    except Exception as error:  # libraries that read Parquet and MCAP have errors of their own
        if type(error).__module__.partition(".")[0] not in ("pyarrow", "mcap", "zstandard", "lz4"):
            raise
        raise InvalidValueError("file", _told(error), f"cannot be read: {KINDS}") from error
    lengths = {len(column) for column in found.columns.values()}
    if len(lengths) > 1:
        raise InvalidValueError("columns", sorted(lengths)[:2], "must have one length")
    if not lengths or lengths == {0}:
        raise InvalidValueError("rows", 0, "must be at least 1")
    limits.check_shape(max(lengths), len(found.columns))
    return found


@dataclass(frozen=True, slots=True)
class _Limits:
    ticks: int
    bytes: int

    def check_shape(self, nb_rows: int, nb_columns: int) -> None:
        if nb_columns > MAX_COLUMNS:
            raise InvalidValueError("columns", nb_columns, f"must be at most {MAX_COLUMNS}")
        if nb_rows > self.ticks:
            raise InvalidValueError("rows", nb_rows, f"must be at most {self.ticks}")

    def check_bytes(self, nb_bytes: int) -> None:
        if nb_bytes > self.bytes:
            raise InvalidValueError("bytes", nb_bytes, f"must be at most {self.bytes}, unpacked")


def _told(error: BaseException) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__


def _read(path: Path, limits: _Limits, is_inside: bool = False) -> ForeignRecording:
    with path.open("rb") as file:
        start = file.read(len(MCAP))
    if start.startswith(ZIP):
        with zipfile.ZipFile(path) as archive:
            return _from_zip(archive, path, limits, is_inside)
    if start.startswith(PARQUET):
        return _from_parquet(path, limits)
    if start.startswith(MCAP):
        return _from_mcap(path, limits)
    return ForeignRecording(_from_csv(path, limits), None)


def _from_zip(archive: zipfile.ZipFile, path: Path, limits: _Limits, is_inside: bool) -> ForeignRecording:
    """The columns of an npz, or a recording with its run.json."""
    members = [member for member in archive.infolist() if not member.is_dir()]
    limits.check_bytes(sum(member.file_size for member in members))
    recordings = [member for member in members if member.filename.endswith(RECORDINGS)]
    if not recordings:
        return ForeignRecording(_from_npz(archive, members, limits), None)
    if is_inside:
        raise InvalidValueError("file", recordings[0].filename[:100], "must not hold an archive in an archive")
    best = min(recordings, key=lambda member: RECORDINGS.index(Path(member.filename).suffix))
    inner = path.with_suffix(".inner")
    inner.write_bytes(_content(archive, best))
    found = _read(inner, limits, is_inside=True)
    inner.unlink()
    beside = next((member for member in members if Path(member.filename).name == RUN_JSON), None)
    return found if beside is None else ForeignRecording(found.columns, _run_json(_content(archive, beside)))


def _content(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> bytes:
    with archive.open(member) as file:
        return file.read(member.file_size)


def _from_npz(archive: zipfile.ZipFile, members: list[zipfile.ZipInfo], limits: _Limits) -> dict[str, Vector]:
    arrays = [member for member in members if member.filename.endswith(".npy")]
    if not arrays:
        raise InvalidValueError("file", [member.filename for member in members[:3]], KINDS)
    limits.check_shape(0, len(arrays))
    columns: dict[str, Vector] = {}
    for member in arrays:
        with archive.open(member) as file:
            columns[member.filename.removesuffix(".npy")] = _array(file, member.filename, limits)
    return columns


def _array(file: IO[bytes], name: str, limits: _Limits) -> Vector:
    """A column; neither its shape nor its type is believed before it was checked, and objects are never unpickled."""
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    version = np.lib.format.read_magic(file)
    if version not in readers:
        raise InvalidValueError(name, version, "must be an array in version 1.0 or 2.0 of NumPy's format")
    shape, _, dtype = readers[version](file, max_header_size=MAX_HEADER)
    if dtype.kind not in "fiu" or dtype.itemsize > 8:
        raise InvalidValueError(name, str(dtype)[:100], "must be numbers of at most 8 bytes")
    if len(shape) != 1:
        raise InvalidValueError(name, shape[:8], "must be one column: an array of one dimension")
    limits.check_shape(shape[0], 0)
    nb_bytes = shape[0] * dtype.itemsize
    data = file.read(nb_bytes)
    if len(data) != nb_bytes:
        raise InvalidValueError(name, len(data), f"must have the {nb_bytes} bytes that its header tells")
    return np.frombuffer(data, dtype).astype(np.float64)


def _from_parquet(path: Path, limits: _Limits) -> ForeignRecording:
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = pq.ParquetFile(path)
    limits.check_shape(file.metadata.num_rows, file.metadata.num_columns)
    groups = [file.metadata.row_group(i) for i in range(file.metadata.num_row_groups)]
    limits.check_bytes(sum(group.total_byte_size for group in groups))
    schema = file.schema_arrow
    for field in schema:
        if not (pa.types.is_floating(field.type) or pa.types.is_integer(field.type)):
            raise InvalidValueError(field.name, str(field.type)[:100], "must be a column of numbers")
    table = file.read()
    columns = {name: _float64(table[name]) for name in schema.names}
    text = (schema.metadata or {}).get(RUN)
    return ForeignRecording(columns, None if text is None else _run_json(text))


def _float64(column: Any) -> Vector:
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)


def _from_mcap(path: Path, limits: _Limits) -> ForeignRecording:
    from mcap.reader import make_reader

    with path.open("rb") as file:
        reader = make_reader(file)
        rows: list[dict[str, Any]] = []
        for _, channel, message in reader.iter_messages(topics=[TOPIC]):
            if channel.message_encoding != "json":
                raise InvalidValueError(TOPIC, channel.message_encoding[:100], "must be encoded as json")
            rows.append(_row(json.loads(message.data)))
            limits.check_shape(len(rows), len(rows[-1]))
        attached = next((each for each in reader.iter_attachments() if each.name == RUN_JSON), None)
    if not rows:
        raise InvalidValueError(TOPIC, 0, "must have messages")
    names = list(dict.fromkeys(name for row in rows for name in row))
    limits.check_shape(len(rows), len(names))
    columns = {name: np.array([row.get(name, math.nan) for row in rows]) for name in names}
    return ForeignRecording(columns, None if attached is None else _run_json(attached.data))


def _row(data: Any) -> dict[str, float]:
    """A message, whose nulls stand for NaN."""
    if not isinstance(data, dict) or len(data) > MAX_COLUMNS:
        raise InvalidValueError(TOPIC, type(data).__name__, f"must be at most {MAX_COLUMNS} numbers by their names")
    values: dict[str, float] = {}
    for name, value in data.items():
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise InvalidValueError(str(name)[:100], type(value).__name__, "must be a number, or null")
        values[name] = math.nan if value is None else float(value)
    return values


def _from_csv(path: Path, limits: _Limits) -> dict[str, Vector]:
    from pyarrow import csv, float64

    with path.open("rb") as file:
        header = file.readline(MAX_LINE)
    names = header.decode("utf-8").strip().split(",")
    if not header.endswith(b"\n") or "tick" not in names or len(set(names)) != len(names):
        raise InvalidValueError("file", header[:60].decode("utf-8", "replace"), KINDS)
    limits.check_shape(0, len(names))
    table = csv.read_csv(
        path,
        csv.ReadOptions(use_threads=False),
        csv.ParseOptions(quote_char=False),
        csv.ConvertOptions(column_types=dict.fromkeys(names, float64()), null_values=["nan", "NaN", ""]),
    )
    return {name: _float64(table[name]) for name in names}


def _run_json(data: bytes) -> str:
    if len(data) > MAX_RUN_JSON:
        raise InvalidValueError(RUN_JSON, len(data), f"must have at most {MAX_RUN_JSON} bytes")
    return data.decode("utf-8")
