"""Durations of something that was done many times."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Durations:
    """Summed up [us]."""

    median: float
    p99: float
    max: float

    @classmethod
    def of(cls, seconds: Iterable[float]) -> "Durations":
        """Sum up durations [s], one or more."""
        us = 1e6 * np.array(list(seconds))
        return cls(float(np.median(us)), float(np.percentile(us, 99)), float(np.max(us)))
