"""The gait: when steps begin and end, in ticks, and which foot carries them.

Samples lie on the gait's own grid, T apart; a step begins at its foot's touchdown with a double support of one period,
then the other foot swings. Adaptive step timing may end a step at another tick; samples then lie on its touchdown.
"""

import math
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property

from walkcore.mpc.horizon import Horizon, stances_of_walk
from walkcore.mpc.stance import Side


class Phase(IntEnum):
    """Phase of the gait; numbered as in a recording."""

    STANDING = 0
    DOUBLE_SUPPORT = 1
    SINGLE_SUPPORT = 2


@dataclass(frozen=True)  # no slots: what is derived is computed once
class Timing:
    """Periods and durations of a gait, all whole multiples of the control period."""

    nb_samples: int
    """N, samples of the horizon."""
    sampling_period: float
    """T, between samples, and the duration of the double support that begins each step [s]."""
    control_period: float
    """Duration of a tick [s]."""
    step_duration: float
    """Time from one touchdown to the next: double support, then single support [s]."""
    initial_double_support_duration: float
    """Time on both feet before the first step [s]."""

    @cached_property
    def ticks_per_sample(self) -> int:
        """Control ticks from one sample of the grid to the next."""
        return round(self.sampling_period / self.control_period)

    @cached_property
    def samples_per_step(self) -> int:
        """Samples that one support foot carries."""
        return round(self.step_duration / self.sampling_period)

    @cached_property
    def ticks_per_step(self) -> int:
        """Control ticks from one touchdown to the next."""
        return self.samples_per_step * self.ticks_per_sample

    @cached_property
    def samples_before_first_step(self) -> int:
        """Samples of the initial double support."""
        return round(self.initial_double_support_duration / self.sampling_period)


@dataclass(frozen=True, slots=True)
class GaitState:
    """The state of a gait at one tick."""

    phase: Phase
    support_side: Side
    """The foot that carries the robot; while standing, the one that will carry the first step."""
    time_to_touchdown: float
    """Time until the foot in the air, or the next one to leave the ground, lands [s]; NaN if none will."""
    steps_to_stand: int
    """Touchdowns until the feet stand side by side: 0 while they do for good, -1 if the walk goes on."""
    swing_progress: float
    """Fraction of the single support that has passed, in [0, 1]."""
    next_swing_progress: float
    """The same one tick later, if the foot has not landed by then."""


@dataclass(frozen=True, slots=True)
class Retiming:
    """A step that lasts another time than the timing says, and those after it."""

    offset: int
    """Ticks from the sample `Gait.start` to the beginning of the first step."""
    first_step_ticks: int
    """Duration of the first step in ticks; samples lie on its touchdown, and T apart before and after it."""
    samples_per_step: int
    """Samples that each step after the first one takes."""


