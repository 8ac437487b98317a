"""Measurements of what a tick costs: `bench` of all of it, `solvers` of the QPs alone."""

from app.bench.bench import Bench, bench, table

__all__ = ["Bench", "bench", "table"]
