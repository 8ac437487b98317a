"""The pattern generator, from the state of the CoM to the plan of two steps: describe, build, solve, read."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from walkcore.cache import instance_cache
from walkcore.command import Reference
from walkcore.errors import NoSolutionFoundError
from walkcore.mpc.balance_sets import BalanceSets, balance_sets
from walkcore.mpc.horizon import StanceSequence
from walkcore.mpc.lipm import PreviewMatrices, tick_preview
from walkcore.mpc.plan import Bounds, Plan, Status
from walkcore.mpc.plan_checks import PlanChecks
from walkcore.mpc.preview import PLANNED, Preview, QPInputs
from walkcore.mpc.qp import QP, SOLVERS, STALLED_GAP, InteriorPointSolver
from walkcore.mpc.stance import Footstep, Stance
from walkcore.mpc.supports import SupportGeometry, WalkingProblem
from walkcore.mpc.walking_qp import PhaseMatrices, WalkingQP, phase_matrices, relaxed_qp, viable_qp, walking_qp
from walkcore.parameters import Parameters
from walkcore.robot import Robot
from walkcore.stages import UNTIMED, Stages, TimeLeft, unlimited
from walkcore.values import Matrix, Vector, freeze

MAX_PROBLEMS = 2  # of one tick, whose QPs are kept: the gait on schedule may be tried again with margins given up
MAX_PHASES = 1024  # a step of 0.8 s at ticks of 5 ms has 160, a start and a stop as many each


class PatternGenerator:
    """Decides the plan of a tick. Holds nothing but what depends on robot and parameters alone."""

    def __init__(
        self, robot: Robot, parameters: Parameters, stages: Stages = UNTIMED, sets: BalanceSets | None = None
    ) -> None:
        """Compute what does not change from tick to tick.

        Args:
            robot: to plan for.
            parameters: of the plans.
            stages: listens to the stages of a plan.
            sets: of `balance_sets` for robot and parameters, where somebody has computed them beforehand.

        Raises:
            EmptyRegionError: if the margin leaves nothing of the sole.
        """
        p = self._parameters = parameters
        self._robot, self._stages = robot, stages
        self.pendulum = robot.pendulum(p)
        self.sets = balance_sets(robot, p) if sets is None else sets
        self.geometry = SupportGeometry(robot, p, self.sets.capture)
        """Polygons of the robot, put where the feet are."""
        self._checks = PlanChecks(self.geometry, self.sets.viable, p.sampling_period)
        self._phase = instance_cache(self._compute_phase, MAX_PHASES)
        self._build = instance_cache(self._compute_walking_qp, MAX_PROBLEMS)
        self._solver, self._relaxed_solver = SOLVERS[p.solver](), InteriorPointSolver(STALLED_GAP)

    def _compute_phase(self, ticks_to_sample: int, stances: StanceSequence, nb_edges: tuple[int, ...]) -> PhaseMatrices:
        p = self._parameters
        lipm = tick_preview(stances.nb_samples, p.sampling_period, ticks_to_sample * p.control_period, self.pendulum)
        preview = Preview(stances, lipm, p.timing.samples_per_step, p.formulation.has_foothold_variables)
        return phase_matrices(preview, p, nb_edges)

    def plan(self, problem: WalkingProblem, time_left: TimeLeft = unlimited) -> Plan:
        """The plan from a CoM state, be it a model's or a measured one.

        Args:
            problem: of this tick.
            time_left: for the decision [s].

        Raises:
            NoSolutionFoundError: if no motion is feasible, not even on the true edges of the soles.
            OutOfTimeError: if the time is over before a plan is found.
        """
        return self.viable_plan(problem, time_left) or self.relaxed_plan(problem, time_left)

    def viable_plan(self, problem: WalkingProblem, time_left: TimeLeft = unlimited) -> Plan | None:
        """The plan of the paper's QP, if it has a solution that does not lead to a fall.

        Args:
            problem: of this tick.
            time_left: for the decision [s].

        Raises:
            OutOfTimeError: if the time is over.
        """
        walking = self._build(problem)
        try:
            solution = self._solver.solve(walking.qp, self._stages, time_left)
        except NoSolutionFoundError:
            return None
        decision = walking.preview.layout.split(solution.u)
        plan = self._read(walking, problem, decision, solution.multipliers, Status.SOLVED)
        is_final = self._parameters.formulation.has_planned_footholds  # no other one is tried
        is_viable = is_final or self._checks.is_viable(plan, walking.supports, problem)
        self._stages.lap("check")
        return plan if is_viable else None

    def recovering_plan(self, problem: WalkingProblem, time_left: TimeLeft = unlimited) -> Plan | None:
        """The plan of the paper's QP, if steps that use part of their regions suffice from the next foothold on.

        Args:
            problem: of this tick.
            time_left: for the decision [s].

        Raises:
            OutOfTimeError: if the time is over.
        """
        plan, supports = self.viable_plan(problem, time_left), self._build(problem).supports
        return plan if plan and self._checks.recovers(plan, supports, problem.horizon.stances) else None

    def continued(self, last: Plan, problem: WalkingProblem) -> Plan:
        """The plan of the tick before, from the CoM state of this one: its jerks and footholds, nothing is solved.

        Args:
            last: plan of the tick before, for the same gait.
            problem: of this tick.
        """
        walking = self._build(problem)
        N, supports = walking.preview.lipm.nb_samples, walking.supports
        is_at_sample = problem.horizon.ticks_to_sample == self._parameters.timing.ticks_per_sample
        jerks = np.zeros((N, 2))
        ahead = last.jerks[int(is_at_sample) :][:N]
        jerks[: len(ahead)] = ahead
        footholds = last.footholds
        if footholds and footholds[0].side is problem.support.side:  # it has landed since
            footholds = footholds[1:]
        positions = self.geometry.planned_footholds(problem, supports)
        for k, foothold in enumerate(footholds[: len(positions)]):
            positions[k] = foothold.position
        nothing_active = np.zeros(len(walking.point_of_row))
        plan = self._read(walking, problem, (jerks, positions), nothing_active, Status.RELAXED)
        return replace(plan, is_capturable=last.is_capturable, is_continued=True)

    def corrected_plan(self, problem: WalkingProblem, time_left: TimeLeft = unlimited) -> Plan | None:
        """The plan of the paper's QP with one more set of rows: on the next foothold the DCM is viable.

        Args:
            problem: of this tick.
            time_left: for the decision [s].

        Returns:
            None if that has no solution, or no foothold lies within the horizon.

        Raises:
            OutOfTimeError: if the time is over.
        """
        walking = self._within_flight(self._build(problem), problem)
        qp = viable_qp(walking)
        if qp is None:
            return None
        try:
            solution = self._solver.solve(qp, self._stages, time_left)
        except NoSolutionFoundError:
            return None
        decision = walking.preview.layout.split(solution.u)
        multipliers = solution.multipliers[: len(walking.point_of_row)]
        plan = self._read(walking, problem, decision, multipliers, Status.RELAXED)
        self._stages.lap("check")
        return plan

    def relaxed_plan(self, problem: WalkingProblem, time_left: TimeLeft = unlimited) -> Plan:
        """The plan of the relaxed QP.

        Args:
            problem: of this tick.
            time_left: for the decision [s].

        Raises:
            NoSolutionFoundError: if no motion is feasible, not even on the true edges of the soles.
            OutOfTimeError: if the time is over.
        """
        walking = self._within_flight(self._build(problem), problem)
        relaxed = relaxed_qp(walking, self._parameters.cop_margin)
        solution = self._relaxed_solver.solve(relaxed.qp, self._stages, time_left)
        multipliers = relaxed.row_multipliers(solution.multipliers)[: len(walking.point_of_row)]
        decision = walking.preview.layout.split(solution.u)
        plan = self._read(walking, problem, decision, multipliers, Status.RELAXED)
        is_capturable = self._checks.is_capturable(plan, walking.supports, problem.horizon.stances)
        self._stages.lap("check")
        return replace(plan, is_capturable=is_capturable)

    def _within_flight(self, walking: WalkingQP, problem: WalkingProblem) -> WalkingQP:
        """The same QP, in which the rest of a double support does not count as flight (30)."""
        horizon = problem.horizon
        waiting = horizon.time_to_touchdown - horizon.time_in_air
        return walking.with_more_reach(-self.geometry.reach(waiting)) if waiting > 0.0 else walking

    def next_yaw(self, problem: WalkingProblem) -> float:
        """Yaw of the next foothold [rad]."""
        return self.geometry.next_yaw(problem)

    def qp(self, problem: WalkingProblem) -> QP:
        """The paper's QP that `plan` solves first."""
        return self._build(problem).qp

    def _compute_walking_qp(self, problem: WalkingProblem) -> WalkingQP:
        supports, horizon = self.geometry.supports(problem), problem.horizon
        phase = self._phase(horizon.ticks_to_sample, horizon.stances, supports.nb_edges)
        if self._parameters.formulation.has_planned_footholds:
            planned = self.geometry.planned_footholds(problem, supports)
        else:
            planned = np.zeros((horizon.stances.nb_footholds, 2))
        inputs = QPInputs(
            problem.com,
            problem.support.position,
            problem.swing.position,
            supports.to_middle,
            planned,
            _velocities(problem.reference, problem.heading, phase.preview.lipm),
        )
        return walking_qp(phase, supports, self.geometry.reach(horizon.time_to_touchdown), inputs)

    def _read(
        self,
        walking: WalkingQP,
        problem: WalkingProblem,
        decision: tuple[Matrix, Matrix],
        multipliers: Vector,
        status: Status,
    ) -> Plan:
        """The plan that jerks and footholds stand for; whether it is capturable is not known yet."""
        supports, layout, stances = walking.supports, walking.preview.layout, problem.horizon.stances
        jerks, positions = decision
        if not layout.has_foothold_variables:
            positions = walking.inputs[PLANNED : PLANNED + layout.nb_footholds]
        if supports.stopping_offset is not None:
            last = positions[-1] if len(positions) else problem.support.position
            positions = np.vstack([positions, last + supports.stopping_offset])
        footholds = tuple(map(Footstep, supports.sides, freeze(positions), supports.yaws))
        com, dcm, cop = walking.preview.lipm.trajectories(problem.com, jerks)
        return Plan(
            times=walking.preview.lipm.times,
            jerks=freeze(jerks),
            com=com,
            dcm=dcm,
            cop=cop,
            footholds=footholds,
            stances=self.stances(problem, footholds),
            stance_of_sample=stances.stance_of_sample,
            samples_on_support=stances.samples_on_support,
            regions=supports.region_vertices,
            bounds=Bounds(walking.point_of_row, walking.normal_of_row, multipliers),
            status=status,
            is_capturable=True,
        )

    def stances(self, problem: WalkingProblem, footholds: tuple[Footstep, ...]) -> tuple[Stance, ...]:
        """The stances of the horizon, by the numbers of `stance_of_sample`."""
        sole, stances = self._robot.sole, problem.horizon.stances
        feet = (problem.support, *footholds)
        single = [Stance((foot,), sole) for foot in feet[: 1 + stances.nb_footholds]]
        if not stances.has_double_support:
            return tuple(single)
        both = (feet[-1], feet[-2]) if stances.is_stopping else (problem.support, problem.swing)
        return (*single, Stance(both, sole))


@lru_cache(maxsize=256)  # straight ahead, the ticks of a step pass the same headings and times
def _velocities(reference: Reference, heading: float, lipm: PreviewMatrices) -> Matrix:
    """The velocity to track at each sample: it turns with the heading [m/s], world frame, shape (N, 2)."""
    yaw = heading + reference.yaw_rate * lipm.times
    c, s = np.cos(yaw), np.sin(yaw)
    velocities = np.empty((lipm.nb_samples, 2))
    velocities[:, 0] = c * reference.vx - s * reference.vy
    velocities[:, 1] = s * reference.vx + c * reference.vy
    return freeze(velocities)
