"""The decision of each tick: how the gait goes on, and the plan of CoM and footholds for it.

The gait on schedule comes first; a robot that has to may begin or end its walk, or, with adaptive step timing, put its
foot down sooner. A robot for which no plan is left falls.
"""

import math
from functools import cache

from walkcore.command import Reference
from walkcore.errors import FallError, NoSolutionFoundError, OutOfTimeError
from walkcore.methods import METHODS, MethodPlans
from walkcore.model import ModelState
from walkcore.mpc.balance_sets import BalanceSets
from walkcore.mpc.gait import Gait
from walkcore.mpc.lipm import Pendulum
from walkcore.mpc.pattern_generator import PatternGenerator
from walkcore.mpc.plan import Plan, Status
from walkcore.mpc.qp import QP
from walkcore.mpc.regions import half_planes
from walkcore.mpc.stance import Side
from walkcore.mpc.step_timing import AdaptiveTiming
from walkcore.mpc.supports import WalkingProblem
from walkcore.parameters import Parameters
from walkcore.robot import Robot
from walkcore.stages import Stages, TimeLeft, unlimited


class Planner:
    """Decides the gait and the plan of each tick. Holds no state of the walk."""

    def __init__(self, robot: Robot, parameters: Parameters, stages: Stages, sets: BalanceSets | None = None) -> None:
        """Compute what stays the same from tick to tick.

        Args:
            robot: to plan for.
            parameters: of the plans.
            stages: get a lap for each part of a decision.
            sets: of `balance_sets` for them, where somebody has computed them beforehand: they take the longest.

        Raises:
            EmptyRegionError: if the CoP margin leaves nothing of a sole.
        """
        self._robot, self._parameters, self._stages = robot, parameters, stages
        generator = self._generator = PatternGenerator(robot, parameters, stages, sets)
        method = METHODS.get(parameters.scheme)
        plans = generator if method is None else MethodPlans(method, robot, parameters, generator, stages)
        self._plan = plans.plan
        compared = generator.sets.compared
        is_fixed = compared is None
        self._step_timing = None if is_fixed else AdaptiveTiming(robot, parameters, generator, compared, stages)

    @property
    def pendulum(self) -> Pendulum:
        """The model that the CoM follows."""
        return self._generator.pendulum

    def decide(
        self, model: ModelState, reference: Reference, last: Plan | None, *, is_pushed: bool, time_left: TimeLeft
    ) -> tuple[Gait, Plan]:
        """The gait from this tick on, and the plan for it.

        Args:
            model: at this tick, after its push.
            reference: that the robot is to follow.
            last: plan of the tick before; None where there was none, or the model has been moved since.
            is_pushed: whether a push has begun at this tick.
            time_left: for the decision [s]. Once it is over, the last plan goes on.

        Raises:
            FallError: if nothing keeps the robot on its feet.
        """
        self._check_within_reach(model)
        walks = self._parameters.stepping_in_place or not reference.is_zero
        candidates = model.gait.candidates(model.tick, walks, _first_support(reference))
        time_left = unlimited if last is None else time_left
        try:
            if self._step_timing is None:
                return self._first_that_works(candidates, model, reference, time_left)

            @cache
            def problem_of(gait: Gait) -> WalkingProblem:
                return self._problem(model, gait, reference)

            return self._step_timing.decide(
                candidates,
                model.tick,
                model.swing_foot.height,
                problem_of,
                is_disturbed=is_pushed or (last is not None and last.status is Status.RELAXED),
                time_left=time_left,
            )
        except OutOfTimeError:
            assert last is not None
            return model.gait, self._generator.continued(last, self._problem(model, model.gait, reference))
        except NoSolutionFoundError as failure:
            raise FallError(f"no step can catch the robot: {failure}") from failure

    def qp(self, model: ModelState, reference: Reference) -> QP:
        """The paper's QP of this tick, if the gait goes on as it is."""
        return self._generator.qp(self._problem(model, model.gait, reference))

    def _check_within_reach(self, model: ModelState) -> None:
        """Fall where no leg reaches, and, in a scheme without constraints, where the CoP leaves the soles."""
        com, foot = model.com, model.support_foot
        distance, limit = math.dist(com.position.tolist(), foot.position.tolist()), self._robot.max_com_distance
        if distance > limit:
            raise FallError(f"the CoM is {distance:.2f} m beside the support foot, the leg reaches {limit:.2f} m")
        if not self._parameters.formulation.is_constrained:
            x, y = cop = self.pendulum.cop(com)
            if half_planes(model.stance(self._robot.sole).corners).excess(cop) > 0.0:
                raise FallError(f"the CoP left the soles at ({x:.3f}, {y:.3f}) m")

    def _first_that_works(
        self, candidates: tuple[Gait, ...], model: ModelState, reference: Reference, time_left: TimeLeft
    ) -> tuple[Gait, Plan]:
        """The first gait whose plan keeps every margin, else the first that does not lead to a fall."""
        plans: list[tuple[Gait, Plan]] = []
        failure: NoSolutionFoundError | None = None
        for gait in candidates:
            try:
                plan = self._plan(self._problem(model, gait, reference), time_left)
            except OutOfTimeError:
                if not plans:
                    raise
                break
            except NoSolutionFoundError as error:
                failure = failure or error
                continue
            plans.append((gait, plan))
            if plan.status is Status.SOLVED:
                break
        if not plans:
            assert failure is not None
            raise failure
        return max(plans, key=lambda choice: _rank(choice[1]))

    def _problem(self, model: ModelState, gait: Gait, reference: Reference) -> WalkingProblem:
        side, horizon = gait.support_side(model.tick), gait.horizon(model.tick)
        support, swing = model.footstep(side), model.footstep(side.other)
        problem = WalkingProblem(model.com, support, swing, horizon, reference, model.heading)
        self._stages.lap("gait")
        return problem


def _rank(plan: Plan) -> tuple[bool, bool, bool]:
    """Rank of a plan: the greatest keeps all margins, then come those that catch the robot, then those with steps."""
    return plan.status is Status.SOLVED, plan.is_capturable, plan.is_capturable or bool(plan.footholds)


def _first_support(reference: Reference) -> Side:
    """The foot that carries the first step: the other one goes where the reference leads."""
    goes_left = reference.vy > 0.0 or (reference.vy == 0.0 and reference.yaw_rate > 0.0)
    return Side.RIGHT if goes_left else Side.LEFT
