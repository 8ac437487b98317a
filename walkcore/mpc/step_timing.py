"""Adaptive step timing: a robot that is threatened puts its foot down sooner.

The least change comes first:

    1. the paper's QP on schedule
    2. the same with more rows: at the first sample on the next foothold the DCM is viable, and the feet fly in time
    3. the nearest sooner touchdown, with the coming steps 0.8, 0.6, 0.5 or 0.4 s long, that leaves a margin
    4. the touchdown that leaves most, with margins of the CoP given up

Touchdowns are compared by how far the present DCM lies inside the viable set of each (`touchdowns.py`), so that seldom
more than two QPs are solved. Back to the usual step as soon as that is safe.

Koolen et al. 2012; Khadiv et al. 2016, 2020; Bohorquez and Wieber 2017.
"""

from collections.abc import Iterator, Sequence

from walkcore.errors import NoSolutionFoundError
from walkcore.mpc.balance_sets import CAREFUL, USUAL, UTMOST
from walkcore.mpc.gait import Gait
from walkcore.mpc.pattern_generator import PatternGenerator
from walkcore.mpc.plan import Plan
from walkcore.mpc.supports import WalkingProblem
from walkcore.mpc.touchdowns import ProblemOf, TouchdownComparison, Touchdowns
from walkcore.mpc.viability import ViableSets
from walkcore.parameters import Parameters
from walkcore.robot import Robot
from walkcore.stages import UNTIMED, Stages, TimeLeft, unlimited

ENOUGH = 0.02  # [m] inside a viable set, from which on a later touchdown is better than a deeper one
HYSTERESIS = 0.005  # [m] by which the DCM has to lie deeper inside a viable set for a change of the touchdown
SAFE = 0.010  # [m] inside the viable set of the usual step, to return to it
LOST = 0.003  # [m] outside of a viable set, from where on no plan leads into it. Between samples the CoP leaves its
# polygon by up to T^2/8 ddc, 4.5 mm where it is 0.3 m from the CoM, and by two thirds of that over the whole time


class AdaptiveTiming:
    """Chooses when the step under way ends, and how long those after it take."""

    def __init__(
        self,
        robot: Robot,
        parameters: Parameters,
        generator: PatternGenerator,
        sets: ViableSets,
        stages: Stages = UNTIMED,
    ) -> None:
        """Take what stays the same from tick to tick.

        Args:
            robot: to plan for.
            parameters: of the plans.
            generator: for that robot and these parameters.
            sets: by which touchdowns are compared, see `BalanceSets`.
            stages: gets a lap for the comparison of touchdowns ("timing").
        """
        self._usual, self._generator, self._stages = parameters.timing.samples_per_step, generator, stages
        self._comparison = TouchdownComparison(robot, parameters, generator, sets)

    def decide(
        self,
        gaits: Sequence[Gait],
        tick: int,
        height: float,
        problem_of: ProblemOf,
        *,
        is_disturbed: bool = False,
        time_left: TimeLeft = unlimited,
    ) -> tuple[Gait, Plan]:
        """The gait of this tick and its plan.

        Args:
            gaits: that may follow as scheduled, the preferred one first, see `Gait.candidates`.
            tick: now.
            height: of the foot in the air [m].
            problem_of: the walking problem with some gait.
            is_disturbed: whether the QP on schedule is likely to fail, after a push or a tick at which it has. Then
                it is seen first whether it is sure to, which saves the solve; no decision depends on it.
            time_left: for the decision [s].

        Raises:
            NoSolutionFoundError: if no motion is feasible, not even on the true edges of the soles.
            OutOfTimeError: if the time is over before a plan is found.
        """
        generator, walk_on = self._generator, gaits[-1]
        touchdowns = Touchdowns(self._comparison, walk_on, tick, height, problem_of)
        if not (is_disturbed and self._is_lost(touchdowns, problem_of(walk_on), walk_on, tick)):
            for gait in (*self._restored(touchdowns, walk_on), *gaits):
                make = generator.viable_plan if gait.samples_per_step >= self._usual else generator.recovering_plan
                plan = make(problem_of(gait), time_left)
                if plan is not None:
                    return gait, plan
        margin = touchdowns.on_schedule(CAREFUL)
        enough = min(ENOUGH, touchdowns.most(CAREFUL)) - HYSTERESIS
        self._stages.lap("timing")
        if margin > max(enough, 0.0):
            plan = generator.corrected_plan(problem_of(walk_on), time_left)
            if plan is not None:
                return walk_on, plan
        sooner = touchdowns.least_change(CAREFUL, max(enough, HYSTERESIS))
        if sooner is not None:
            plan = generator.corrected_plan(problem_of(sooner), time_left)
            if plan is not None:
                return sooner, plan
        failure: NoSolutionFoundError | None = None
        for gait in self._last_resorts(touchdowns, walk_on):
            try:
                return gait, generator.relaxed_plan(problem_of(gait), time_left)
            except NoSolutionFoundError as error:
                failure = failure or error
        assert failure is not None
        raise failure

    def _is_lost(self, touchdowns: Touchdowns, problem: WalkingProblem, on_schedule: Gait, tick: int) -> bool:
        """Whether no plan of the QP on schedule, or with the usual steps again, can do."""
        if on_schedule.step(tick) < 0:
            return False
        is_short = on_schedule.samples_per_step != self._usual
        needs_part = is_short and problem.horizon.stances.sample_on_foothold is not None  # see `recovering_plan`
        margin = touchdowns.on_schedule(CAREFUL if needs_part else USUAL)
        is_lost = -float("inf") < margin < -LOST and not (is_short and touchdowns.as_usual(CAREFUL).margin > SAFE)
        self._stages.lap("timing")
        return is_lost

    def _restored(self, touchdowns: Touchdowns, gait: Gait) -> Iterator[Gait]:
        """The gait with steps of the usual duration again, if that is safe."""
        if gait.retiming is None or gait.start is None or gait.samples_per_step == self._usual:
            return
        choice = touchdowns.as_usual(CAREFUL)
        self._stages.lap("timing")
        if choice.margin > SAFE:
            yield choice.gait

    def _last_resorts(self, touchdowns: Touchdowns, on_schedule: Gait) -> list[Gait]:
        """Gaits for which margins are given up, the preferred one first."""
        best, margin = touchdowns.deepest(UTMOST), touchdowns.on_schedule(UTMOST)
        self._stages.lap("timing")
        if best is None:
            return [on_schedule]
        return [on_schedule, best.gait] if best.margin < margin + HYSTERESIS else [best.gait, on_schedule]
