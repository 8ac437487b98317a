"""The time line of the live walk: which ticks can be looked at, and marks where something happened."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Literal

from walkcore import Command, Parameters, Snapshot
from walkcore.mpc.plan import Status

MAX_MARKS = 300  # of the latest; a push that is held is one
GOES_ON = 0.1  # [s] within which pushes belong together

MarkKind = Literal["push", "fall", "change", "fork"]


@dataclass(frozen=True, slots=True)
class Mark:
    """Something that happened at a tick."""

    tick: int
    kind: MarkKind
    text: str


@dataclass(frozen=True, slots=True)
class Timeline:
    """The ticks of the present walk that are kept."""

    walk: int
    """Number of the walk: another one after each reset and each fork."""
    first_tick: int
    last_tick: int
    control_period: float
    """[s]"""
    marks: tuple[Mark, ...]


class Marks:
    """Marks of the present walk, taken tick by tick."""

    def __init__(self) -> None:
        """Begin without any."""
        self._marks: deque[Mark] = deque(maxlen=MAX_MARKS)
        self._pushed_at = -math.inf
        self._was_up = True

    def update(self, command: Command, snapshot: Snapshot) -> None:
        """Mark what happened at a tick."""
        if command.push is not None:
            if snapshot.t > self._pushed_at + GOES_ON:
                self._add(snapshot.tick, "push", f"push of {math.hypot(*command.push.impulse):.1f} N s")
            self._pushed_at = snapshot.t
        is_up = snapshot.status is not Status.FALLEN
        if self._was_up and not is_up:
            self._add(snapshot.tick, "fall", f"fall: {snapshot.reason}" if snapshot.reason else "fall")
        self._was_up = is_up

    def change(self, tick: int, before: Parameters, after: Parameters) -> None:
        """Mark that other parameters are in force from a tick on."""
        old, new = before.to_mapping(), after.to_mapping()
        changed = ", ".join(f"{name} {value}" for name, value in new.items() if value != old.get(name))
        self._add(tick, "change", changed or "parameters")

    def forked(self, tick: int) -> "Marks":
        """The marks before a tick, and one that the walk went on from there."""
        marks = Marks()
        marks._marks.extend(mark for mark in self._marks if mark.tick < tick)
        marks._was_up = not any(mark.kind == "fall" for mark in marks._marks)
        marks._add(tick, "fork", "went on from here")
        return marks

    def since(self, tick: int) -> tuple[Mark, ...]:
        """The marks from a tick on."""
        return tuple(mark for mark in self._marks if mark.tick >= tick)

    def _add(self, tick: int, kind: MarkKind, text: str) -> None:
        self._marks.append(Mark(tick, kind, text[:200]))
