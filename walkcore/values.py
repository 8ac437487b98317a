"""Arrays and numbers that may cross threads: copied, checked, read-only."""

import math
import numbers
from collections.abc import Collection, Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from walkcore.errors import InvalidValueError

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
FLOAT = np.dtype(np.float64)
MAX_TICK = 10**9
FARTHEST = 1e5  # [m] from the origin


def frozen_copy(array: ArrayLike, shape: tuple[int, ...] | None = None) -> Vector:
    """`array` in double precision, as a copy that nobody can write to, unless it is one already.

    Raises:
        ValueError: if the shape is another one.
    """
    is_frozen = isinstance(array, np.ndarray) and array.dtype is FLOAT and not array.flags.writeable
    copy = cast(Vector, array) if is_frozen else np.array(array, dtype=FLOAT)
    if shape is not None and copy.shape != shape:
        raise ValueError(f"shape {copy.shape} instead of {shape}")
    copy.flags.writeable = False
    return copy


def freeze(array: Vector) -> Vector:
    """The array itself, read-only from now on; only for an array that nobody else holds.

    Args:
        array: of any shape.
    """
    array.flags.writeable = False
    return array


def check_range(field: str, value: object, low: float = -math.inf, high: float = math.inf) -> float:
    """`value` as a float, if it is finite and within [low, high].

    Args:
        field: its name in the error.
        value: whatever came from outside.
        low: least value.
        high: largest value.

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


def check_whole(field: str, value: object, low: int, high: int) -> int:
    """`value` as an int, if it is a whole number within [low, high].

    Raises:
        InvalidValueError: if it is not.
    """
    if isinstance(value, bool) or not isinstance(value, int):
        raise InvalidValueError(field, value, "must be a whole number")
    if not low <= value <= high:
        raise InvalidValueError(field, value, f"must lie in [{low}, {high}]")
    return value


def check_vector(field: str, value: object, size: int, low: float = -math.inf, high: float = math.inf) -> Vector:
    """`value` as a read-only array, if it is a list of finite numbers within [low, high].

    Args:
        field: its name in the error.
        value: whatever came from outside.
        size: number of components.
        low: least value of each.
        high: largest value of each.

    Raises:
        InvalidValueError: naming the component that is not.
    """
    if not isinstance(value, list | tuple) or len(cast(Sequence[Any], value)) != size:
        raise InvalidValueError(field, cast(object, value), f"must be a list of {size} numbers")
    components = enumerate(cast(Sequence[Any], value))
    return frozen_copy([check_range(f"{field}[{i}]", component, low, high) for i, component in components])


def check_choice(field: str, value: object, choices: Collection[str]) -> str:
    """`value`, if it is one of some texts.

    Raises:
        InvalidValueError: naming them, if it is not.
    """
    if not isinstance(value, str) or value not in choices:
        raise InvalidValueError(field, value, f"must be one of {', '.join(choices)}")
    return value


def check_flag(field: str, value: object) -> bool:
    """`value`, if it is true or false.

    Raises:
        InvalidValueError: if it is not.
    """
    if not isinstance(value, bool):
        raise InvalidValueError(field, value, "must be true or false")
    return value


def check_text(field: str, value: object) -> str:
    """`value`, if it is text that a file can hold.

    Raises:
        InvalidValueError: if it is not.
    """
    if not isinstance(value, str):
        raise InvalidValueError(field, value, "must be text")
    try:
        value.encode()
    except UnicodeEncodeError as error:
        raise InvalidValueError(field, ascii(value), "must be Unicode without lone surrogates") from error
    return value


def check_mapping(field: str, value: object) -> dict[str, Any]:
    """`value` as a dictionary with text for keys, if it is a mapping.

    Raises:
        InvalidValueError: if it is not.
    """
    if not isinstance(value, Mapping):
        raise InvalidValueError(field, value, "must be a mapping")
    return {str(key): item for key, item in cast(Mapping[Any, Any], value).items()}


def check_keys(what: str, given: Mapping[str, Any], known: set[str]) -> None:
    """Refuse keys that nobody reads.

    Raises:
        InvalidValueError: naming the first unknown key and those there are.
    """
    for key in given:
        if key not in known:
            raise InvalidValueError(f"{what}.{key}", given[key], f"unknown; one of {', '.join(sorted(known))}")


def check_complete(what: str, value: object, keys: Collection[str]) -> dict[str, Any]:
    """`value` as a dictionary, if it is a mapping that has all of the keys and no other.

    Raises:
        InvalidValueError: naming the first unknown or missing key.
    """
    values = check_mapping(what, value)
    check_keys(what, values, set(keys))
    for key in keys:
        if key not in values:
            raise InvalidValueError(f"{what}.{key}", None, "is missing")
    return values


def check_list(field: str, value: object, longest: int) -> list[Any]:
    """`value`, if it is a list of at most so many items.

    Raises:
        InvalidValueError: if it is not.
    """
    if not isinstance(value, list) or len(cast(list[Any], value)) > longest:
        raise InvalidValueError(field, cast(object, value), f"must be a list of at most {longest}")
    return cast(list[Any], value)


def rotation(yaw: float) -> Matrix:
    """Rotation in the plane, R_world_foot of a foot with that yaw, shape (2, 2).

    Args:
        yaw: counter-clockwise [rad].
    """
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s], [s, c]])
