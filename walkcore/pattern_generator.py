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
from walkcore.qp import QP, solve_qp
from walkcore.robot import Robot
from walkcore.supports import SupportGeometry, Supports
from walkcore.values import Matrix, Vector, read_only
from walkcore.walking_qp import AffinePoint, Layout, Weights, build_qp, dcm, keep_inside, soften_margin

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

    def __init__(self, robot: Robot, parameters: Parameters) -> None:
        """Compute what does not change from tick to tick.

        Raises:
            EmptyRegionError: if the margin leaves nothing of the sole.
        """
        p = self._parameters = parameters
        self.com_height = robot.com_height if p.com_height is None else p.com_height
        self._omega = math.sqrt(p.gravity / self.com_height)
        self._weights = Weights(p.alpha, p.beta, p.gamma)
        self._geometry = SupportGeometry(robot, p, self.com_height)
        self._previews = {ticks: self._preview(ticks) for ticks in range(1, p.ticks_per_sample + 1)}

    def _preview(self, ticks_to_sample: int) -> PreviewMatrices:
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
        preview = self._previews[horizon.ticks_to_sample]
        supports = self._geometry.supports(support, swing, horizon, reference.yaw_rate)
        problem = build_qp(com, supports, _velocities(reference, heading, preview.times), preview, self._weights)
        u, status, is_capturable = self._solve(
            problem, supports, [dcm(com, supports, preview, self._omega, n) for n in (0, -1)]
        )

        layout = Layout.of(supports)
        jerks, positions = layout.jerks(u), layout.footholds(u)
        if supports.stopping_offset is not None:
            last = np.vstack([support.position, positions])[-1]
            positions = np.vstack([positions, last + supports.stopping_offset])
        return Plan(
            times=preview.times,
            jerks=read_only(jerks),
            com=read_only(preview.Pps @ com.matrix + preview.Ppu @ jerks),
            cop=read_only(preview.Pzs @ com.matrix + preview.Pzu @ jerks),
            footholds=tuple(map(Footstep, supports.sides, positions, supports.yaws)),
            status=status,
            is_capturable=is_capturable,
        )

    def _solve(self, problem: QP, supports: Supports, dcm_at: list[AffinePoint]) -> tuple[Vector, Status, bool]:
        """The paper's QP; where it has no solution or leads to a fall, one that gives up the margin to stay up.

        Args:
            problem: the paper's.
            supports: those it was built from.
            dcm_at: the divergent component of motion at the first and at the last sample.

        Raises:
            NoSolutionFoundError: if nothing is feasible.
        """
        u = None
        with suppress(NoSolutionFoundError):
            u = solve_qp(problem).u
            if _leads_on(Layout.of(supports).axes(u), supports, dcm_at):
                return u, Status.SOLVED, True
        soft = soften_margin(problem, supports, self._parameters.cop_margin)
        for capturable in supports.capturable_at_end:
            with suppress(NoSolutionFoundError):
                return solve_qp(keep_inside(soft, dcm_at[-1], capturable)).u, Status.RELAXED, True
        return (solve_qp(soft).u if u is None else u), Status.RELAXED, False


def _leads_on(axes: Matrix, supports: Supports, dcm_at: list[AffinePoint]) -> bool:
    """Whether further steps can catch the robot one sample from now, and whether a stop ends in a stand.

    Not whether they could at the end of the plan: the QP is careless about that, and in time to correct it.
    """
    soon, end = (point.at(axes)[0] for point in dcm_at)
    is_caught = supports.capturable_soon is None or supports.capturable_soon.excess(soon) < CAPTURE_TOLERANCE
    stands = supports.stopping_offset is None or supports.capturable_at_end[0].excess(end) < CAPTURE_TOLERANCE
    return is_caught and stands


def _velocities(reference: Reference, heading: float, times: Vector) -> Matrix:
    """The velocity to track at each sample: it turns with the heading [m/s], world frame, shape (N, 2)."""
    yaw = heading + reference.yaw_rate * times
    c, s = np.cos(yaw), np.sin(yaw)
    return np.column_stack([c * reference.vx - s * reference.vy, s * reference.vx + c * reference.vy])
