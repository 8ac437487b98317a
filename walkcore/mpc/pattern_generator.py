"""From the state of the CoM to the motion of the coming two steps: describe, build, solve, read."""

import math
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache

import numpy as np

from walkcore.cache import kept
from walkcore.command import Reference
from walkcore.errors import NoSolutionFoundError
from walkcore.mpc.gait import Footstep, Horizon
from walkcore.mpc.lipm import CoMState, PreviewMatrices, preview_matrices
from walkcore.mpc.preview import Known, LinearPoints, Preview
from walkcore.mpc.qp import QP, solve_qp
from walkcore.mpc.schemes import Footholds
from walkcore.mpc.supports import SupportGeometry, Supports
from walkcore.mpc.walking_qp import WalkingQP
from walkcore.parameters import Parameters
from walkcore.robot import Robot
from walkcore.stages import UNTIMED, Stages
from walkcore.values import Matrix, Vector, frozen, read_only

MAX_PHASES = 1024  # kept; a step of 0.8 s at ticks of 5 ms has 160, a start and a stop as many each
CAPTURE_TOLERANCE = 1e-6  # [m]


class Status(IntEnum):
    """What became of a tick; numbered as in a recording."""

    SOLVED = 0
    RELAXED = 1
    FALLEN = 2


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """What the QP decided at one tick, in the world frame."""

    times: Vector
    """From the present to each sample [s], shape (N,)."""
    jerks: Matrix
    """Over each interval [m/s^3], shape (N, 2)."""
    com: Matrix
    """CoM at each sample [m], shape (N, 2)."""
    cop: Matrix
    """CoP at each sample [m], shape (N, 2)."""
    footholds: tuple[Footstep, ...]
    """Those on which some sample stands, in the order of their touchdowns."""
    status: Status
    is_capturable: bool
    """Whether further steps can catch the robot where the plan ends."""


@dataclass(frozen=True, slots=True, eq=False)
class _Phase:
    """What all ticks at one phase of the gait share."""

    preview: Preview
    qp: WalkingQP
    first_dcm: LinearPoints
    """Divergent component of motion at the first sample."""
    last_dcm: LinearPoints
    """At the last one."""


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    """What one tick has to solve."""

    phase: _Phase
    supports: Supports
    known: Matrix
    """k of `preview.py`, shape (6 + m + N, 2)."""