@dataclass(frozen=True)  # no slots: what is derived is computed once
class Gait:
    """A stand on both feet, alternating steps on the grid, and a stand again; either may last for ever."""

    timing: Timing
    first_support: Side = Side.LEFT
    """Foot that carries the first step."""
    start: int | None = None
    """Sample at which the first step begins; None to stand."""
    nb_steps: int | None = None
    """Steps until the feet are side by side again; None to walk on."""
    retiming: Retiming | None = None
    """Other durations than those of the timing, chosen by adaptive step timing."""

    @cached_property
    def beginning(self) -> int:
        """Tick at which the first step begins; 0 for a stand that lasts."""
        offset = 0 if self.retiming is None else self.retiming.offset
        return (self.start or 0) * self.timing.ticks_per_sample + offset

    @cached_property
    def first_touchdown(self) -> int:
        """Tick at which the first step ends."""
        retiming = self.retiming
        return self.beginning + (self.timing.ticks_per_step if retiming is None else retiming.first_step_ticks)

    @cached_property
    def samples_per_step(self) -> int:
        """Samples that each step after the first one takes."""
        return self.timing.samples_per_step if self.retiming is None else self.retiming.samples_per_step

    @cached_property
    def ticks_per_step(self) -> int:
        """Ticks that each step after the first one takes."""
        return self.samples_per_step * self.timing.ticks_per_sample

    def step(self, tick: int) -> int:
        """Index of the step under way; -1 while standing."""
        if self.start is None or tick < self.beginning:
            return -1
        return (tick - self.first_touchdown) // self.ticks_per_step + 1 if tick >= self.first_touchdown else 0

    def step_ticks(self, tick: int) -> tuple[int, int]:
        """Ticks at which the step under way, or the first one to come, begins and ends."""
        step = max(self.step(tick), 0)
        end = self.first_touchdown + step * self.ticks_per_step
        return (end - self.ticks_per_step if step else self.beginning), end

    def at(self, tick: int) -> GaitState:
        """The state of the gait at a tick."""
        timing, step = self.timing, self.step(tick)
        if self.start is None:
            return GaitState(Phase.STANDING, self.first_support, math.nan, 0, 0.0, 0.0)
        begin, end = self.step_ticks(tick)
        swing_ticks = end - begin - timing.ticks_per_sample
        ticks_in_air = tick - begin - timing.ticks_per_sample
        if step < 0:
            phase = Phase.STANDING
        else:
            phase = Phase.DOUBLE_SUPPORT if ticks_in_air < 0 else Phase.SINGLE_SUPPORT
        return GaitState(
            phase,
            self.support_side(tick),
            time_to_touchdown=(end - tick) * timing.control_period,
            steps_to_stand=-1 if self.nb_steps is None else self.nb_steps - max(step, 0),
            swing_progress=max(ticks_in_air, 0) / swing_ticks,
            next_swing_progress=max(ticks_in_air + 1, 0) / swing_ticks,
        )

    def begins_step(self, tick: int) -> bool:
        """Whether a step begins at a tick: the foot that carries it has just landed, or is about to carry the first."""
        return self.step(tick) >= 0 and self.step_ticks(tick)[0] == tick

    def support_side(self, tick: int) -> Side:
        """The foot that carries the robot; while standing, the one that will carry the first step."""
        return self.first_support.other if max(self.step(tick), 0) % 2 else self.first_support

    def step_durations(self, tick: int) -> tuple[float, float]:
        """Durations of the step under way, or the first one to come, and of those after it [s]."""
        if self.retiming is None:
            return self.timing.step_duration, self.timing.step_duration
        begin, end = self.step_ticks(tick)
        period = self.timing.control_period
        return (end - begin) * period, self.ticks_per_step * period

    def has_ended(self, tick: int) -> bool:
        """Whether the last step of a stop is over."""
        return self.nb_steps is not None and self.step(tick) >= self.nb_steps

    def horizon(self, tick: int) -> Horizon:
        """The stances of the N samples that follow `tick`."""
        timing, per_sample = self.timing, self.timing.ticks_per_sample
        if self.start is None:  # a stand that lasts: that of a walk which begins with the last sample, or later
            stances = stances_of_walk(
                timing.nb_samples, timing.samples_per_step, timing.samples_per_step, -timing.nb_samples, None
            )
            return Horizon(per_sample - tick % per_sample, math.nan, math.nan, stances)
        begin, end = self.step_ticks(tick)
        steps_left = None if self.nb_steps is None else self.nb_steps - max(self.step(tick), 0)
        samples_of_step = math.ceil((end - begin) / per_sample)
        present = samples_of_step - math.ceil((end - tick) / per_sample)
        stances = stances_of_walk(timing.nb_samples, samples_of_step, self.samples_per_step, present, steps_left)
        return Horizon(
            ticks_to_sample=(end - tick - 1) % per_sample + 1,
            time_to_touchdown=(end - tick) * timing.control_period,
            time_in_air=min(end - tick, end - begin - per_sample) * timing.control_period,
            stances=stances,
            step_duration=None if self.retiming is None else round(self.samples_per_step * timing.sampling_period, 9),
        )

    def with_timing(self, timing: Timing, tick: int) -> "Gait":
        """The same gait with another timing; a step under way keeps its duration, and the horizon sees its end.

        Args:
            timing: for the steps to come.
            tick: now.
        """
        if self.step(tick) >= 0:
            nb_samples = max(timing.nb_samples, self.timing.samples_per_step + 1)
            timing = replace(timing, step_duration=self.timing.step_duration, nb_samples=nb_samples)
        return replace(self, timing=timing)

    def at_next_step(self, timing: Timing, tick: int) -> "Gait":
        """The same gait with another timing where a step begins at a tick, else itself."""
        if self.timing == timing or not self.begins_step(tick):
            return self
        return self._from_step(timing, tick, tick, tick + timing.ticks_per_step, timing.samples_per_step)

    def retimed(
        self, tick: int, begin: int, touchdown: int, samples_per_step: int, support: Side | None = None
    ) -> "Gait":
        """The same walk, going on for ever, with other durations of the step under way and of those after it.

        Args:
            tick: now.
            begin: tick at which the step under way has begun; a robot that stands begins one thereby.
            touchdown: tick of the touchdown that ends it.
            samples_per_step: samples that each step after it takes.
            support: foot that carries the step under way; by default that of this gait.
        """
        gait = replace(self, nb_steps=None)
        return gait._from_step(self.timing, tick, begin, touchdown, samples_per_step, support)

    def waiting(self, tick: int) -> "Gait":
        """The same gait one tick later than planned: at the next tick it is where it is at this one."""
        if self.start is None:
            return self
        begin, end = self.step_ticks(tick)
        return self._from_step(self.timing, tick, begin + 1, end + 1, self.samples_per_step)

    def _from_step(
        self, timing: Timing, tick: int, begin: int, end: int, samples_per_step: int, support: Side | None = None
    ) -> "Gait":
        """The same gait, counted from the step under way, which begins and ends at these ticks."""
        start, offset = divmod(begin, timing.ticks_per_sample)
        steps_left = self.nb_steps and self.nb_steps - max(self.step(tick), 0)
        side = self.support_side(tick) if support is None else support
        as_scheduled = (
            offset == 0 and end - begin == timing.ticks_per_step and samples_per_step == timing.samples_per_step
        )
        retiming = None if as_scheduled else Retiming(offset, end - begin, samples_per_step)
        return Gait(timing, side, start, steps_left, retiming)

    def candidates(self, tick: int, walks: bool, first_support: Side) -> "tuple[Gait, ...]":
        """The gaits that may follow from a tick on, the preferred one first; the last one never stops.

        Args:
            tick: now.
            walks: whether the reference, or the parameters, call for steps.
            first_support: foot to carry the first step of a walk that begins.
        """
        timing, step = self.timing, self.step(tick)
        if step < 0:
            present = tick // timing.ticks_per_sample
            stand = Gait(timing, self.first_support)
            begin = present + timing.samples_before_first_step
            walk = self if self.start is not None else Gait(timing, first_support, begin)
            step_at_once = tuple(Gait(timing, side, present + 1) for side in Side)
            return (walk if walks else stand, *step_at_once)
        walk_on = self if self.nb_steps is None else replace(self, nb_steps=None)
        if walks:
            return (walk_on,)
        stop = self if self.nb_steps is not None else replace(self, nb_steps=step + 2)
        return (stop, walk_on)
