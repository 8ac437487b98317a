"""The situation of one tick as the methods without a QP see it: the CoM, and which feet carry it from now on."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from walkcore.mpc.lipm import CoMState, Pendulum
from walkcore.mpc.regions import cut_vertices, nearest_within
from walkcore.mpc.stance import Footstep, Stance, sole_vertices
from walkcore.mpc.supports import SupportGeometry, Supports, WalkingProblem
from walkcore.parameters import Parameters
from walkcore.robot import Robot
from walkcore.values import Matrix, Vector, rotation

STEPS_AHEAD = 4
"""Footholds that count: steps of 0.8 s shrink what comes after them to exp(-11)."""
ROUNDING = 1e-9  # [s]


@dataclass(frozen=True, slots=True, eq=False)
class Interval:
    """A time in which the same feet carry the robot, with the CoP in the middle of a foot or on its way to the next."""

    duration: float
    """[s]; infinite for a stand that lasts."""
    start: Vector
    """Nominal CoP at the beginning [m], shape (2,)."""
    end: Vector
    """Nominal CoP at the end [m], shape (2,)."""
    feet: tuple[Footstep, ...]
    """One, or both."""


@dataclass(frozen=True, eq=False)  # no slots: what is derived is computed once
class Situation:
    """The state of the robot at one tick, with the steps that it has planned."""

    com: CoMState
    pendulum: Pendulum
    support: Footstep
    swing: Footstep
    footholds: tuple[Footstep, ...]
    """Footholds to come, from the reference velocity."""
    reachable: Matrix
    """Part of its region where the next foothold can still be, in the world frame [m], shape (V, 2); empty if none can
    be moved."""
    is_stopping: bool
    """Whether the feet stand side by side after the last foothold."""
    lift_off: float
    """Time until a foot leaves the ground [s]; zero in a single support, infinite for a stand that lasts."""
    time_in_air: float
    """Time that this foot has or will have in the air [s]."""
    stand_duration: float
    """Duration of a stand before a first step [s]."""
    double_support: float
    """Duration of the double support that begins a step [s]."""
    single_support: float
    """Duration of the single support of the steps to come [s]."""
    stance_width: float
    """Distance between the feet of a robot at rest [m]."""
    sole: Matrix
    """Outline of the left sole in its own frame [m], shape (V, 2)."""
    inner_sole: Matrix
    """The part of it that keeps the margin from its edges [m], shape (V, 2)."""

    @property
    def omega(self) -> float:
        """Natural frequency of the pendulum [1/s]."""
        return self.pendulum.omega

    @property
    def dcm(self) -> Vector:
        """Divergent component of motion [m], shape (2,)."""
        return self.pendulum.dcm(self.com)

    @property
    def touchdown(self) -> float:
        """Time until the next touchdown [s]; infinite if none is planned."""
        return self.lift_off + self.time_in_air

    @cached_property
    def intervals(self) -> tuple[Interval, ...]:
        """The intervals from now on; the present one for as long as it lasts yet."""
        both, middle = (self.support, self.swing), (self.support.position + self.swing.position) / 2
        if not math.isfinite(self.touchdown):
            return (Interval(math.inf, middle, middle, both),)
        support, swing, waiting = self.support.position, self.swing.position, self.lift_off
        found: list[Interval] = []
        if waiting > self.double_support + ROUNDING:
            # The CoP goes to the foot that will leave, so that the CoM goes to the other one.
            standing = waiting - self.double_support
            passed = max(1.0 - standing / max(self.stand_duration, standing), 0.0)
            found.append(Interval(standing, middle + passed * (swing - middle), swing, both))
            waiting = self.double_support
        if waiting > ROUNDING:
            passed = 1.0 - waiting / self.double_support
            found.append(Interval(waiting, swing + passed * (support - swing), support, both))
        found.append(Interval(self.time_in_air, support, support, (self.support,)))
        return (*found, *self._steps())

    def _steps(self) -> list[Interval]:
        """The intervals from the next touchdown on."""
        found: list[Interval] = []
        before = self.support
        for k, foothold in enumerate(self.footholds):
            at, feet = foothold.position, (foothold, before)
            if self.is_stopping and k == len(self.footholds) - 1:
                middle = (before.position + at) / 2
                found.append(Interval(self.double_support, before.position, middle, feet))
                found.append(Interval(math.inf, middle, middle, feet))
            else:
                found.append(Interval(self.double_support, before.position, at, feet))
                found.append(Interval(self.single_support, at, at, (foothold,)))
            before = foothold
        return found

    def at(self, t: float) -> tuple[int, float]:
        """Number of the interval at a time, and the time since it began [s].

        Args:
            t: from now [s]; on a border the single support counts, which is the stricter one.
        """
        begin = 0.0
        for k, interval in enumerate(self.intervals):
            end = begin + interval.duration
            if t < end - ROUNDING or (t < end + ROUNDING and len(interval.feet) == 1):
                return k, t - begin
            begin = end
        return len(self.intervals) - 1, t - begin + self.intervals[-1].duration

    def clipped(self, cop: Vector, t: float) -> Vector:
        """The nearest point to a CoP in the soles that carry the robot.

        Args:
            cop: that is wanted [m], shape (2,).
            t: when, from now [s].
        """
        return nearest_within(self._support_polygon(self.at(t)[0]), cop)

    def clipped_inside(self, cop: Vector, t: float) -> Vector:
        """The nearest point to a CoP that is the margin inside of the edges of the soles.

        Args:
            cop: that is wanted [m], shape (2,).
            t: when, from now [s].
        """
        feet = self.intervals[self.at(t)[0]].feet
        is_one = len(feet) == 1
        return nearest_within(self.inner_sole_of(feet[0]) if is_one else Stance(feet, self.inner_sole).polygon, cop)

    def inner_sole_of(self, foot: Footstep) -> Matrix:
        """Corners of the part of a sole that keeps the margin from its edges, counter-clockwise [m], shape (V, 2)."""
        return _counter_clockwise(sole_vertices(self.inner_sole, foot))

    def margin(self, cop: Vector, t: float) -> float:
        """Distance of a CoP from the nearest edge of the soles that carry the robot [m]; negative outside of them.

        Args:
            cop: [m], shape (2,).
            t: when, from now [s].
        """
        corners = self._support_polygon(self.at(t)[0])
        edges, to_cop = np.concatenate((corners[1:], corners[:1])) - corners, cop - corners
        inwards = edges[:, 0] * to_cop[:, 1] - edges[:, 1] * to_cop[:, 0]
        return float((inwards / np.hypot(edges[:, 0], edges[:, 1])).min())

    def _support_polygon(self, k: int) -> Matrix:
        """Corners of the soles of an interval, counter-clockwise [m], shape (V, 2)."""
        if k not in self._polygons:
            feet = self.intervals[k].feet
            is_one = len(feet) == 1
            corners = (
                _counter_clockwise(sole_vertices(self.sole, feet[0])) if is_one else Stance(feet, self.sole).polygon
            )
            self._polygons[k] = corners
        return self._polygons[k]

    @cached_property
    def _polygons(self) -> dict[int, Matrix]:
        return {}

    def moved(self, shift: Vector) -> "Situation":
        """The same with all coming footholds moved, the next one no farther than it can be.

        Args:
            shift: [m], shape (2,).
        """
        if not len(self.reachable):
            return self
        first = self.footholds[0].position
        shift = nearest_within(self.reachable, first + shift) - first
        return replace(self, footholds=tuple(replace(foot, position=foot.position + shift) for foot in self.footholds))


def situation(
    problem: WalkingProblem,
    supports: Supports,
    geometry: SupportGeometry,
    robot: Robot,
    parameters: Parameters,
    pendulum: Pendulum,
    inner_sole: Matrix,
) -> Situation:
    """The situation of one tick.

    Args:
        problem: of this tick.
        supports: of its horizon.
        geometry: of the robot, which plans footholds by the reference velocity.
        robot: that walks.
        parameters: of the walk.
        pendulum: that the CoM follows.
        inner_sole: part of the left sole that keeps the margin of the CoP [m], shape (V, 2).
    """
    horizon, p = problem.horizon, parameters
    is_walking = math.isfinite(horizon.time_to_touchdown)
    step_duration = p.step_duration if horizon.step_duration is None else horizon.step_duration
    reachable = np.zeros((0, 2))
    if is_walking and horizon.stances.nb_footholds:
        reach = horizon.time_in_air * robot.max_foot_speed
        reachable = _reachable(problem, supports.region_vertices[0], reach)
    return Situation(
        com=problem.com,
        pendulum=pendulum,
        support=problem.support,
        swing=problem.swing,
        footholds=_footholds(problem, supports, geometry) if is_walking else (),
        reachable=reachable,
        is_stopping=supports.stopping_offset is not None,
        lift_off=horizon.time_to_touchdown - horizon.time_in_air if is_walking else math.inf,
        time_in_air=horizon.time_in_air if is_walking else math.inf,
        stand_duration=p.initial_double_support_duration - p.double_support_duration,
        double_support=p.double_support_duration,
        single_support=step_duration - p.double_support_duration,
        stance_width=robot.stance_width,
        sole=robot.sole,
        inner_sole=inner_sole,
    )


def _footholds(problem: WalkingProblem, supports: Supports, geometry: SupportGeometry) -> tuple[Footstep, ...]:
    """The planned footholds, the one that ends a stop, or as many more as count."""
    planned = geometry.planned_footholds(problem, supports)
    places = zip(supports.sides, planned, supports.yaws, strict=False)
    feet = [problem.support, *(Footstep(side, at, yaw) for side, at, yaw in places)]
    if supports.stopping_offset is not None:
        end = Footstep(supports.sides[-1], feet[-1].position + supports.stopping_offset, supports.yaws[-1])
        return (*feet[1:], end)
    turn = feet[-1].yaw - feet[-2].yaw if len(feet) > 1 else 0.0
    while len(feet) <= STEPS_AHEAD:
        last = feet[-1]
        stride = rotation(last.yaw) @ geometry.planned_stride(problem.reference, last.side.other)
        feet.append(Footstep(last.side.other, last.position + stride, last.yaw + turn))
    return tuple(feet[1:])


def _reachable(problem: WalkingProblem, region: Matrix, reach: Vector) -> Matrix:
    """The part of the next foothold's region to which the foot in the air can fly in time (30) [m], shape (V, 2)."""
    R = rotation(problem.support.yaw)
    foot = (problem.swing.position - problem.support.position) @ R
    part = region
    for axis in range(2):
        for sign in (1.0, -1.0):
            normal = sign * np.eye(2)[axis]
            part = cut_vertices(part, normal, float(normal @ foot + reach[axis]))
    return problem.support.position + _counter_clockwise(part) @ R.T


def _counter_clockwise(corners: Matrix) -> Matrix:
    """The corners of a polygon in that order, which a mirror image has not, shape (V, 2)."""
    following = np.concatenate((corners[1:], corners[:1]))
    area = np.sum(corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0])
    return corners if area > 0.0 else corners[::-1]
