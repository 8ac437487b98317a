"""From the state of the CoM to the motion of the coming two steps: describe, build, solve, read."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from walkcore.command import Reference
from walkcore.errors import NoSolutionFoundError
from walkcore.gait import Footstep, Horizon, Side
from walkcore.lipm import CoMState, PreviewMatrices, preview_matrices
from walkcore.orientation import foothold_yaws
from walkcore.parameters import Parameters
from walkcore.qp import solve_qp
from walkcore.regions import HalfPlanes, box, foothold_vertices, polygon, sole_vertices
from walkcore.robot import Robot
from walkcore.values import Matrix, Vector, read_only, rotation
from walkcore.walking_qp import Supports, Weights, build_qp, soften_margin


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


class PatternGenerator:
    """Decides the plan of a tick. Holds nothing but what depends on robot and parameters alone."""

    def __init__(self, robot: Robot, parameters: Parameters) -> None:
        """Compute what does not change from tick to tick.

        Raises:
            EmptyRegionError: if the margin leaves nothing of the sole.
        """
        p = parameters
        self._robot, self._parameters = robot, p
        self._weights = Weights(p.alpha, p.beta, p.gamma)
        self._previews = {ticks: self._preview(ticks) for ticks in range(1, p.ticks_per_sample + 1)}
        self._soles = {
            side: polygon(sole_vertices(robot.sole, Footstep(side, np.zeros(2), 0.0))).inset(p.cop_margin)
            for side in Side
        }
        self._regions = {side: polygon(foothold_vertices(robot.foothold_region, side)) for side in Side}

    def _preview(self, ticks_to_sample: int) -> PreviewMatrices:
        p = self._parameters
        intervals = np.full(p.horizon_samples, p.sampling_period)
        intervals[0] = ticks_to_sample * p.control_period
        return preview_matrices(intervals, self.com_height, p.gravity)

    @property
    def com_height(self) -> float:
        """CoM height h [m]: the parameter where it is given, else the robot's own."""
        return self._robot.com_height if self._parameters.com_height is None else self._parameters.com_height

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
        yaws = foothold_yaws(support.yaw, horizon.nb_footholds)
        supports = self._supports(support, swing, horizon, yaws)
        velocity = rotation(heading) @ (reference.vx, reference.vy)
        problem = build_qp(com, supports, np.tile(velocity, (preview.nb_samples, 1)), preview, self._weights)
        try:
            u, status = solve_qp(problem), Status.SOLVED
        except NoSolutionFoundError:
            u, status = solve_qp(soften_margin(problem, supports, self._parameters.cop_margin)), Status.RELAXED

        jerks, positions = supports.layout.jerks(u), supports.layout.footholds(u)
        sides = [support.side.other if k % 2 == 0 else support.side for k in range(len(positions))]
        return Plan(
            times=preview.times,
            jerks=read_only(jerks),
            com=read_only(preview.Pps @ com.matrix + preview.Ppu @ jerks),
            cop=read_only(preview.Pzs @ com.matrix + preview.Pzu @ jerks),
            footholds=tuple(map(Footstep, sides, positions, yaws)),
            status=status,
        )

    def _supports(self, support: Footstep, swing: Footstep, horizon: Horizon, yaws: Vector) -> Supports:
        """Polygons and centres of the samples' supports, in world orientation."""
        soles = [self._soles[support.side].rotated(support.yaw)]
        regions: list[HalfPlanes] = []
        side, yaw = support.side, support.yaw
        for next_yaw in yaws:
            regions.append(self._regions[side.other].rotated(yaw))
            side, yaw = side.other, next_yaw
            soles.append(self._soles[side].rotated(yaw))

        known_centre = horizon.support_selection[:, None] * support.position
        polygons = [soles[int(foot)] for foot in horizon.foot]
        if horizon.is_on_both.any():
            middle = (support.position + swing.position) / 2
            known_centre[horizon.is_on_both] = middle
            hull = self._hull(support, swing, middle)
            polygons = [hull if both else sole for both, sole in zip(horizon.is_on_both, polygons, strict=True)]
        return Supports(
            known_centre=known_centre,
            selection=horizon.foothold_selection,
            cop_polygons=tuple(polygons),
            support_position=support.position,
            foothold_regions=tuple(regions),
            swing_position=swing.position,
            swing_reach=box(horizon.time_to_touchdown * self._robot.max_foot_speed).rotated(support.yaw),
        )

    def _hull(self, support: Footstep, swing: Footstep, middle: Vector) -> HalfPlanes:
        """Where the CoP may be on both feet, relative to the middle between them."""
        corners = np.vstack([sole_vertices(self._robot.sole, foot) for foot in (support, swing)])
        return polygon(corners - middle).inset(self._parameters.cop_margin)
