"""Which foot carries the robot at each sample of the horizon.

    Zref = Uc f_support + U f      (20)-(21)

Uc and U of (22) only say which sample falls into which step. Samples lie on the
gait's own grid, T apart; a step begins at its foot's touchdown with a double
support of one period, then the other foot swings. A sample at the touchdown itself
still belongs to the step that ends, whose constraint is the stricter one (section 4).
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from walkcore.parameters import Parameters
from walkcore.values import Matrix, Vector, read_only


class Side(IntEnum):
    """Of a foot; numbered as in a recording."""

    LEFT = 0
    RIGHT = 1

    @property
    def other(self) -> "Side":
        """The opposite side."""
        return Side(1 - self)

    @property
    def sign(self) -> int:
        """+1 for left, -1 for right: the direction of y on which that foot lies."""
        return 1 - 2 * self


class Phase(IntEnum):
    """Of the gait; numbered as in a recording."""

    STANDING = 0
    DOUBLE_SUPPORT = 1
    SINGLE_SUPPORT = 2


@dataclass(frozen=True, slots=True, eq=False)
class Footstep:
    """Place of a sole on the ground, in the world frame."""

    side: Side
    position: Vector
    """Origin of the sole frame [m], shape (2,)."""
    yaw: float
    """[rad]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", read_only(self.position, shape=(2,)))


@dataclass(frozen=True, slots=True, eq=False)
class Horizon:
    """The supports of the samples to come, as seen from one tick."""

    ticks_to_sample: int
    """From the present to the first sample; the others follow T apart."""
    foot: NDArray[np.int64]
    """What carries each sample, shape (N,): 0 the present support foot, k the k-th foothold to come."""
    is_on_both: NDArray[np.bool_]
    """Whether both feet carry a sample, shape (N,): the support foot and the one that has not left the ground."""
    time_to_touchdown: float
    """From the present to the next touchdown [s]."""

    @property
    def nb_footholds(self) -> int:
        """m, footholds to come on which some sample stands."""
        return int(self.foot[-1])

    @property
    def nb_samples_on_support(self) -> int:
        """Samples that the present support foot carries alone."""
        return int(np.count_nonzero((self.foot == 0) & ~self.is_on_both))

    @property
    def support_selection(self) -> Vector:
        """Uc of (22), shape (N,)."""
        return (self.foot == 0).astype(float)

    @property
    def foothold_selection(self) -> Matrix:
        """U of (22), shape (N, m)."""
        return (self.foot[:, None] == np.arange(1, self.nb_footholds + 1)).astype(float)


@dataclass(frozen=True, slots=True)
class Gait:
    """Alternating steps on the grid, after a stand on both feet."""

    parameters: Parameters
    first_support: Side = Side.LEFT
    """Foot that carries the first step."""

    @property
    def _start(self) -> int:
        """Sample at which the first step begins."""
        return self.parameters.samples_before_first_step

    def _step(self, tick: int) -> int:
        """Index of the step under way; negative while standing."""
        sample = tick // self.parameters.ticks_per_sample
        return (sample - self._start) // self.parameters.samples_per_step if sample >= self._start else -1

    def _ticks_into_step(self, tick: int) -> int:
        p = self.parameters
        first_tick = (self._start + max(self._step(tick), 0) * p.samples_per_step) * p.ticks_per_sample
        return tick - first_tick

    def phase(self, tick: int) -> Phase:
        """Which feet are on the ground."""
        if self._step(tick) < 0:
            return Phase.STANDING
        in_double_support = self._ticks_into_step(tick) < self.parameters.ticks_per_sample
        return Phase.DOUBLE_SUPPORT if in_double_support else Phase.SINGLE_SUPPORT

    def support_side(self, tick: int) -> Side:
        """The foot that carries the robot; while standing, the one that will carry the first step."""
        is_other = max(self._step(tick), 0) % 2 == 1
        return self.first_support.other if is_other else self.first_support

    def is_touchdown(self, tick: int) -> bool:
        """Whether a foot lands at this tick."""
        return self._step(tick) > 0 and self._ticks_into_step(tick) == 0

    def time_to_touchdown(self, tick: int) -> float:
        """Until the foot in the air, or the next one to leave the ground, lands [s]."""
        p = self.parameters
        return (p.samples_per_step * p.ticks_per_sample - self._ticks_into_step(tick)) * p.control_period

    def swing_progress(self, tick: int) -> float:
        """Fraction of the single support that has passed, in [0, 1]."""
        p = self.parameters
        swing_ticks = (p.samples_per_step - 1) * p.ticks_per_sample
        return max(self._ticks_into_step(tick) - p.ticks_per_sample, 0) / swing_ticks

    def horizon(self, tick: int) -> Horizon:
        """The supports of the N samples that follow `tick`."""
        p = self.parameters
        present = tick // p.ticks_per_sample
        samples = np.arange(present + 1, present + p.horizon_samples + 1)
        step = np.maximum((samples - self._start - 1) // p.samples_per_step, 0)
        return Horizon(
            ticks_to_sample=(present + 1) * p.ticks_per_sample - tick,
            foot=step - max(self._step(tick), 0),
            is_on_both=samples <= self._start,
            time_to_touchdown=self.time_to_touchdown(tick),
        )
