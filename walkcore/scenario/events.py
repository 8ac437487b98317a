"""Events of a scripted walk, and the commands that follow from them tick by tick."""

import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from walkcore.command import Command, Push, Reference
from walkcore.parameters import Parameters


@dataclass(frozen=True, slots=True, eq=False)
class Event:
    """Changes at one time. The reference and the parameters hold until the next event that has some."""

    t: float
    """Time from the beginning of the scenario [s]."""
    reference: Reference | None = None
    over: float = 0.0
    """Duration in which the reference gets there, in a straight line from the one before; zero at once [s]."""
    push: Push | None = None
    parameters: Parameters | None = None
    """All parameters, from then on."""
    solves_in_time: int | None = None
    """Solves that this one tick of a live walk had the time for, see `stages.CountedTime`; None for all."""

    def tick(self, control_period: float) -> int:
        """The first tick of the scenario that is not before the event.

        Args:
            control_period: duration of a tick [s].
        """
        return math.ceil(self.t / control_period - 1e-6)


@dataclass(frozen=True, slots=True)
class Ramp:
    """A reference on its way from one to another; a step where it takes no ticks."""

    start: Reference
    goal: Reference
    begin: int
    """Tick."""
    nb_ticks: int

    def at(self, tick: int) -> Reference:
        """The reference at a tick from the beginning on."""
        if tick >= self.begin + self.nb_ticks:
            return self.goal
        share = (tick - self.begin) / self.nb_ticks
        a, b = self.start, self.goal
        return Reference(
            a.vx + share * (b.vx - a.vx),
            a.vy + share * (b.vy - a.vy),
            a.yaw_rate + share * (b.yaw_rate - a.yaw_rate),
        )


def commands(events: Sequence[Event], nb_ticks: int, control_period: float) -> Iterator[Command]:
    """One command a tick. Of several pushes within one tick, all are given, one a tick.

    Args:
        events: in the order of their times.
        nb_ticks: commands wanted.
        control_period: [s].
    """
    waiting, pushes = deque(events), deque[Push]()
    ramp = Ramp(Reference(), Reference(), 0, 0)
    for tick in range(nb_ticks):
        while waiting and waiting[0].tick(control_period) <= tick:
            event = waiting.popleft()
            if event.reference is not None:
                ramp = Ramp(ramp.at(tick), event.reference, tick, round(event.over / control_period))
            if event.push is not None:
                pushes.append(event.push)
        yield Command(ramp.at(tick), pushes.popleft() if pushes else None)
