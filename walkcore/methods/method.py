"""The interface of a method that decides without a QP: from a situation to CoPs and footholds."""

from dataclasses import dataclass
from typing import Protocol

from walkcore.methods.situation import Situation
from walkcore.values import Matrix, Vector


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """The decision of one tick."""

    cop: Vector
    """CoP at the end of the tick, in the soles that carry the robot then [m], shape (2,)."""
    cops: Matrix
    """CoPs that follow from it at the samples of the horizon [m], shape (N, 2): a forecast, which nothing holds to."""
    steps: Situation
    """The situation with the footholds that are decided."""


class Method(Protocol):
    """A control law that remembers nothing: what it needs of the past is in the state of the CoM and of the feet."""

    def decide(self, now: Situation, tick: float, times: Vector) -> Decision:
        """The decision of one tick.

        Args:
            now: the situation, after any push.
            tick: duration of the tick [s].
            times: of the samples of the horizon, from now [s], shape (N,).
        """
        ...
