"""Every error that the core raises: one tree under `WalkError`."""

from collections.abc import Iterable


class WalkError(Exception):
    """Base of all errors of the walking core."""


class InvalidValueError(WalkError, ValueError):
    """A value from outside lies beyond its limit; carries field, value and limit."""

    def __init__(self, field: str, value: object, limit: str) -> None:
        super().__init__(f"{field} = {value!r}: {limit}")
        self.field, self.value, self.limit = field, value, limit

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:  # for the way from one process to another
        return type(self), (self.field, self.value, self.limit)


class UnknownNameError(WalkError, LookupError):
    """A robot, scenario or parameter of that name does not exist; names the choices."""

    def __init__(self, kind: str, name: str, choices: Iterable[str]) -> None:
        self.kind, self.name, self.choices = kind, name, sorted(choices)
        super().__init__(f"no {kind} {name!r}; there are: {', '.join(self.choices)}")

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return type(self), (self.kind, self.name, self.choices)


class EmptyRegionError(WalkError):
    """A polygon has no interior, or none is left inside its margin."""


class NoSolutionFoundError(WalkError):
    """The walking QP has no solution, not even with its soft margins given up."""


class InverseKinematicsError(WalkError):
    """The body cannot reach the requested CoM and feet."""
