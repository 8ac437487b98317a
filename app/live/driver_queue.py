"""Queue of visitors who drive in turn: the first of the line drives, the others wait, and each turn has an end.

Visitors drive under one lease, so that nobody else's references come in between; who holds that lease alone already
keeps the visitors waiting. Belongs to the event loop.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from app.live.driver_lease import DriverLease

TURN = 60.0  # [s] of each visitor; without others who wait another one follows
IDLE_TIMEOUT = 15.0  # [s] without a command after which the next one drives, where somebody waits
ABSENCE_TIMEOUT = 60.0  # [s] without a command after which a visitor is gone, though nobody waits
RECONNECT_TIMEOUT = 5.0  # [s] in which a phone may lose its connection and keep its place
MAX_WAITING = 12  # visitors in line, so that nobody waits for longer than people do
LEASE = "booth"  # name under which all visitors hold the lease


class QueueFullError(Exception):
    """The line is as long as it may be."""

    def __init__(self) -> None:
        super().__init__(f"{MAX_WAITING} wait already; try again in a minute")


class NotYourTurnError(Exception):
    """Another visitor drives, or nobody of the line may."""


@dataclass(slots=True)
class _Visitor:
    name: str
    number: int
    gone_at: float | None = None
    """When the last connection was lost [s]; None while there is one."""


class DriverQueue:
    """The line of visitors. Whatever it tells is as of the latest `update`."""

    def __init__(self, lease: DriverLease, clock: Callable[[], float] = time.monotonic) -> None:
        """Start with nobody in line.

        Args:
            lease: of the controls, taken while somebody is in line.
            clock: gives the time, which only goes forward [s].
        """
        self._lease, self._clock = lease, clock
        self._line: list[_Visitor] = []
        self._turn_began = self._last_command = clock()
        self._nb_visitors = 0

    @property
    def driver(self) -> str:
        """Name of the visitor whose turn it is; "" where there is none."""
        return self._line[0].name if self._line else ""

    @property
    def number(self) -> int:
        """Number of the visitor whose turn it is, as `join` gave it; 0 where there is none."""
        return self._line[0].number if self._line else 0

    @property
    def nb_waiting(self) -> int:
        """Visitors in line behind the one that drives."""
        return max(0, len(self._line) - 1)

    @property
    def time_left(self) -> float:
        """Time that is left of the turn [s]; zero without a driver."""
        return max(0.0, self._turn_began + TURN - self._clock()) if self._line else 0.0

    @property
    def is_kept_out(self) -> bool:
        """Whether a browser drives alone, which keeps all visitors waiting."""
        return self._lease.holder not in ("", LEASE)

    def place(self, name: str) -> int | None:
        """Number of visitors before one in the line, 0 for the driver; None for one that is not in it."""
        return next((place for place, visitor in enumerate(self._line) if visitor.name == name), None)

    def join(self, name: str) -> int:
        """Let a visitor stand in line, at its old place if it has one; its number.

        Raises:
            QueueFullError: if there is no room.
        """
        for visitor in self._line:
            if visitor.name == name:
                visitor.gone_at = None
                return visitor.number
        if len(self._line) > MAX_WAITING:
            raise QueueFullError
        self._nb_visitors += 1
        self._line.append(_Visitor(name, self._nb_visitors))
        if len(self._line) == 1:
            self._begin_turn()
        return self._nb_visitors

    def disconnect(self, name: str) -> None:
        """Note that a visitor's connection is lost; it keeps its place for a moment."""
        for visitor in self._line:
            if visitor.name == name:
                visitor.gone_at = self._clock()

    def clear(self) -> None:
        """Send everybody away."""
        self._line.clear()
        self.update()

    def check(self, name: str) -> None:
        """Note that a visitor commands, or refuse.

        Raises:
            NotYourTurnError: if it is not the one that drives.
            LeaseHeldError: if a browser drives alone.
        """
        if name != self.driver:
            raise NotYourTurnError("another one drives")
        self._lease.check(LEASE)
        self._last_command = self._clock()

    def update(self) -> None:
        """Let time pass: end turns, forget who has left, take the lease or give it back.

        Raises:
            LeaseHeldError: if a browser drives alone.
        """
        now, driver = self._clock(), self.driver
        self._line = [v for v in self._line if v.gone_at is None or now - v.gone_at < RECONNECT_TIMEOUT]
        if self.driver == driver and self._line and self._is_over(now):
            self._line.pop(0)
        elif self._line and now - self._turn_began >= TURN:
            self._turn_began = now  # nobody waits
        if self.driver != driver:
            self._begin_turn()
        if self._line:
            self._lease.give(LEASE, LEASE)
        elif self._lease.holder == LEASE:
            self._lease.end(LEASE)

    def _is_over(self, now: float) -> bool:
        idle = now - max(self._last_command, self._turn_began)
        if len(self._line) > 1:
            return now - self._turn_began >= TURN or idle >= IDLE_TIMEOUT
        return now - self._last_command >= ABSENCE_TIMEOUT

    def _begin_turn(self) -> None:
        self._turn_began = self._last_command = self._clock()
