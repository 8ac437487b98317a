"""Touchdowns that the step under way may end with, compared by how far the present DCM lies inside their viable sets.

A touchdown moves the whole grid: samples lie k T before and after it, so none falls inside a double support. In a
double support it moves by whole T therefore, and the foot that has just landed may leave again instead of the other
one. A robot that stands may step at once, with either foot. Each touchdown is compared with each duration of the
steps after it, and for each `Allowance`, all by one call of `ViableSets.margins`.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from walkcore.mpc.balance_sets import SHORTEST_SWING, samples_to_choose_from, shortest_step
from walkcore.mpc.gait import Gait, Phase
from walkcore.mpc.pattern_generator import PatternGenerator
from walkcore.mpc.stance import Side, sole_vertices
from walkcore.mpc.supports import WalkingProblem
from walkcore.mpc.viability import Landings, ViableSets
from walkcore.parameters import Parameters
from walkcore.robot import Robot
from walkcore.values import Vector

MAX_LOWERING_SPEED = 1.0  # [m/s] of the foot in the air: bounds how soon it can land
RESOLUTION = 0.02  # [s] between the touchdowns that are compared
SWAP = 0.03  # [m] by which a touchdown of the foot that has just landed has to be better than one of the other foot
TINY = 1e-12
SPARE_LEG = 0.02  # [m] that the CoM stays nearer to the support foot than the leg reaches

ProblemOf = Callable[[Gait], WalkingProblem]
"""The walking problem of this tick with some gait."""


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """Touchdowns of one foot to choose from."""

    gait: Gait
    support: Side
    """Foot that carries the step under way."""
    begin: int
    """Tick at which that step has begun."""
    touchdowns: NDArray[np.int64]
    """Ticks of the touchdown that ends it, the latest first, shape (K,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """A touchdown, and the margin that it leaves."""

    gait: Gait
    margin: float
    """Distance of the DCM inside of the viable set [m]."""


class TouchdownComparison:
    """Compares the touchdowns of any tick. Holds nothing but what depends on robot and parameters alone."""

    def __init__(self, robot: Robot, parameters: Parameters, generator: PatternGenerator, sets: ViableSets) -> None:
        """Take what stays the same from tick to tick.

        Args:
            robot: to plan for.
            parameters: of the plans.
            generator: for that robot and these parameters.
            sets: by allowance and duration of the coming steps, see `BalanceSets`.
        """
        self.timing, self.robot, self.generator = parameters.timing, robot, generator
        self.samples_per_step = samples_to_choose_from(parameters)
        self.shortest_step = min(shortest_step(parameters), self.timing.samples_per_step)
        self.sets = sets

    def branches(self, gait: Gait, tick: int, height: float, problem_of: ProblemOf) -> Iterator[Branch]:
        """All touchdowns to choose from, those of the present support foot first.

        Args:
            gait: as scheduled; its own touchdown is the first one.
            tick: now.
            height: of the foot in the air [m].
            problem_of: the walking problem with some gait.
        """
        timing, per_sample = self.timing, self.timing.ticks_per_sample
        phase, support = gait.at(tick).phase, gait.support_side(tick)
        begin, touchdown = gait.step_ticks(tick)
        if phase is Phase.SINGLE_SUPPORT:
            swing = begin + per_sample + round(SHORTEST_SWING / timing.control_period)
            lowering = tick + math.ceil(height / MAX_LOWERING_SPEED / timing.control_period) + 1
            soonest = min(max(swing, lowering), touchdown)
            every = max(round(RESOLUTION / timing.control_period), 1)
            yield Branch(gait, support, begin, np.append(np.arange(touchdown, soonest, -every), soonest))
            return
        samples = np.arange(timing.samples_per_step, self.shortest_step - 1, -1)
        problem = problem_of(gait) if phase is Phase.STANDING else None
        for side in (support, support.other):
            if problem is not None:
                begin = max(tick + self._ticks_to_shift(problem, side) - per_sample, 0)
            yield Branch(gait, side, begin, begin + samples * per_sample)

    def _ticks_to_shift(self, problem: WalkingProblem, side: Side) -> int:
        """Ticks until the CoP of a robot that stands is under one of its feet.

        It goes there as fast as over the double support of a walk, from one foot to the other: from the middle that
        takes half of the time.
        """
        here, there = problem.support.position, problem.swing.position
        if problem.support.side is not side:
            here, there = there, here
        across, cop = there - here, self.generator.pendulum.cop(problem.com)
        part = float((cop - here) @ across / max(float(across @ across), TINY))
        return math.ceil(min(max(part, 0.0), 1.0) * self.timing.ticks_per_sample - 1e-9)

    def margins(self, branch: Branch, tick: int, problem_of: ProblemOf) -> NDArray[np.float64]:
        """Margins of the touchdowns of a branch, by allowance and duration of the coming steps [m], shape (K, A, D)."""
        problem = problem_of(self.gait(branch, tick, 0, 0))
        period, per_sample = self.timing.control_period, self.timing.ticks_per_sample
        to_touchdown = branch.touchdowns - tick
        waiting = round((problem.horizon.time_to_touchdown - problem.horizon.time_in_air) / period)
        ticks = ((to_touchdown - 1) % per_sample + 1, to_touchdown, to_touchdown - waiting)
        landings = Landings(*(np.asarray(period * t, dtype=np.float64) for t in ticks))
        pendulum, com = self.generator.pendulum, problem.com
        yaw = self.generator.next_yaw(problem)
        margins = self.sets.margins(problem.support, problem.swing, yaw, pendulum.dcm(com), pendulum.cop(com), landings)
        return np.minimum(margins, self._leg_margins(problem, landings.to_touchdown)[:, None, None])

    def _leg_margins(self, problem: WalkingProblem, to_touchdown: Vector) -> Vector:
        """Changes of the DCM that the leg still bears until each touchdown [m], shape (K,).

        With a constant CoP z the CoM is at z + (c - z) cosh + dc / omega sinh at the touchdown, and has to be no
        farther from the support foot than the leg reaches.
        """
        com, support, omega = problem.com, problem.support, self.generator.pendulum.omega
        cosh, sinh = np.cosh(omega * to_touchdown)[:, None], np.sinh(omega * to_touchdown)[:, None]
        position = (com.position - support.position) * cosh + com.velocity / omega * sinh
        distance = np.hypot(position[:, 0], position[:, 1])
        outward = position / distance[:, None]
        sole = sole_vertices(self.robot.sole, support) - support.position
        held_back = (cosh[:, 0] - 1.0) * np.max(outward @ sole.T, axis=1)
        return (self.robot.max_com_distance - SPARE_LEG - (distance - held_back)) / sinh[:, 0]

    def gait(self, branch: Branch, tick: int, touchdown: int, duration: int) -> Gait:
        """The gait with one of the touchdowns of a branch, and one of the durations of the steps after it.

        Args:
            branch: with its touchdowns.
            tick: now.
            touchdown: index of the touchdown.
            duration: index of the duration.
        """
        samples_per_step = self.samples_per_step[duration]
        ends = int(branch.touchdowns[touchdown])
        return branch.gait.retimed(tick, branch.begin, ends, samples_per_step, branch.support)


class Touchdowns:
    """All touchdowns to choose from at one tick, and their margins; computed at their first use."""

    def __init__(
        self, comparison: TouchdownComparison, gait: Gait, tick: int, height: float, problem_of: ProblemOf
    ) -> None:
        """Keep the arguments.

        Args:
            comparison: by which they are compared.
            gait: as scheduled.
            tick: now.
            height: of the foot in the air [m].
            problem_of: the walking problem with some gait.
        """
        self._comparison, self._gait, self._tick, self._height = comparison, gait, tick, height
        self._problem_of = problem_of

    @cached_property
    def _branches(self) -> list[Branch]:
        return list(self._comparison.branches(self._gait, self._tick, self._height, self._problem_of))

    @cached_property
    def _margins(self) -> list[NDArray[np.float64]]:
        """Margins of each branch, shapes (K, A, D)."""
        return [self._comparison.margins(branch, self._tick, self._problem_of) for branch in self._branches]

    @property
    def are_compared(self) -> bool:
        """Whether the margins are known already."""
        return "_margins" in self.__dict__

    def most(self, allowance: int) -> float:
        """The largest margin of all [m]."""
        return max(float(margins[:, allowance].max()) for margins in self._margins)

    def on_schedule(self, allowance: int) -> float:
        """Margin of the gait as scheduled [m]; minus infinity if it is none of those that are compared."""
        gait, tick, samples = self._gait, self._tick, self._comparison.samples_per_step
        if gait.step(tick) < 0 or gait.samples_per_step not in samples:
            return -math.inf
        found = np.flatnonzero(self._branches[0].touchdowns == gait.step_ticks(tick)[1])
        duration = samples.index(gait.samples_per_step)
        return float(self._margins[0][found[0], allowance, duration]) if len(found) else -math.inf

    def as_usual(self, allowance: int) -> Choice:
        """The step under way on schedule and those after it of the usual duration; a step on both feet takes it too."""
        gait, tick, timing = self._gait, self._tick, self._comparison.timing
        begin, touchdown = gait.step_ticks(tick)
        if gait.at(tick).phase is not Phase.SINGLE_SUPPORT:
            touchdown = begin + timing.ticks_per_step
        if self.are_compared:
            margins = self._margins[0]
            assert self._branches[0].touchdowns[0] == touchdown
        else:
            branch = Branch(gait, gait.support_side(tick), begin, np.array([touchdown]))
            margins = self._comparison.margins(branch, tick, self._problem_of)
        return Choice(gait.retimed(tick, begin, touchdown, timing.samples_per_step), float(margins[0, allowance, 0]))

    def least_change(self, allowance: int, enough: float) -> Gait | None:
        """The longest steps, and with them the latest touchdown, that leave more than some margin [m]."""
        for branch, margins in zip(self._branches, self._margins, strict=True):
            for duration in range(margins.shape[2]):
                for k in np.flatnonzero(margins[:, allowance, duration] > enough)[:1]:
                    return self._comparison.gait(branch, self._tick, int(k), duration)
        return None

    def deepest(self, allowance: int) -> Choice | None:
        """The touchdown, and the duration of the steps after it, whose viable set holds the DCM deepest inside."""
        by_branch = [margins[:, allowance] for margins in self._margins]
        own, *others = (float(margins.max()) for margins in by_branch)
        b = 1 if others and others[0] > own + (SWAP if own > 0.0 else 0.0) else 0
        k, duration = np.unravel_index(int(by_branch[b].argmax()), by_branch[b].shape)
        margin = float(by_branch[b][k, duration])
        if margin == -math.inf:
            return None
        return Choice(self._comparison.gait(self._branches[b], self._tick, int(k), int(duration)), margin)