class PatternGenerator:
    """Decides the plan of a tick. Holds nothing but what depends on robot and parameters alone."""

    def __init__(self, robot: Robot, parameters: Parameters, stages: Stages = UNTIMED) -> None:
        """Compute what does not change from tick to tick.

        Raises:
            EmptyRegionError: if the margin leaves nothing of the sole.
        """
        p = self._parameters = parameters
        self._stages = stages
        self.com_height = robot.com_height if p.com_height is None else p.com_height
        self.omega = math.sqrt(p.gravity / self.com_height)
        self._geometry = SupportGeometry(robot, p, self.com_height)
        self._phase = kept(self._compute_phase, MAX_PHASES)
        self._lipm = {ticks: self._matrices(ticks) for ticks in range(1, p.ticks_per_sample + 1)}

    def _matrices(self, ticks_to_sample: int) -> PreviewMatrices:
        p = self._parameters
        intervals = np.full(p.horizon_samples, p.sampling_period)
        intervals[0] = ticks_to_sample * p.control_period
        return preview_matrices(intervals, self.com_height, p.gravity)

    def _compute_phase(self, horizon: Horizon) -> _Phase:
        p = self._parameters
        are_footholds_free = p.terms.footholds is not Footholds.PLANNED
        preview = Preview(horizon, self._lipm[horizon.ticks_to_sample], are_footholds_free)
        return _Phase(preview, WalkingQP(preview, p), preview.dcm(0, self.omega), preview.dcm(-1, self.omega))

    def plan(
        self, com: CoMState, support: Footstep, swing: Footstep, horizon: Horizon, reference: Reference, heading: float
    ) -> Plan:
        """The plan from a CoM state, be it a model's or a measured one.

        Args:
            com: at this tick, after any push.
            support: foot that the QP holds fixed.
            swing: the other foot, where it is now.
            horizon: supports of the samples to come.
            reference: velocity asked, in the heading frame.
            heading: of the robot in the world [rad].

        Raises:
            NoSolutionFoundError: if no motion is feasible, not even on the true edges of the soles.
        """
        task = self._describe(com, support, swing, horizon, reference, heading)
        u, status, is_capturable = self._solve(task)
        self._stages.lap("check")

        lipm, layout, supports = task.phase.preview.lipm, task.phase.preview.layout, task.supports
        jerks = np.ascontiguousarray(layout.jerks(u))
        decided = frozen(layout.footholds(u)) if layout.nb_footholds else supports.planned_footholds
        if supports.stopping_offset is not None:
            last = np.vstack([support.position, decided])[-1]
            decided = np.vstack([decided, last + supports.stopping_offset])
        return Plan(
            times=lipm.times,
            jerks=frozen(jerks),
            com=frozen(lipm.Pps @ com.matrix + lipm.Ppu @ jerks),
            cop=frozen(lipm.Pzs @ com.matrix + lipm.Pzu @ jerks),
            footholds=tuple(map(Footstep, supports.sides, decided, supports.yaws)),
            status=status,
            is_capturable=is_capturable,
        )

    def qp(
        self, com: CoMState, support: Footstep, swing: Footstep, horizon: Horizon, reference: Reference, heading: float
    ) -> QP:
        """The paper's QP that `plan` solves first."""
        task = self._describe(com, support, swing, horizon, reference, heading)
        return task.phase.qp.at(task.known, task.supports)

    def _describe(
        self, com: CoMState, support: Footstep, swing: Footstep, horizon: Horizon, reference: Reference, heading: float
    ) -> _Task:
        phase = self._phase(horizon)
        supports = self._geometry.supports(support, swing, horizon, reference)
        velocities = _velocities(reference, heading, phase.preview.lipm)
        to_middle, planned = supports.to_middle, supports.planned_footholds
        known = Known(com, support.position, swing.position, to_middle, planned, velocities)
        return _Task(phase, supports, known.matrix)

    def _solve(self, task: _Task) -> tuple[Vector, Status, bool]:
        """The paper's QP; where it has no solution or leads to a fall, one that gives up the margin to stay up.

        A scheme whose footholds the QP may not choose is left to fail as the paper says it does.

        Raises:
            NoSolutionFoundError: if nothing is feasible.
        """
        phase, supports, known, axes = task.phase, task.supports, task.known, task.phase.preview.layout.axes
        with suppress(NoSolutionFoundError):
            u = solve_qp(phase.qp.at(known, supports), self._parameters.solver, self._stages).u
            if self._parameters.terms.footholds is not Footholds.FREE or _leads_on(task, axes(u)):
                return u, Status.SOLVED, True
        rescue = phase.qp.rescue_at(known, supports, self._parameters.cop_margin, phase.last_dcm)
        u = solve_qp(rescue, stages=self._stages).u
        end = phase.last_dcm.at(axes(u), known)[0]
        return u, Status.RELAXED, supports.capturable_at_end.excess(end) < CAPTURE_TOLERANCE


def _leads_on(task: _Task, axes: Matrix) -> bool:
    """Whether further steps can catch the robot one sample from now, and whether a stop ends in a stand.

    Not whether they could at the end of the plan: the QP is careless about that, and in time to correct it.
    """
    phase, supports, known = task.phase, task.supports, task.known
    if supports.capturable_soon is not None:
        soon = phase.first_dcm.at(axes, known)[0]
        if supports.capturable_soon.excess(soon) >= CAPTURE_TOLERANCE:
            return False
    if supports.stopping_offset is None:
        return True
    return supports.spare_at_end.excess(phase.last_dcm.at(axes, known)[0]) < CAPTURE_TOLERANCE


@lru_cache(maxsize=256)
def _velocities(reference: Reference, heading: float, lipm: PreviewMatrices) -> Matrix:
    """The velocity to track at each sample: it turns with the heading [m/s], world frame, shape (N, 2)."""
    yaw = heading + reference.yaw_rate * lipm.times
    c, s = np.cos(yaw), np.sin(yaw)
    return read_only(np.column_stack([c * reference.vx - s * reference.vy, s * reference.vx + c * reference.vy]))
