"""Lease of the controls: one browser drives alone, hands over to another, and loses the lease when it is absent.

Without a lease the last one to take hold drives, as always. The lease keeps people who share a robot out of each
other's way; it does not protect from one of them, as the names of browsers are no secret.
"""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

ABSENCE_TIMEOUT = 30.0  # [s] without a command after which a holder counts as absent


class LeaseHeldError(Exception):
    """Another browser drives alone."""

    def __init__(self, expires_in: float) -> None:
        super().__init__(f"another browser drives alone; it loses that after {expires_in:.0f} s without a command")


class DriverLease:
    """The right to drive alone. Belongs to the server; any thread may ask who has it."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Start without a holder.

        Args:
            clock: gives the time, which only goes forward [s].
        """
        self._clock = clock
        self._holder, self._last_command = "", 0.0
        self._present = Counter[str]()

    @property
    def holder(self) -> str:
        """Name of the browser that drives alone, "" where none does."""
        return self._holder if self.expires_in > 0.0 else ""

    @property
    def expires_in(self) -> float:
        """Time until the holder counts as absent [s]; zero without a holder."""
        return max(0.0, self._last_command + ABSENCE_TIMEOUT - self._clock()) if self._holder else 0.0

    @property
    def clients(self) -> list[str]:
        """Names of the browsers whose controls are connected, to which a lease can be given."""
        return sorted(self._present)

    @contextmanager
    def present(self, client: str) -> Iterator[None]:
        """Count a browser's controls as connected meanwhile."""
        self._present[client] += 1
        try:
            yield
        finally:
            self._present[client] -= 1
            if not self._present[client]:
                del self._present[client]

    def give(self, client: str, by: str) -> None:
        """Let one browser drive alone.

        Args:
            client: its name.
            by: name of the browser that gives it, the holder if there is one.

        Raises:
            LeaseHeldError: if another one holds it.
        """
        self.check(by)
        self._holder, self._last_command = client, self._clock()

    def end(self, by: str) -> None:
        """Let everybody drive again; see `give`."""
        self.check(by)
        self._holder = ""

    def check(self, client: str) -> None:
        """Note that a browser commands, or refuse.

        Raises:
            LeaseHeldError: if another one drives alone.
        """
        holder = self.holder
        if holder == client:
            self._last_command = self._clock()
        elif holder:
            raise LeaseHeldError(self.expires_in)
