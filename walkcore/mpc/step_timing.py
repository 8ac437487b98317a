"""Adaptive step timing: a robot that is threatened puts its foot down sooner.

The least change comes first:

    1. the paper's QP on schedule
    2. the same with a hard row: at the first sample on the next foothold the DCM is viable
    3. the nearest sooner touchdown, with the coming steps 0.8, 0.6, 0.5 or 0.4 s long, that leaves a margin
    4. the touchdown that leaves most, with margins of the CoP given up

A touchdown moves the whole grid: samples lie k T before and after it, so none falls inside a double support. In a
double support it moves by whole T therefore, and the foot that has just landed may leave again instead of the other
one. A robot that stands may step at once, with either foot. Touchdowns are compared by how far the present DCM lies
inside the viable set of each (`viability.py`), so that only one or two QPs are solved. Back to the usual step as soon
as that is safe.

Koolen et al. 2012; Khadiv et al. 2016, 2020; Bohorquez and Wieber 2017.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from walkcore.errors import NoSolutionFoundError
from walkcore.mpc.gait import Gait, Phase
from walkcore.mpc.pattern_generator import PatternGenerator
from walkcore.mpc.plan import Plan
from walkcore.mpc.stance import Side, sole_vertices
from walkcore.mpc.supports import TIGHTENING, WalkingProblem, capture_sets
from walkcore.mpc.viability import Landings, ViableSets, viable_sets
from walkcore.mpc.walking_qp import OVERSHOOT
from walkcore.parameters import Parameters
from walkcore.robot import Robot
from walkcore.stages import TimeLeft, unlimited
from walkcore.values import Matrix, Vector

SHORTER_STEPS = (0.6, 0.5, 0.4)  # [s]
SHORTEST_SWING = 0.3  # [s]
MAX_LOWERING_SPEED = 1.0  # [m/s] of the foot in the air: bounds how soon it can land
RESOLUTION = 0.02  # [s] between the touchdowns that are compared
SWAP = 0.03  # [m] by which a touchdown of the foot that has just landed has to be better than one of the other foot
ENOUGH = 0.02  # [m] inside a viable set, from which on a later touchdown is better than a deeper one
HYSTERESIS = 0.005  # [m] by which the DCM has to lie deeper inside a viable set for a change of the touchdown
SPARE_LEG = 0.02  # [m] that the CoM stays nearer to the support foot than the leg reaches
SAFE = 0.010  # [m] inside the viable set of the usual step, to return to it

ProblemOf = Callable[[Gait], WalkingProblem]
"""The walking problem of this tick with some gait."""


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """Touchdowns of one foot to choose from."""

    gait: Gait
    support: Side
    """Foot that carries the step under way."""
    touchdowns: NDArray[np.int64]
    """Ticks of the touchdown that ends it, the latest first, shape (K,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """A touchdown, and the margin that it leaves."""

    gait: Gait
    margin: float
    """Distance of the DCM inside of the viable set [m]."""


class AdaptiveTiming:
    """Chooses when the step under way ends, and how long those after it take."""

    def __init__(self, robot: Robot, parameters: Parameters, generator: PatternGenerator) -> None:
        """Compute the viable sets of all durations of the coming steps."""
        p, omega = parameters, generator.pendulum.omega
        timing = p.timing
        self._timing, self._generator = timing, generator
        shorter = {round(duration / p.sampling_period) for duration in SHORTER_STEPS}
        least = self._shortest_step = math.ceil(SHORTEST_SWING / p.sampling_period - 1e-9) + 1
        self._samples_per_step = (
            timing.samples_per_step,
            *sorted((n for n in shorter if least <= n < timing.samples_per_step), reverse=True),
        )
        durations = tuple(round(n * p.sampling_period, 9) for n in self._samples_per_step)
        self._with_margin, self._without_margin = (
            viable_sets(robot, margin, durations, p.double_support_duration, omega, part)
            for margin, part in ((p.cop_margin, TIGHTENING), (min(OVERSHOOT, p.cop_margin), 1.0))
        )
        for duration in durations:  # else the first push would wait for them
            capture_sets(robot, p, duration)
        self._robot = robot

    def decide(
        self, gaits: Sequence[Gait], tick: int, height: float, problem_of: ProblemOf, time_left: TimeLeft = unlimited
    ) -> tuple[Gait, Plan]:
        """The gait of this tick and its plan.

        Args:
            gaits: that may follow as scheduled, the preferred one first, see `Gait.candidates`.
            tick: now.
            height: of the foot in the air [m].
            problem_of: the walking problem with some gait.
            time_left: for the decision [s].

        Raises:
            NoSolutionFoundError: if no motion is feasible, not even on the true edges of the soles.
            OutOfTimeError: if the time is over before a plan is found.
        """
        generator, on_schedule = self._generator, gaits[-1]
        for gait in (*self._restored(on_schedule, tick, problem_of), *gaits):
            is_usual = gait.samples_per_step >= self._timing.samples_per_step
            make = generator.viable_plan if is_usual else generator.recovering_plan
            plan = make(problem_of(gait), time_left)
            if plan is not None:
                return gait, plan
        branches = list(self._branches(on_schedule, tick, height))
        margins = [self._margins(self._with_margin, branch, tick, problem_of) for branch in branches]
        enough = min(ENOUGH, max(float(margin.max()) for margin in margins)) - HYSTERESIS
        if on_schedule.step(tick) >= 0 and self._margin_of(on_schedule, tick, branches, margins) > max(enough, 0.0):
            plan = generator.corrected_plan(problem_of(on_schedule), time_left)
            if plan is not None:
                return on_schedule, plan
        sooner = self._nearest(branches, margins, tick, max(enough, HYSTERESIS))
        if sooner is not None:
            plan = generator.corrected_plan(problem_of(sooner), time_left)
            if plan is not None:
                return sooner, plan
        margins = [self._margins(self._without_margin, branch, tick, problem_of) for branch in branches]
        best = self._deepest(branches, margins, tick)
        usual = self._margin_of(on_schedule, tick, branches, margins)
        choices = [on_schedule] if best is None else [best.gait, on_schedule]
        if best is not None and best.margin < usual + HYSTERESIS:
            choices = [on_schedule, best.gait]
        failure: NoSolutionFoundError | None = None
        for gait in choices:
            try:
                return gait, generator.relaxed_plan(problem_of(gait), time_left)
            except NoSolutionFoundError as error:
                failure = failure or error
        assert failure is not None
        raise failure

    def _restored(self, gait: Gait, tick: int, problem_of: ProblemOf) -> Iterator[Gait]:
        """The gait with steps of the usual duration again, if that is safe."""
        usual = self._timing.samples_per_step
        if gait.retiming is None or gait.start is None or gait.samples_per_step == usual:
            return
        begin, touchdown = gait.step_ticks(tick)
        if gait.at(tick).phase is not Phase.SINGLE_SUPPORT:
            touchdown = begin + self._timing.ticks_per_step
        branch = Branch(gait, gait.support_side(tick), np.array([touchdown]))
        if self._margins(self._with_margin, branch, tick, problem_of)[0, 0] > SAFE:
            yield gait.retimed(tick, touchdown, usual)

    def _branches(self, gait: Gait, tick: int, height: float) -> Iterator[Branch]:
        """All touchdowns to choose from, those of the present support foot first."""
        timing, per_sample = self._timing, self._timing.ticks_per_sample
        phase, support = gait.at(tick).phase, gait.support_side(tick)
        begin, touchdown = gait.step_ticks(tick)
        if phase is Phase.SINGLE_SUPPORT:
            swing = begin + per_sample + round(SHORTEST_SWING / timing.control_period)
            lowering = tick + math.ceil(height / MAX_LOWERING_SPEED / timing.control_period) + 1
            soonest = min(max(swing, lowering), touchdown)
            every = max(round(RESOLUTION / timing.control_period), 1)
            yield Branch(gait, support, np.append(np.arange(touchdown, soonest, -every), soonest))
            return
        begin = tick if phase is Phase.STANDING else begin
        samples = np.arange(timing.samples_per_step, min(self._shortest_step, timing.samples_per_step) - 1, -1)
        for side in (support, support.other):
            yield Branch(gait, side, begin + samples * per_sample)

    def _margins(self, sets: ViableSets, branch: Branch, tick: int, problem_of: ProblemOf) -> Matrix:
        """Margins of the touchdowns of a branch with each duration of the coming steps [m], shape (K, durations)."""
        problem = problem_of(self._gait(branch, tick, 0, 0))
        period, per_sample = self._timing.control_period, self._timing.ticks_per_sample
        to_touchdown = branch.touchdowns - tick
        waiting = round((problem.horizon.time_to_touchdown - problem.horizon.time_in_air) / period)
        ticks = ((to_touchdown - 1) % per_sample + 1, to_touchdown, to_touchdown - waiting)
        landings = Landings(*(np.asarray(period * t, dtype=np.float64) for t in ticks))
        pendulum, com = self._generator.pendulum, problem.com
        yaw = self._generator.next_yaw(problem)
        margins = sets.margins(problem.support, problem.swing, yaw, pendulum.dcm(com), pendulum.cop(com), landings)
        return np.minimum(margins, self._leg_margins(problem, landings.to_touchdown)[:, None])

    def _leg_margins(self, problem: WalkingProblem, to_touchdown: Vector) -> Vector:
        """Changes of the DCM that the leg still bears until each touchdown [m], shape (K,).

        With a constant CoP z the CoM is at z + (c - z) cosh + dc / omega sinh at the touchdown, and has to be no
        farther from the support foot than the leg reaches.
        """
        com, support, omega = problem.com, problem.support, self._generator.pendulum.omega
        cosh, sinh = np.cosh(omega * to_touchdown)[:, None], np.sinh(omega * to_touchdown)[:, None]
        position = (com.position - support.position) * cosh + com.velocity / omega * sinh
        distance = np.hypot(position[:, 0], position[:, 1])
        outward = position / distance[:, None]
        sole = sole_vertices(self._robot.sole, support) - support.position
        held_back = (cosh[:, 0] - 1.0) * np.max(outward @ sole.T, axis=1)
        return (self._robot.max_com_distance - SPARE_LEG - (distance - held_back)) / sinh[:, 0]

    def _gait(self, branch: Branch, tick: int, touchdown: int, duration: int) -> Gait:
        samples_per_step = self._samples_per_step[duration]
        return branch.gait.retimed(tick, int(branch.touchdowns[touchdown]), samples_per_step, branch.support)

    def _margin_of(self, gait: Gait, tick: int, branches: Sequence[Branch], margins: Sequence[Matrix]) -> float:
        """Margin of a gait among the branches [m]; minus infinity if it is none of them."""
        if gait.step(tick) < 0 or gait.samples_per_step not in self._samples_per_step:
            return -math.inf
        found = np.flatnonzero(branches[0].touchdowns == gait.step_ticks(tick)[1])
        return (
            float(margins[0][found[0], self._samples_per_step.index(gait.samples_per_step)])
            if len(found)
            else -math.inf
        )

    def _nearest(self, branches: Sequence[Branch], margins: Sequence[Matrix], tick: int, enough: float) -> Gait | None:
        """The latest touchdown, with the longest steps after it, that leaves more than some margin [m]."""
        for branch, margin in zip(branches, margins, strict=True):
            for duration in range(len(self._samples_per_step)):
                for k in np.flatnonzero(margin[:, duration] > enough)[:1]:
                    return self._gait(branch, tick, int(k), duration)
        return None

    def _deepest(self, branches: Sequence[Branch], margins: Sequence[Matrix], tick: int) -> Choice | None:
        """The touchdown, and the duration of the steps after it, whose viable set holds the DCM deepest inside."""
        own, *others = (float(margin.max()) for margin in margins)
        b = 1 if others and others[0] > own + (SWAP if own > 0.0 else 0.0) else 0
        k, duration = np.unravel_index(int(margins[b].argmax()), margins[b].shape)
        margin = float(margins[b][k, duration])
        return None if margin == -math.inf else Choice(self._gait(branches[b], tick, int(k), int(duration)), margin)
