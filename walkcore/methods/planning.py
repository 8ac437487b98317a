"""From the decision of a method without a QP to the plan that the rest of the robot reads.

The CoP of a tick t is reached at its end by the jerk

    j = (z - c - dc t - ddc t^2 / 2 + h / g ddc) / (t^3 / 6 - h / g t)                   from (4) and (5)

so that the model's CoP goes from one decision to the next within a tick.
"""

from functools import lru_cache

import numpy as np

from walkcore.methods.method import Method
from walkcore.methods.situation import Situation, situation
from walkcore.mpc.balance_sets import capture_sets
from walkcore.mpc.lipm import CoMState, Pendulum, tick_preview
from walkcore.mpc.pattern_generator import PatternGenerator
from walkcore.mpc.plan import NO_BOUNDS, Plan, Status
from walkcore.mpc.plan_checks import CAPTURE_TOLERANCE
from walkcore.mpc.regions import inset_vertices
from walkcore.mpc.stance import convex_hull
from walkcore.mpc.supports import Supports, WalkingProblem
from walkcore.parameters import Parameters
from walkcore.robot import Robot
from walkcore.stages import Stages, TimeLeft, unlimited
from walkcore.values import Matrix, Vector, freeze


class MethodPlans:
    """Plans of a method without a QP; takes the place of a `PatternGenerator`'s. Holds no state of the walk."""

    def __init__(
        self, method: Method, robot: Robot, parameters: Parameters, generator: PatternGenerator, stages: Stages
    ) -> None:
        """Compute what does not change from tick to tick.

        Args:
            method: that decides.
            robot: to plan for.
            parameters: of the plans.
            generator: for the same robot and parameters.
            stages: gets a lap for each part of a plan.
        """
        self._method, self._robot, self._parameters, self._stages = method, robot, parameters, stages
        self._generator = generator
        self._inner_sole = convex_hull(inset_vertices(robot.sole, parameters.cop_margin))

    def plan(self, problem: WalkingProblem, time_left: TimeLeft = unlimited) -> Plan:
        """The plan from a CoM state.

        Args:
            problem: of this tick.
            time_left: is not needed: nothing is solved.
        """
        p, horizon, pendulum = self._parameters, problem.horizon, self._generator.pendulum
        geometry = self._generator.geometry
        supports = geometry.supports(problem)
        now = situation(problem, supports, geometry, self._robot, p, pendulum, self._inner_sole)
        nb_samples, time_to_sample = horizon.stances.nb_samples, horizon.ticks_to_sample * p.control_period
        lipm = tick_preview(nb_samples, p.sampling_period, time_to_sample, pendulum)
        self._stages.lap("assemble")
        decision = self._method.decide(now, p.control_period, lipm.times)
        self._stages.lap("solve")
        jerks: Matrix = np.linalg.solve(lipm.Pzu, decision.cops - lipm.Pzs @ problem.com.matrix).astype(np.float64)
        com, dcm, cop = lipm.trajectories(problem.com, jerks)
        footholds = decision.steps.footholds[: len(supports.sides)]
        keeps_margin = now.margin(decision.cop, p.control_period) > p.cop_margin - CAPTURE_TOLERANCE
        plan = Plan(
            times=lipm.times,
            jerks=freeze(jerks),
            com=com,
            dcm=dcm,
            cop=cop,
            footholds=footholds,
            stances=self._generator.stances(problem, footholds),
            stance_of_sample=horizon.stances.stance_of_sample,
            samples_on_support=horizon.stances.samples_on_support,
            regions=supports.region_vertices,
            bounds=NO_BOUNDS,
            status=Status.SOLVED if keeps_margin else Status.RELAXED,
            is_capturable=self._is_capturable(dcm, now, supports, problem),
            tick_jerk=jerk_to_cop(problem.com, decision.cop, p.control_period, pendulum),
        )
        self._stages.lap("check")
        return plan

    def _is_capturable(self, dcm: Matrix, now: Situation, supports: Supports, problem: WalkingProblem) -> bool:
        """Whether some steps can catch the robot from where this method brings it by the next sample on one foot.

        Args:
            dcm: forecast at the samples [m], shape (N, 2).
            now: the situation.
            supports: of the horizon.
            problem: of this tick.
        """
        stances, support = problem.horizon.stances, problem.support
        if stances.is_double_support.all():
            middle = (support.position + problem.swing.position) / 2
            return supports.terminal_set_on_whole_soles.excess(dcm[0] - middle) < CAPTURE_TOLERANCE
        sample = int(np.argmin(stances.is_double_support))
        if stances.foot_of_sample[sample] > 0:  # the support foot carries no sample of the horizon any longer
            support = now.footholds[int(stances.foot_of_sample[sample]) - 1]
        sets = capture_sets(self._robot, self._parameters, problem.horizon.step_duration).on_whole_soles[support.side]
        catchable = sets[min(int(stances.samples_to_touchdown[sample]), len(sets) - 1)].rotated(support.yaw)
        return catchable.excess(dcm[sample] - support.position) < CAPTURE_TOLERANCE


def jerk_to_cop(com: CoMState, cop: Vector, tick: float, pendulum: Pendulum) -> Vector:
    """The jerk that brings the CoP to a place at the end of a tick [m/s^3], shape (2,).

    Args:
        com: at the beginning of the tick.
        cop: wanted at its end [m], shape (2,).
        tick: its duration [s].
        pendulum: that the CoM follows.
    """
    drifted, per_jerk = _cop_after(tick, pendulum)
    return freeze((cop - drifted @ com.matrix) / per_jerk)


@lru_cache(maxsize=16)
def _cop_after(t: float, pendulum: Pendulum) -> tuple[Vector, float]:
    """Maps from the state, shape (3,), and from the jerk to the CoP after a time t [s]."""
    compliance = pendulum.height / pendulum.gravity
    return np.array([1.0, t, t**2 / 2 - compliance]), t**3 / 6 - compliance * t
