"""What a tick costs: by stage, by solver, and against real time."""

from app.bench.bench import Bench, bench
from app.bench.table import table

__all__ = ["Bench", "bench", "table"]
