"""Arrays and numbers that may cross threads: copied, checked, read-only."""

import math
import numbers
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from walkcore.errors import InvalidValueError

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


def read_only(array: ArrayLike, shape: tuple[int, ...] | None = None) -> Vector:
    """A copy of `array` in double precision that nobody can write to.

    Raises:
        ValueError: if the shape is not the one asked for.
    """
    copy = np.array(array, dtype=np.float64)
    if shape is not None and copy.shape != shape:
        raise ValueError(f"shape {copy.shape} instead of {shape}")
    copy.flags.writeable = False
    return copy


def check_range(field: str, value: object, low: float = -math.inf, high: float = math.inf) -> float:
    """`value` as a float, if it is finite and within [low, high].

    Raises:
        InvalidValueError: if it is not; NaN and infinities never pass.
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Real) or not _is_finite(value):
        raise InvalidValueError(field, value, "must be a finite number")
    number = float(value)
    if not low <= number <= high:
        raise InvalidValueError(field, value, f"must lie in [{low:g}, {high:g}]")
    return number


def _is_finite(value: numbers.Real) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond the largest double
        return False


def check_keys(what: str, given: Mapping[str, Any], known: set[str]) -> None:
    """Refuse keys that nobody reads.

    Raises:
        InvalidValueError: naming the first unknown key and those there are.
    """
    for key in given:
        if key not in known:
            raise InvalidValueError(f"{what}.{key}", given[key], f"unknown; one of {', '.join(sorted(known))}")


def rotation(yaw: float) -> Matrix:
    """Rotation in the plane by `yaw` [rad], shape (2, 2): R_world_foot of a foot with that yaw."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s], [s, c]])
