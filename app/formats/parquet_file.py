"""Parquet: a table with a unit for each column, and run.json in its metadata."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from app.formats import COUNTS, unit
from walkcore import Recording

RUN = b"walk.run.json"


def write(recording: Recording, run_json: str, path: Path) -> None:
    """Write a recording and its run.json."""
    fields = [_field(name) for name in recording.columns]
    columns = [_column(field, recording[field.name]) for field in fields]
    schema = pa.schema(fields, metadata={RUN: run_json.encode()})
    pq.write_table(pa.table(columns, schema=schema), path, compression="zstd")


def _field(name: str) -> pa.Field:
    kind = pa.int64() if name in COUNTS else pa.float64()
    return pa.field(name, kind, metadata={b"unit": unit(name).encode()})


def _column(field: pa.Field, values: np.ndarray) -> pa.Array:
    return pa.array(values.astype(np.int64) if field.name in COUNTS else values, type=field.type, from_pandas=False)
