"""Polygons of one tick, put where the feet are: soles, foothold regions, reach, and sets for the DCM."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import cycle
from types import MappingProxyType

import numpy as np

from walkcore.cache import instance_cache
from walkcore.command import Reference
from walkcore.mpc.balance_sets import CaptureSets, capture_sets
from walkcore.mpc.horizon import Horizon, SampleStance, StanceSequence
from walkcore.mpc.lipm import CoMState
from walkcore.mpc.orientation import Turn, foothold_yaws
from walkcore.mpc.regions import HalfPlanes, box, closest_band, half_planes
from walkcore.mpc.stance import Footstep, Side, Stance, on_side
from walkcore.parameters import Parameters
from walkcore.robot import Robot
from walkcore.values import Matrix, Vector, frozen_copy, rotation

Feet = tuple[tuple[Side, float], ...]
"""Side and yaw [rad] of the support foot and of each foothold."""
OtherFoot = tuple[float, float, float]
"""The other foot of a double support: from the one to it [m], and its yaw [rad]."""
POINT = box([0.0, 0.0])
NOWHERE = frozen_copy(np.zeros(2))
MAX_SUPPORTS = 16  # they change with each sample, or when a foot or its yaw moves


@dataclass(frozen=True, slots=True, eq=False)
class WalkingProblem:
    """The state of the robot at one tick, and its reference velocity."""

    com: CoMState
    """After any push."""
    support: Footstep
    """The foot that the QP holds fixed."""
    swing: Footstep
    """The other foot, where it is now."""
    horizon: Horizon
    reference: Reference
    """Reference velocity in the heading frame."""
    heading: float
    """Heading of the robot in the world [rad]."""


@dataclass(frozen=True, eq=False)  # no slots: the edges are laid side by side once
class Supports:
    """Polygons of a horizon, with the orientation of the world, each around a centre.

    The centre of a stance is the origin of its foot, or the middle between both feet.
    """

    cop_polygons: tuple[HalfPlanes, ...]
    """Polygons of the CoP around the centre of each stance, by the numbers of `stance_of_sample`."""
    foothold_regions: tuple[HalfPlanes, ...]
    """Region of each foothold that the QP chooses, around its predecessor."""
    flight: HalfPlanes
    """Where the next foothold may lie around the foot in the air, before `walking_qp` adds its reach: a point."""
    region_vertices: tuple[Matrix, ...]
    """Region of each foothold in the frame of its predecessor [m], shapes (V, 2)."""
    to_middle: Vector
    """Offset from the foot to the middle of both, where they carry samples side by side [m], shape (2,)."""
    later_flight: HalfPlanes | None
    """Each foothold after the next one, around the foot that flies there, which stands until then; None where that foot
    has the usual time."""
    viable_at_next_sample: HalfPlanes | None
    """States of the DCM at the first sample, around the centre of its stance, from which steps that keep all margins
    catch the robot; None where a stand turns into a walk or a walk into a stand."""
    viable_on_foothold: HalfPlanes | None
    """States of the DCM at the first sample on the next foothold, around it, from which steps catch the robot; None
    where no sample stands on it, or it is part of a stop."""
    viable_on_foothold_tight: HalfPlanes | None
    """`viable_on_foothold` for steps that use part of their regions only."""
    terminal_set_tight: HalfPlanes
    """States of the DCM at the last sample from which steps within all margins and part of their regions catch it."""
    terminal_set_on_whole_soles: HalfPlanes
    """States of the DCM at the last sample from which steps catch it that use the whole soles."""
    sides: tuple[Side, ...]
    """Sides of the m footholds, and of the one that ends a stop."""
    yaws: tuple[float, ...]
    """Yaws of the same [rad]."""
    stopping_offset: Vector | None
    """Offset from the last of the m footholds, or the support foot, to the one that ends a stop [m], shape (2,)."""

    @cached_property
    def edges(self) -> HalfPlanes:
        """The rows of all constraining polygons, one below the other: of the CoPs, the strides and the flight."""
        polygons = (*self.cop_polygons, *self.foothold_regions, self.flight)
        normals, lower, upper = zip(*((p.normals, p.lower, p.upper) for p in polygons), strict=True)
        return HalfPlanes(np.concatenate(normals), np.concatenate(lower), np.concatenate(upper))

    @cached_property
    def nb_edges(self) -> tuple[int, ...]:
        """Rows of each of these polygons."""
        return tuple(len(p.lower) for p in (*self.cop_polygons, *self.foothold_regions, self.flight))


def inner_soles(robot: Robot, margin: float) -> dict[Side, HalfPlanes]:
    """The part of each sole that the CoP may use, in the frame of the foot.

    Args:
        robot: whose soles they are.
        margin: that the CoP keeps from their edges [m].

    Raises:
        EmptyRegionError: if it leaves nothing of them.
    """
    return {side: sole.inset(margin) for side, sole in _polygons(robot)[0].items()}


@lru_cache(maxsize=8)
def _polygons(
    robot: Robot,
) -> tuple[Mapping[Side, HalfPlanes], Mapping[Side, list[HalfPlanes]], Mapping[Side, list[Matrix]]]:
    """The sole of each foot, and its foothold regions, one for each band of yaws, as rows and as vertices."""
    at_origin = {side: Stance((Footstep(side, np.zeros(2), 0.0),), robot.sole) for side in Side}
    vertices = {side: [on_side(side, region.vertices) for region in robot.foothold_regions] for side in Side}
    regions = {side: [half_planes(corners) for corners in vertices[side]] for side in Side}
    return {side: half_planes(stance.corners) for side, stance in at_origin.items()}, regions, vertices


NO_SETS: Mapping[float, CaptureSets] = MappingProxyType({})


class SupportGeometry:
    """Polygons of one robot, computed once, and put where the feet are."""

    def __init__(self, robot: Robot, parameters: Parameters, sets: Mapping[float, CaptureSets] = NO_SETS) -> None:
        """Compute the polygons.

        Args:
            robot: whose feet they are.
            parameters: with margin and timing.
            sets: for the DCM, by the duration of the coming steps [s]; another one's are computed when they are needed.

        Raises:
            EmptyRegionError: if the margin leaves nothing of the sole.
        """
        p = parameters
        self._robot, self._parameters = robot, p
        _, self._regions, self._region_vertices = _polygons(robot)
        self._soles = inner_soles(robot, p.cop_margin)
        self._bands = [(region.lowest_yaw, region.highest_yaw) for region in robot.foothold_regions]
        self._sets = sets
        self._supports = instance_cache(self._compute_supports, MAX_SUPPORTS)
        self.planned_stride = instance_cache(self._planned_stride, MAX_SUPPORTS)
        """Stride for a reference velocity and the side of the landing foot, in the frame of the support foot [m]."""

    def _sets_for(self, step_duration: float) -> CaptureSets:
        """The sets for the DCM, if the coming steps take some time [s]."""
        sets = self._sets.get(step_duration)
        return capture_sets(self._robot, self._parameters, step_duration) if sets is None else sets

    def supports(self, problem: WalkingProblem) -> Supports:
        """The polygons around the centres of one tick."""
        support, swing, stances = problem.support, problem.swing, problem.horizon.stances
        yaws = foothold_yaws(support, swing, self._turn(problem), stances.nb_footholds)
        feet = ((support.side, support.yaw), *zip(cycle((swing.side, support.side)), yaws, strict=False))
        other: OtherFoot | None = None
        if stances.has_double_support and not stances.is_stopping:  # where the feet are now
            (x, y), (support_x, support_y) = swing.position.tolist(), support.position.tolist()
            other = x - support_x, y - support_y, swing.yaw
        step_duration = problem.horizon.step_duration or self._parameters.step_duration
        return self._supports(feet, stances, other, step_duration)

    def reach(self, duration: float) -> Vector:
        """Distance that a foot can fly in some time, along x and y of the support foot's frame (30) [m], shape (2,).

        Args:
            duration: [s].
        """
        return duration * self._robot.max_foot_speed

    def planned_footholds(self, problem: WalkingProblem, supports: Supports) -> Matrix:
        """Footholds that follow the reference velocity, as far as their regions allow [m], shape (m, 2)."""
        position = problem.support.position
        positions: list[Vector] = []
        yaws = (problem.support.yaw, *supports.yaws)
        for side, yaw in zip(supports.sides[: problem.horizon.stances.nb_footholds], yaws, strict=False):
            position = position + rotation(yaw) @ self.planned_stride(problem.reference, side)
            positions.append(position)
        return np.array(positions).reshape(-1, 2)

    def _planned_stride(self, reference: Reference, side: Side) -> Vector:
        drift = self._parameters.step_duration * np.array([reference.vx, reference.vy])
        aside = np.array([0.0, side.sign * self._robot.stance_width])
        region = self._regions[side][closest_band(self._bands, 0.0)]
        return aside + region.fraction_inside(aside, drift) * drift

    def next_yaw(self, problem: WalkingProblem) -> float:
        """Yaw of the next foothold [rad]."""
        return foothold_yaws(problem.support, problem.swing, self._turn(problem), 1)[0]

    def _turn(self, problem: WalkingProblem) -> Turn:
        horizon = problem.horizon
        reach = horizon.time_to_touchdown * self._robot.max_foot_yaw_rate
        step_duration = horizon.step_duration or self._parameters.step_duration
        return Turn(problem.reference.yaw_rate, step_duration, reach)

    def _compute_supports(
        self, feet: Feet, stances: StanceSequence, other: OtherFoot | None, step_duration: float
    ) -> Supports:
        """The polygons of a horizon.

        Args:
            feet: support foot and footholds, by the numbers of `foot_of_sample`.
            stances: of the samples.
            other: where the horizon begins with a double support.
            step_duration: of the coming steps [s].
        """
        sets = self._sets_for(step_duration)
        (_, support_yaw), (last_side, last_yaw) = feet[0], feet[-1]
        sides, yaws = tuple(side for side, _ in feet[1:]), tuple(yaw for _, yaw in feet[1:])
        stopping_offset = None
        if stances.is_stopping:
            sides, yaws = (*sides, last_side.other), (*yaws, last_yaw)
            stopping_offset = rotation(last_yaw) @ (0.0, -last_side.sign * self._robot.stance_width)
        before = (support_yaw, *yaws)
        bands = [closest_band(self._bands, (yaws[k] - before[k]) * side.sign) for k, side in enumerate(sides)]
        regions = [self._regions[side][bands[k]].rotated(before[k]) for k, (side, _) in enumerate(feet[1:])]
        on_foothold = stances.first_on_foothold
        supports = Supports(
            cop_polygons=tuple(self._soles[side].rotated(yaw) for side, yaw in feet),
            foothold_regions=tuple(regions) if self._parameters.formulation.has_foothold_variables else (),
            flight=POINT.rotated(support_yaw),
            region_vertices=tuple(self._region_vertices[side][band] for side, band in zip(sides, bands, strict=True)),
            to_middle=NOWHERE,
            later_flight=self._later_flight(step_duration, support_yaw),
            viable_at_next_sample=_viable(sets.viable, stances.first, feet),
            viable_on_foothold=None if on_foothold is None else _viable(sets.viable, on_foothold, feet),
            viable_on_foothold_tight=None if on_foothold is None else _viable(sets.tight, on_foothold, feet),
            terminal_set_tight=_viable(sets.tight, stances.last, feet),
            terminal_set_on_whole_soles=_viable(sets.on_whole_soles, stances.last, feet),
            sides=sides,
            yaws=yaws,
            stopping_offset=stopping_offset,
        )
        if stopping_offset is not None:  # the stand that ends a stop lies beside the last foothold
            x, y = stopping_offset.tolist()
            return self._with_double_support(supports, stances, last_side, last_yaw, (x, y, last_yaw))
        return supports if other is None else self._with_double_support(supports, stances, *feet[0], other)

    def _later_flight(self, step_duration: float, yaw: float) -> HalfPlanes | None:
        p = self._parameters
        if step_duration >= p.step_duration:
            return None
        return box(self.reach(step_duration - p.double_support_duration)).rotated(yaw)

    def _with_double_support(
        self, supports: Supports, stances: StanceSequence, side: Side, yaw: float, other: OtherFoot
    ) -> Supports:
        """The same where some samples are carried by two feet side by side, the one with a side and a yaw [rad]."""
        x, y, other_yaw = other
        feet = Footstep(side, np.zeros(2), yaw), Footstep(side.other, np.array([x, y]), other_yaw)
        to_middle = feet[1].position / 2
        both = half_planes(Stance(feet, self._robot.sole).corners - to_middle)
        inner = both.inset(self._parameters.cop_margin)
        viable = supports.viable_at_next_sample
        if stances.is_double_support.all():
            viable = inner
        elif stances.first.is_double_support or stances.is_stopping:
            viable = None
        ends_on_both = stances.last.is_double_support
        return replace(
            supports,
            cop_polygons=(*supports.cop_polygons, inner),
            to_middle=to_middle,
            viable_at_next_sample=viable,
            terminal_set_tight=inner if ends_on_both else supports.terminal_set_tight,
            terminal_set_on_whole_soles=both if ends_on_both else supports.terminal_set_on_whole_soles,
        )


def _viable(sets: Mapping[Side, tuple[HalfPlanes, ...]], sample: SampleStance, feet: Feet) -> HalfPlanes:
    """States of the DCM at a sample from which it can be caught, around the foot that carries the sample."""
    side, yaw = feet[sample.foot]
    return sets[side][min(sample.samples_to_touchdown, len(sets[side]) - 1)].rotated(yaw)
