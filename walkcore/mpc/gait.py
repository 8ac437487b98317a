"""Which foot carries the robot at each sample of the horizon.

    Zref = Uc f_support + U f      (20)-(21)

Uc and U of (22) only say which sample falls into which step. Samples lie on the
gait's own grid, T apart; a step begins at its foot's touchdown with a double
support of one period, then the other foot swings. A sample at the touchdown itself
still belongs to the step that ends, whose constraint is the stricter one (section 4).
"""

import math
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property, lru_cache

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


@dataclass(frozen=True, eq=False)  # no slots: what is derived is computed once, and a horizon comes back every step
class Horizon:
    """The supports of the samples to come, as seen from one tick."""

    ticks_to_sample: int
    """From the present to the first sample; the others follow T apart."""
    foot: NDArray[np.int64]
    """What carries each sample, shape (N,): 0 the present support foot, k the k-th foothold to come."""
    is_on_both: NDArray[np.bool_]
    """Whether the other foot stands beside that one and carries the sample too, shape (N,)."""
    is_stopping: bool
    """Whether a last step is planned that brings the feet side by side."""
    samples_left: NDArray[np.int64]
    """From each sample to the touchdown that ends its step, shape (N,)."""
    time_to_touchdown: float
    """From the present to the next touchdown [s]; NaN if none is planned."""

    def __post_init__(self) -> None:
        for array in (self.foot, self.is_on_both, self.samples_left):
            array.flags.writeable = False

    @cached_property
    def nb_footholds(self) -> int:
        """m, footholds to come that the QP may choose: all on which a sample stands, but for the last one of a stop."""
        return int(self.foot[-1])

    @cached_property
    def is_any_on_both(self) -> bool:
        """Whether the feet stand side by side at some sample."""
        return bool(self.is_on_both[0] or self.is_on_both[-1])

    @cached_property
    def nb_carriers(self) -> int:
        """The support foot, the m footholds, and the feet side by side where they carry a sample."""
        return 1 + self.nb_footholds + self.is_any_on_both

    @cached_property
    def carrier(self) -> NDArray[np.int64]:
        """Number of what carries each sample, shape (N,): a foot as in `foot`, or m + 1 for both."""
        return np.where(self.is_on_both, self.nb_footholds + 1, self.foot)

    @cached_property
    def nb_samples_on_support(self) -> int:
        """Samples that the present support foot carries alone."""
        return int(np.count_nonzero((self.foot == 0) & ~self.is_on_both))

    @cached_property
    def support_selection(self) -> Matrix:
        """Uc of (22), shape (N, 1)."""
        return (self.foot == 0).astype(float)[:, None]

    @cached_property
    def foothold_selection(self) -> Matrix:
        """U of (22), shape (N, m)."""
        return (self.foot[:, None] == np.arange(1, self.nb_footholds + 1)).astype(float)


