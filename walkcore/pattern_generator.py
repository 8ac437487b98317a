"""From the state of the CoM to the motion of the coming two steps: describe, build, solve, read."""

import math
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from walkcore.command import Reference
from walkcore.errors import NoSolutionFoundError
from walkcore.gait import Footstep, Horizon
from walkcore.lipm import CoMState, PreviewMatrices, preview_matrices
from walkcore.parameters import Parameters
from walkcore.preview import Preview
from walkcore.qp import QP, solve_qp
from walkcore.robot import Robot
from walkcore.schemes import Footholds
from walkcore.stages import UNTIMED, Stages
from walkcore.supports import SupportGeometry
from walkcore.values import Matrix, Vector, read_only
from walkcore.walking_qp import build_qp, rescue_qp

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
        self._lipm = {ticks: self._matrices(ticks) for ticks in range(1, p.ticks_per_sample + 1)}

    def _matrices(self, ticks_to_sample: int) -> PreviewMatrices:
        p = self._parameters
        intervals = np.full(p.horizon_samples, p.sampling_period)
        intervals[0] = ticks_to_sample * p.control_period
        return preview_matrices(intervals, self.com_height, p.gravity)

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
        supports = self._geometry.supports(support, swing, horizon, reference)
        preview = Preview(com, supports, self._lipm[horizon.ticks_to_sample])
        problem = build_qp(preview, _velocities(reference, heading, preview.lipm.times), self._parameters)
        self._stages.lap("assemble")
        u, status, is_capturable = self._solve(problem, preview)
        self._stages.lap("solve")

        lipm, layout = preview.lipm, preview.layout
        jerks = layout.jerks(u)
        decided = layout.footholds(u) if layout.nb_footholds else supports.planned_footholds
        if supports.stopping_offset is not None:
            last = np.vstack([support.position, decided])[-1]
            decided = np.vstack([decided, last + supports.stopping_offset])
        return Plan(
            times=lipm.times,
            jerks=read_only(jerks),
            com=read_only(lipm.Pps @ com.matrix + lipm.Ppu @ jerks),
            cop=read_only(lipm.Pzs @ com.matrix + lipm.Pzu @ jerks),
            footholds=tuple(map(Footstep, supports.sides, decided, supports.yaws)),
            status=status,
            is_capturable=is_capturable,
        )

    def _solve(self, problem: QP, preview: Preview) -> tuple[Vector, Status, bool]:
        """The paper's QP; where it has no solution or leads to a fall, one that gives up the margin to stay up.

        A scheme whose footholds the QP may not choose is left to fail as the paper says it does.

        Raises:
            NoSolutionFoundError: if nothing is feasible.
        """
        scheme, u = self._parameters.terms, None
        with suppress(NoSolutionFoundError):
            u = solve_qp(problem).u
            if scheme.footholds is not Footholds.FREE or self._leads_on(preview, u):
                return u, Status.SOLVED, True
        supports, end = preview.supports, preview.dcm(-1, self.omega)
        rescue = rescue_qp(problem, preview, self._parameters.cop_margin, end, supports.spare_at_end)
        u = solve_qp(rescue).u
        is_capturable = supports.capturable_at_end.excess(end.at(preview.layout.axes(u))[0]) < CAPTURE_TOLERANCE
        return u, Status.RELAXED, is_capturable

    def _leads_on(self, preview: Preview, u: Vector) -> bool:
        """Whether further steps can catch the robot one sample from now, and whether a stop ends in a stand.

        Not whether they could at the end of the plan: the QP is careless about that, and in time to correct it.
        """
        supports, axes = preview.supports, preview.layout.axes(u)
        soon, end = (preview.dcm(n, self.omega).at(axes)[0] for n in (0, -1))
        is_caught = supports.capturable_soon is None or supports.capturable_soon.excess(soon) < CAPTURE_TOLERANCE
        stands = supports.stopping_offset is None or supports.spare_at_end.excess(end) < CAPTURE_TOLERANCE
        return is_caught and stands


def _velocities(reference: Reference, heading: float, times: Vector) -> Matrix:
    """The velocity to track at each sample: it turns with the heading [m/s], world frame, shape (N, 2)."""
    yaw = heading + reference.yaw_rate * times
    c, s = np.cos(yaw), np.sin(yaw)
    return np.column_stack([c * reference.vx - s * reference.vy, s * reference.vx + c * reference.vy])
