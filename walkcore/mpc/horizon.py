"""The stances of a horizon: which foot, or feet, carry each of its samples.

    Zref = Uc f_support + U f      (20)-(21)

Uc and U of (22) only say which sample falls into which step. A sample at the touchdown itself still belongs to the
step that ends, whose constraint is the stricter one (section 4).
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from walkcore.values import Matrix


@dataclass(frozen=True, slots=True)
class SampleStance:
    """The stance of one sample, see `StanceSequence`."""

    foot: int
    is_double_support: bool
    samples_to_touchdown: int


@dataclass(frozen=True, eq=False)  # no slots: what is derived is computed once
class StanceSequence:
    """The stance of each sample of a horizon: Uc and U of (22), and the samples that stand on both feet."""

    foot_of_sample: NDArray[np.int64]
    """Foot that carries each sample, shape (N,): 0 the present support foot, k the k-th foothold to come."""
    is_double_support: NDArray[np.bool_]
    """Whether the other foot stands beside that one and carries the sample too, shape (N,)."""
    is_stopping: bool
    """Whether a last step is planned that brings the feet side by side."""
    samples_to_touchdown: NDArray[np.int64]
    """Number of samples until the touchdown that ends the step of each sample, shape (N,)."""

    def __post_init__(self) -> None:
        for array in (self.foot_of_sample, self.is_double_support, self.samples_to_touchdown):
            array.flags.writeable = False

    @cached_property
    def nb_footholds(self) -> int:
        """m, footholds to come that the QP may choose: all on which a sample stands, but for the last one of a stop."""
        return int(self.foot_of_sample[-1])

    @cached_property
    def has_double_support(self) -> bool:
        """Whether the feet stand side by side at the first sample (a start) or at the last one (a stop)."""
        return bool(self.is_double_support[0] or self.is_double_support[-1])

    @cached_property
    def stance_of_sample(self) -> NDArray[np.int64]:
        """Number of the stance of each sample, shape (N,): a foot as in `foot_of_sample`, or m + 1 for both feet."""
        return np.where(self.is_double_support, self.nb_footholds + 1, self.foot_of_sample)

    @cached_property
    def nb_stances(self) -> int:
        """The support foot, the m footholds, and both feet where they carry a sample."""
        return 1 + self.nb_footholds + self.has_double_support

    @cached_property
    def nb_samples(self) -> int:
        """N: that of the parameters, or as many as the step under way needs after a change of both."""
        return len(self.foot_of_sample)

    @cached_property
    def samples_on_support(self) -> int:
        """Samples that the present support foot carries alone."""
        return int(np.count_nonzero((self.foot_of_sample == 0) & ~self.is_double_support))

    @cached_property
    def first(self) -> "SampleStance":
        """Stance of the first sample."""
        return self._sample(0)

    @cached_property
    def last(self) -> "SampleStance":
        """Stance of the last sample."""
        return self._sample(-1)

    @cached_property
    def sample_on_foothold(self) -> int | None:
        """Index of the first sample on the next foothold; None if none stands on it, or the walk stops."""
        found = np.flatnonzero(self.foot_of_sample == 1)
        return None if self.is_stopping or not len(found) else int(found[0])

    @cached_property
    def first_on_foothold(self) -> "SampleStance | None":
        """Stance of the sample `sample_on_foothold`."""
        return None if self.sample_on_foothold is None else self._sample(self.sample_on_foothold)

    def _sample(self, n: int) -> "SampleStance":
        double_support = bool(self.is_double_support[n])
        return SampleStance(int(self.foot_of_sample[n]), double_support, int(self.samples_to_touchdown[n]))

    @cached_property
    def Uc(self) -> Matrix:
        """Selection of the support foot (22), shape (N, 1)."""
        return (self.foot_of_sample == 0).astype(float)[:, None]

    @cached_property
    def U(self) -> Matrix:
        """Selection of the m footholds (22), shape (N, m)."""
        return (self.foot_of_sample[:, None] == np.arange(1, self.nb_footholds + 1)).astype(float)


@dataclass(frozen=True, slots=True, eq=False)
class Horizon:
    """The samples to come, as seen from one tick."""

    ticks_to_sample: int
    """Number of ticks until the first sample; the others follow T apart."""
    time_to_touchdown: float
    """Time until the next touchdown [s]; NaN if none is planned."""
    time_in_air: float
    """Time that the foot which lands then has left in the air, or will have [s]; NaN if none is planned."""
    stances: StanceSequence
    step_duration: float | None = None
    """Duration of the steps after the one under way [s], where step timing chose it; None as the parameters say."""


@lru_cache(maxsize=1024)  # a walk on schedule has eight of them, a start and a stop as many each
def stances_of_walk(
    nb_samples: int, samples_of_step: int, samples_per_step: int, present: int, steps_left: int | None
) -> StanceSequence:
    """The stances of a walk's horizon.

    Args:
        nb_samples: N.
        samples_of_step: samples of the step under way, or the first one to come.
        samples_per_step: samples of each step after it.
        present: sample of the present, counted from the beginning of the step; negative before the first one.
        steps_left: until the feet are side by side again, the one under way included; None to walk on.
    """
    samples = np.arange(present + 1, present + nb_samples + 1)
    beyond = samples - samples_of_step  # counted from the touchdown
    step = np.maximum((beyond - 1) // samples_per_step + 1, 0)
    last_step = step[-1] if steps_left is None else steps_left - 1
    return StanceSequence(
        foot_of_sample=np.minimum(step, last_step),
        is_double_support=(samples <= 0) | (step > last_step),
        is_stopping=bool(step[-1] > last_step),
        samples_to_touchdown=np.where(beyond <= 0, -beyond, -beyond % samples_per_step),
    )