@dataclass(frozen=True, slots=True)
class Gait:
    """A stand on both feet, alternating steps on the grid, and a stand again; either may last for ever."""

    parameters: Parameters
    first_support: Side = Side.LEFT
    """Foot that carries the first step."""
    start: int | None = None
    """Sample at which the first step begins; None to stand."""
    nb_steps: int | None = None
    """Steps until the feet are side by side again; None to walk on."""

    def step(self, tick: int) -> int:
        """Index of the step under way; negative while standing."""
        sample = tick // self.parameters.ticks_per_sample
        if self.start is None or sample < self.start:
            return -1
        return (sample - self.start) // self.parameters.samples_per_step

    def ticks_into_step(self, tick: int) -> int:
        """Since the step under way began; negative before the first one."""
        p, start = self.parameters, self.start or 0
        return tick - (start + max(self.step(tick), 0) * p.samples_per_step) * p.ticks_per_sample

    def phase(self, tick: int) -> Phase:
        """Which feet are on the ground."""
        if self.step(tick) < 0:
            return Phase.STANDING
        in_double_support = self.ticks_into_step(tick) < self.parameters.ticks_per_sample
        return Phase.DOUBLE_SUPPORT if in_double_support else Phase.SINGLE_SUPPORT

    def support_side(self, tick: int) -> Side:
        """The foot that carries the robot; while standing, the one that will carry the first step."""
        is_other = max(self.step(tick), 0) % 2 == 1
        return self.first_support.other if is_other else self.first_support

    def has_ended(self, tick: int) -> bool:
        """Whether the last step of a stop is over."""
        return self.nb_steps is not None and self.step(tick) >= self.nb_steps

    def time_to_touchdown(self, tick: int) -> float:
        """Until the foot in the air, or the next one to leave the ground, lands [s]; NaN if none will."""
        if self.start is None:
            return math.nan
        p = self.parameters
        return (p.samples_per_step * p.ticks_per_sample - self.ticks_into_step(tick)) * p.control_period

    def steps_to_stand(self, tick: int) -> int:
        """Touchdowns until the feet stand side by side: 0 while they do for good, -1 if the walk goes on."""
        if self.start is None:
            return 0
        return -1 if self.nb_steps is None else self.nb_steps - max(self.step(tick), 0)

    def swing_progress(self, tick: int) -> float:
        """Fraction of the single support that has passed, in [0, 1]."""
        p = self.parameters
        swing_ticks = (p.samples_per_step - 1) * p.ticks_per_sample
        return max(self.ticks_into_step(tick) - p.ticks_per_sample, 0) / swing_ticks

    def horizon(self, tick: int) -> Horizon:
        """The supports of the N samples that follow `tick`: the same object whenever the same phase comes back."""
        if self.start is None:
            return _standing(self.parameters, tick % self.parameters.ticks_per_sample)
        steps_left = None if self.nb_steps is None else self.nb_steps - max(self.step(tick), 0)
        return _stepping(self.parameters, self.ticks_into_step(tick), steps_left)

    def going_on_with(self, parameters: Parameters, tick: int) -> "Gait":
        """The same gait with other parameters; the step under way at a tick keeps its duration.

        Raises:
            InvalidValueError: if that and the other parameters do not go together.
        """
        if self.step(tick) >= 0:
            parameters = replace(parameters, step_duration=self.parameters.step_duration)
        return replace(self, parameters=parameters)

    def at_next_step(self, parameters: Parameters, tick: int) -> "Gait":
        """The same gait with other parameters where a step begins at a tick, else itself."""
        step = self.step(tick)
        if step < 0 or self.ticks_into_step(tick) != 0 or self.parameters == parameters:
            return self
        start, steps_left = tick // parameters.ticks_per_sample, self.nb_steps and self.nb_steps - step
        return Gait(parameters, self.support_side(tick), start, steps_left)

    def choices(self, tick: int, wants_to_walk: bool, first_support: Side) -> "tuple[Gait, ...]":
        """What the robot might do from here on, in the order in which it would rather do it.

        Args:
            tick: now.
            wants_to_walk: whether it is asked to.
            first_support: foot to carry the first step of a walk that is asked for.
        """
        p = self.parameters
        present = tick // p.ticks_per_sample
        if self.phase(tick) is Phase.STANDING:
            stand = Gait(p, self.first_support)
            walk = self if self.start is not None else Gait(p, first_support, present + p.samples_before_first_step)
            step_at_once = tuple(Gait(p, side, present + 1) for side in Side)
            return (walk if wants_to_walk else stand, *step_at_once)
        walk_on = self if self.nb_steps is None else replace(self, nb_steps=None)
        if wants_to_walk:
            return (walk_on,)
        stop = self if self.nb_steps is not None else replace(self, nb_steps=self.step(tick) + 2)
        return (stop, walk_on)


@lru_cache(maxsize=4096)
def _stepping(p: Parameters, ticks_into_step: int, steps_left: int | None) -> Horizon:
    """The horizon of a walk.

    Args:
        p: for N and the timing.
        ticks_into_step: since the step under way began; negative before the first one.
        steps_left: until the feet are side by side again, the one under way included; None to walk on.
    """
    present = ticks_into_step // p.ticks_per_sample
    samples = np.arange(present + 1, present + p.horizon_samples + 1)
    step = np.maximum((samples - 1) // p.samples_per_step, 0)
    last_step = step[-1] if steps_left is None else steps_left - 1
    return Horizon(
        ticks_to_sample=(present + 1) * p.ticks_per_sample - ticks_into_step,
        foot=np.minimum(step, last_step),
        is_on_both=(samples <= 0) | (step > last_step),
        is_stopping=bool(step[-1] > last_step),
        samples_left=-samples % p.samples_per_step,
        time_to_touchdown=(p.samples_per_step * p.ticks_per_sample - ticks_into_step) * p.control_period,
    )


@lru_cache(maxsize=256)
def _standing(p: Parameters, ticks_into_sample: int) -> Horizon:
    """The horizon of a stand that lasts: that of a walk which begins with the last sample, or later."""
    horizon = _stepping(p, ticks_into_sample - p.horizon_samples * p.ticks_per_sample, None)
    return replace(horizon, time_to_touchdown=math.nan)
