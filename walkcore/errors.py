"""Every error that the core raises: one tree under `WalkError`."""

import reprlib
from collections.abc import Iterable

MAX_FIELD = 200  # characters of a field's path in a message
VALUES = reprlib.Repr()  # writes a value that nobody has looked at yet in one line, however long or deep it is
VALUES.maxstring = VALUES.maxother = 200
VALUES.maxlevel = 3


class WalkError(Exception):
    """Base of all errors of the walking core."""


class InvalidValueError(WalkError, ValueError):
    """A value from outside lies beyond its limit; carries field, value and limit."""

    def __init__(self, field: str, value: object, limit: str) -> None:
        super().__init__(f"{_line(field)} = {_shown(value)}: {limit}")
        self.field, self.value, self.limit = field, value, limit

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:  # for the way from one process to another
        return type(self), (self.field, self.value, self.limit)


class UnknownNameError(WalkError, LookupError):
    """A robot, scenario or parameter of that name does not exist; names the choices."""

    def __init__(self, kind: str, name: str, choices: Iterable[str]) -> None:
        self.kind, self.name, self.choices = kind, name, sorted(choices)
        super().__init__(f"no {kind} {_shown(name)}; there are: {', '.join(self.choices)}")

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return type(self), (self.kind, self.name, self.choices)


class EmptyRegionError(WalkError):
    """A polygon has no interior, or none is left inside its margin."""


class NoSolutionFoundError(WalkError):
    """The walking QP has no solution, not even with its soft margins given up."""


class InfeasibleError(NoSolutionFoundError):
    """The solver has found that no point keeps all bounds."""


class OutOfTimeError(WalkError):
    """The time that the caller allows for a tick is over; no plan is found in it."""


class FallError(WalkError):
    """Nothing keeps the robot on its feet; the message says why."""


class InverseKinematicsError(WalkError):
    """The body cannot reach the requested CoM and feet."""


def _line(field: str) -> str:
    """A field's path, whose keys may come from outside, in one line."""
    line = field if field.isprintable() else repr(field)[1:-1]
    return line if len(line) <= MAX_FIELD else line[:MAX_FIELD] + "..."


def _shown(value: object) -> str:
    try:
        return VALUES.repr(value)
    except ValueError:  # more digits than Python writes
        return f"a value of type {type(value).__name__}"
