"""What carries each sample of the horizon, and where the feet may go: the geometry of the walking QP."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from walkcore.cache import kept
from walkcore.command import Reference
from walkcore.mpc.capture import StepTiming, capture_polygons
from walkcore.mpc.gait import Footstep, Horizon, Side
from walkcore.mpc.orientation import Turn, foothold_yaws
from walkcore.mpc.regions import HalfPlanes, box, closest_band, foothold_vertices, polygon, sole_vertices
from walkcore.mpc.schemes import Footholds
from walkcore.parameters import Parameters
from walkcore.robot import Robot
from walkcore.values import Matrix, Vector, read_only, rotation

Feet = tuple[tuple[Side, float], ...]
"""Side and yaw [rad] of the support foot and of each foothold."""
MAX_KEPT = 1024  # while the yaws stay, each phase of the gait comes back with every second step
UNIT_BOX = box([1.0, 1.0])
NOWHERE = read_only(np.zeros(2))
SPARE = 0.6  # fraction of the foothold region that a plan which had to be corrected may count on after its end


@dataclass(frozen=True, slots=True, eq=False)
class Supports:
    """Centres and polygons, with the orientation of the world.

    The support of a sample is a foot, or the feet side by side; its centre is the origin
    of the foot, or the middle between the two.
    """

    cop_polygons: tuple[HalfPlanes, ...]
    """Where the CoP may be relative to the centre of what carries it, by the numbers of `Horizon.carrier`."""
    to_middle: Vector
    """From the foot to the middle of both, where they carry samples side by side [m], shape (2,)."""
    planned_footholds: Matrix
    """Where a planner puts the footholds that carry samples [m], shape (m, 2); zero where the QP is free."""
    foothold_regions: tuple[HalfPlanes, ...]
    """Where each foothold that the QP chooses may be relative to its predecessor."""
    swing_reach: HalfPlanes
    """How far the foot in the air can still move: right-hand side of (30)."""
    capturable_soon: HalfPlanes | None
    """Where the divergent component of motion may be at the first sample relative to its centre, if steps that keep
    all margins are to catch the robot; None where a stand turns into a walk or a walk into a stand."""
    spare_at_end: HalfPlanes
    """Where it should be at the last sample, for steps that keep all margins and have room to spare."""
    capturable_at_end: HalfPlanes
    """Where it must be at the last sample, for steps that use the whole soles."""
    sides: tuple[Side, ...]
    """Of the m footholds, and of the one that ends a stop."""
    yaws: tuple[float, ...]
    """Of the same [rad]."""
    stopping_offset: Vector | None
    """From the last of the m footholds, or the support foot if m = 0, to the one that ends a stop [m], shape (2,)."""

    @property
    def polygons(self) -> tuple[HalfPlanes, ...]:
        """Of all constraints: of the CoPs, the strides and the flight."""
        return (*self.cop_polygons, *self.foothold_regions, self.swing_reach)


class SupportGeometry:
    """Polygons of one robot, computed once, and put where the feet are at each tick."""

    def __init__(self, robot: Robot, parameters: Parameters, com_height: float) -> None:
        """Compute the polygons.

        Raises:
            EmptyRegionError: if the margin leaves nothing of the sole.
        """
        p = parameters
        self._robot, self._parameters = robot, p
        self._on_feet = kept(self._compute_on_feet, MAX_KEPT)
        at_origin = {side: Footstep(side, np.zeros(2), 0.0) for side in Side}
        self._soles = {side: polygon(sole_vertices(robot.sole, at_origin[side])).inset(p.cop_margin) for side in Side}
        self._bands = [(region.lowest_yaw, region.highest_yaw) for region in robot.foothold_regions]
        self._regions = {
            side: [polygon(foothold_vertices(region.vertices, side)) for region in robot.foothold_regions]
            for side in Side
        }
        timing = StepTiming(
            p.double_support_duration,
            p.step_duration - p.double_support_duration,
            math.sqrt(p.gravity / com_height),
        )
        middle = np.mean(robot.foothold_region, axis=0)
        spare = middle + SPARE * (robot.foothold_region - middle)
        self._captures = [
            capture_polygons(robot.sole, margin, region, timing, p.sampling_period)
            for margin, region in (
                (p.cop_margin, spare),
                (p.cop_margin, robot.foothold_region),
                (0.0, robot.foothold_region),
            )
        ]

    def supports(self, support: Footstep, swing: Footstep, horizon: Horizon, reference: Reference) -> Supports:
        """The supports of one tick.

        Args:
            support: foot that the QP holds fixed.
            swing: the other foot, where it is now.
            horizon: supports of the samples to come.
            reference: velocity asked, in the heading frame.
        """
        m = horizon.nb_footholds
        yaws = foothold_yaws(support, swing, self._turn(horizon, reference.yaw_rate), m)
        sides = [support.side.other if k % 2 else support.side for k in range(m + 1)]
        feet = tuple(zip(sides, (support.yaw, *yaws), strict=True))  # by the numbers of horizon.foot
        supports = self._on_feet(feet, horizon)
        if self._parameters.terms.footholds is not Footholds.FREE:
            supports = replace(supports, planned_footholds=self._planned(support.position, feet, reference))
        return self._with_stance(supports, support, swing, horizon) if horizon.is_any_on_both else supports

    def _compute_on_feet(self, feet: Feet, horizon: Horizon) -> Supports:
        """What the yaws and the horizon alone decide."""
        (_, support_yaw), (last_side, last_yaw) = feet[0], feet[-1]
        aside = rotation(last_yaw) @ (0.0, -last_side.sign * self._robot.stance_width)
        stop = ((last_side.other, last_yaw),) if horizon.is_stopping else ()
        is_planned = self._parameters.terms.footholds is Footholds.PLANNED
        return Supports(
            cop_polygons=tuple(self._soles[side].rotated(yaw) for side, yaw in feet),
            to_middle=NOWHERE,
            planned_footholds=np.zeros((len(feet) - 1, 2)),
            foothold_regions=() if is_planned else tuple(self._regions_of(feet)),
            swing_reach=self._reach(horizon.time_to_touchdown, support_yaw),
            capturable_soon=self._capture(self._captures[1], horizon, 0, feet),
            spare_at_end=self._capture(self._captures[0], horizon, -1, feet),
            capturable_at_end=self._capture(self._captures[2], horizon, -1, feet),
            sides=tuple(side for side, _ in (*feet[1:], *stop)),
            yaws=tuple(yaw for _, yaw in (*feet[1:], *stop)),
            stopping_offset=aside if horizon.is_stopping else None,
        )

    def _with_stance(self, supports: Supports, support: Footstep, swing: Footstep, horizon: Horizon) -> Supports:
        """The same where some samples are carried by both feet side by side."""
        # The stand that ends a stop hangs on the last foothold; any other is where the feet are now.
        if supports.stopping_offset is not None:
            side, yaw = supports.sides[-1], supports.yaws[-1]
            one, other = Footstep(side.other, np.zeros(2), yaw), Footstep(side, supports.stopping_offset, yaw)
        else:
            one = Footstep(support.side, np.zeros(2), support.yaw)
            other = Footstep(swing.side, swing.position - support.position, swing.yaw)
        pair = self._stance(one, other)
        inner = pair.inset(self._parameters.cop_margin)
        soon = supports.capturable_soon
        if horizon.is_on_both.all():
            soon = inner
        elif horizon.is_on_both[0] or horizon.is_stopping:
            soon = None
        ends_on_both = bool(horizon.is_on_both[-1])
        return replace(
            supports,
            cop_polygons=(*supports.cop_polygons, inner),
            to_middle=other.position / 2,
            capturable_soon=soon,
            spare_at_end=inner if ends_on_both else supports.spare_at_end,
            capturable_at_end=pair if ends_on_both else supports.capturable_at_end,
        )

    def _reach(self, time: float, yaw: float) -> HalfPlanes:
        """How far a foot flies in some time, along the axes of the support foot."""
        reach = time * self._robot.max_foot_speed
        return HalfPlanes(UNIT_BOX.rotated(yaw).normals, -reach, reach)

    @staticmethod
    def _capture(polygons: Mapping[Side, tuple[HalfPlanes, ...]], horizon: Horizon, n: int, feet: Feet) -> HalfPlanes:
        """Where the divergent component may be at sample n, relative to the foot that carries it."""
        side, yaw = feet[int(horizon.foot[n])]
        return polygons[side][min(int(horizon.samples_left[n]), len(polygons[side]) - 1)].rotated(yaw)

    def _regions_of(self, feet: Feet) -> Iterator[HalfPlanes]:
        """Where each foothold may be relative to its predecessor, by the yaw between the two."""
        for (_, before), (side, yaw) in pairwise(feet):
            band = closest_band(self._bands, (yaw - before) * side.sign)
            yield self._regions[side][band].rotated(before)

    def _planned(self, start: Vector, feet: Feet, reference: Reference) -> Matrix:
        """Footholds that follow the reference velocity step by step, as far as their regions allow, shape (m, 2)."""
        drift = self._parameters.step_duration * np.array([reference.vx, reference.vy])
        positions = [start]
        for side, yaw in feet[:-1]:
            aside = np.array([0.0, side.other.sign * self._robot.stance_width])
            region = self._regions[side.other][closest_band(self._bands, 0.0)]
            stride = aside + region.fraction_inside(aside, drift) * drift
            positions.append(positions[-1] + rotation(yaw) @ stride)
        return np.array(positions[1:]).reshape(-1, 2)

    def _turn(self, horizon: Horizon, yaw_rate: float) -> Turn:
        reach = horizon.time_to_touchdown * self._robot.max_foot_yaw_rate
        return Turn(yaw_rate, self._parameters.step_duration, reach)

    def _stance(self, one: Footstep, other: Footstep) -> HalfPlanes:
        """Hull of two soles, relative to the middle between them."""
        middle = (one.position + other.position) / 2
        return polygon(np.vstack([sole_vertices(self._robot.sole, foot) for foot in (one, other)]) - middle)
