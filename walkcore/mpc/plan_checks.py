"""Whether further steps can catch the robot that follows a plan: what the rows of its QP do not hold."""

import numpy as np

from walkcore.mpc.horizon import SampleStance, StanceSequence
from walkcore.mpc.plan import Plan
from walkcore.mpc.regions import HalfPlanes
from walkcore.mpc.supports import SupportGeometry, Supports, WalkingProblem
from walkcore.mpc.viability import Landings, ViableSets
from walkcore.values import Vector, rotation

CAPTURE_TOLERANCE = 1e-6  # [m]


class PlanChecks:
    """Checks plans for one robot with one set of parameters; see `Supports` for the sets of the DCM."""

    def __init__(self, geometry: SupportGeometry, viable: ViableSets, sampling_period: float) -> None:
        """Take what does not change from tick to tick.

        Args:
            geometry: polygons of the robot.
            viable: sets of the DCM for a foot in the air that lands at any time.
            sampling_period: T [s].
        """
        self._geometry, self._viable, self._sampling_period = geometry, viable, sampling_period

    def is_viable(self, plan: Plan, supports: Supports, problem: WalkingProblem) -> bool:
        """Whether further steps can catch the robot from the next sample and from the first one on the next foothold.

        And whether the foot gets there in the time that it has in the air, and a stop ends in a stand. The end of the
        plan is not checked: later ticks correct it.

        Args:
            plan: of this tick.
            supports: polygons of its horizon.
            problem: that it solves.
        """
        stances, viable = problem.horizon.stances, supports.viable_at_next_sample
        if viable is not None and not _holds(viable, plan.dcm[0] - _centre(plan, stances.first)):
            return False
        if not self._flies_in_time(plan, problem):
            return False
        if supports.stopping_offset is not None:
            return _holds(supports.terminal_set_tight, plan.dcm[-1] - _centre(plan, stances.last))
        viable = supports.viable_on_foothold
        return viable is None or _holds_on_foothold(viable, plan, stances) or self._is_viable_in_flight(plan, problem)

    def _flies_in_time(self, plan: Plan, problem: WalkingProblem) -> bool:
        """Whether the foot gets to its foothold in the time that it has in the air: (30) allows it more."""
        horizon = problem.horizon
        if not horizon.time_in_air < horizon.time_to_touchdown or not plan.footholds:
            return True
        flight = (plan.footholds[0].position - problem.swing.position) @ rotation(problem.support.yaw)
        return bool(np.all(np.abs(flight) < self._geometry.reach(horizon.time_in_air) + CAPTURE_TOLERANCE))

    def _is_viable_in_flight(self, plan: Plan, problem: WalkingProblem) -> bool:
        """Whether steps can catch the robot from a sample on, the first one no farther than the foot can fly.

        The sample is the next one, or, of a robot that stands before its first step, the last one on both feet: over
        the period after it the CoP goes from where it is then to the support foot.
        """
        horizon, stances, T = problem.horizon, problem.horizon.stances, self._sampling_period
        sample = max(int(np.argmin(stances.is_double_support)) - 1, 0)
        landing = Landings(
            to_sample=np.array([T if stances.is_double_support[sample] else 0.0]),
            to_touchdown=np.array([stances.samples_to_touchdown[sample] * T]),
            in_air=np.array([horizon.time_in_air]),
        )
        yaw, dcm, cop = plan.footholds[0].yaw, plan.dcm[sample], plan.cop[sample]
        margins = self._viable.margins(problem.support, problem.swing, yaw, dcm, cop, landing)
        return bool(margins[0, 0, 0] > -CAPTURE_TOLERANCE)

    @staticmethod
    def recovers(plan: Plan, supports: Supports, stances: StanceSequence) -> bool:
        """Whether steps that use part of their regions catch the robot from the next foothold on.

        Args:
            plan: of this tick.
            supports: polygons of its horizon.
            stances: of its samples.
        """
        viable = supports.viable_on_foothold_tight
        return viable is None or _holds_on_foothold(viable, plan, stances)

    @staticmethod
    def is_capturable(plan: Plan, supports: Supports, stances: StanceSequence) -> bool:
        """Whether further steps can catch the robot from the end of the plan, without any margin.

        Args:
            plan: of this tick.
            supports: polygons of its horizon.
            stances: of its samples.
        """
        return _holds(supports.terminal_set_on_whole_soles, plan.dcm[-1] - _centre(plan, stances.last))


def _holds(dcms: HalfPlanes, dcm: Vector) -> bool:
    """Whether a set holds a DCM, which is relative to its centre [m], shape (2,)."""
    return dcms.excess(dcm) < CAPTURE_TOLERANCE


def _holds_on_foothold(dcms: HalfPlanes, plan: Plan, stances: StanceSequence) -> bool:
    """Whether a set around the next foothold holds the DCM of the first sample on it; true where there is none."""
    sample = stances.sample_on_foothold
    return sample is None or _holds(dcms, plan.dcm[sample] - plan.footholds[0].position)


def _centre(plan: Plan, sample: SampleStance) -> Vector:
    """Centre of the stance of a sample, world frame [m], shape (2,)."""
    return plan.stances[-1].centre if sample.is_double_support else plan.stances[sample.foot].feet[0].position
