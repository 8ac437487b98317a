"""The largest impulse that any controller of this class could survive, by linear programming.

The class keeps the CoP inside of the true soles, sets each foot into its region, moves it no faster than it can fly
(30), and swings it for at least the shortest swing. For given times of the touchdowns all of that is linear in the
impulse J, the footholds f_k and the CoPs:

    maximise J so that    xi = xi_before + J d / (m omega)                  at the push
                          xi' = e xi - (e - 1) z                            over a single support, z in its sole
                          xi' = a xi - w_0 z_0 - w_1 z_1                    over a double support, z_i in the i-th sole
                          f_k - f_k-1 in its region,   |f_k+1 - f_k-1| <= v_max t_air
                          xi - f_K in the viable set of the shortest steps

with e the growth of the DCM over a single support, a that over a double support, and w_0 + w_1 = a - 1 the weights of a
CoP that goes linearly from the one sole to the other. The bound is the largest J over the times of the touchdowns. It
knows neither the margin of the CoP nor the jerk, so no controller quite reaches it. Straight walks only: all feet have
the yaw of the support foot.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any, cast

import numpy as np
from scipy.optimize import linprog

from walkcore.mpc.capture import StepTiming, viable_vertices
from walkcore.mpc.gait import Phase
from walkcore.mpc.regions import closest_band, foothold_vertices, polygon
from walkcore.mpc.stance import Side, convex_hull, mirrored
from walkcore.robot import Robot
from walkcore.snapshot import Snapshot
from walkcore.values import Matrix, Vector, rotation

NB_STEPS = 4  # whose footholds are variables; the viable set stands for those after them
TOUCHDOWNS = 0.05  # [s] between the times of the first touchdown that are tried


@dataclass(frozen=True, slots=True)
class StepClass:
    """Times that a controller may choose from."""

    shortest_swing: float = 0.3
    """[s]."""
    durations: tuple[float, ...] = (0.4, 0.6, 0.8)
    """Durations of the two steps after the one under way [s]; those after them take the first of these."""
    is_adaptive: bool = True
    """Whether the step under way may end sooner, or the foot that has landed leave again; else it ends on schedule."""


def largest_impulse(
    snapshot: Snapshot, robot: Robot, double_support: float, direction: Vector, steps: StepClass
) -> float:
    """The largest impulse in a direction that any controller of the class could survive [N s].

    Args:
        snapshot: before the push.
        robot: with its mass, soles, regions and foot speed.
        double_support: its duration T [s].
        direction: of the push in the world frame, unit vector, shape (2,).
        steps: times to choose from.
    """
    programs = _programs(snapshot, robot, double_support, direction, steps)
    return max((program.maximum() for program in programs), default=0.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Phase:
    """A time over which the DCM is carried by the CoPs of the given soles: xi' = growth xi - sum of weight z."""

    growth: float
    weights: tuple[float, ...]
    feet: tuple[int, ...]
    """Foot of each CoP: 0 the support foot, k the k-th foothold, -1 both feet as they stand now."""


def _single(duration: float, omega: float, foot: int) -> _Phase:
    e = math.exp(omega * duration)
    return _Phase(e, (e - 1.0,), (foot,))


def _double(duration: float, omega: float, foot: int) -> _Phase:
    a = math.exp(omega * duration)
    mean = (a - 1.0) / (omega * duration)
    return _Phase(a, (a - mean, mean - 1.0), (foot, foot + 1))


@dataclass(frozen=True, slots=True, eq=False)
class _Program:
    """One linear program, in the frame of the support foot."""

    dcm: Vector
    push: Vector
    """Change of the DCM by an impulse of 1 N s [m/(N s)], shape (2,)."""
    phases: tuple[_Phase, ...]
    soles: tuple[Matrix, ...]
    """Of the support foot and each foothold, around it, then of both feet where they stand [m], shapes (V, 2)."""
    regions: tuple[Matrix, ...]
    """Of each foothold, around its predecessor [m], shapes (V, 2)."""
    swing: Vector
    """The other foot [m], shape (2,)."""
    reaches: tuple[Vector, ...]
    """How far each foot can fly to its foothold [m], shapes (2,)."""
    viable: Matrix
    """Viable set around the last foothold, at the end of its double support [m], shape (V, 2)."""

    def maximum(self) -> float:
        """The largest impulse; 0 if there is none [N s]."""
        cops = [foot for phase in self.phases for foot in phase.feet]
        n, nb_feet = 1 + 2 * len(self.regions) + 2 * len(cops), len(self.regions)
        foot = {0: np.zeros((2, n)), -1: np.zeros((2, n))}
        for k in range(nb_feet):
            foot[k + 1] = np.eye(2, n, 1 + 2 * k)
        cop = [np.eye(2, n, 1 + 2 * nb_feet + 2 * i) for i in range(len(cops))]
        rows: list[Matrix] = []
        bounds: list[Vector] = []

        def keep(point: Matrix, offset: Vector, vertices: Matrix) -> None:
            planes = polygon(vertices)
            both = np.isfinite(planes.lower)
            normals = np.vstack([planes.normals, -planes.normals[both]])
            rows.append(normals @ point)
            bounds.append(np.concatenate([planes.upper, -planes.lower[both]]) - normals @ offset)

        xi, known, used = np.zeros((2, n)), self.dcm, 0
        xi[:, 0] = self.push
        for phase in self.phases:
            xi, known = phase.growth * xi, phase.growth * known
            for weight, at in zip(phase.weights, phase.feet, strict=True):
                xi = xi - weight * cop[used]
                keep(cop[used] - foot[at], np.zeros(2), self.soles[at])
                used += 1
        keep(xi - foot[nb_feet], known, self.viable)
        for k, region in enumerate(self.regions):
            keep(foot[k + 1] - foot[k], np.zeros(2), region)
            before, there = (foot[0], self.swing) if k == 0 else (foot[k - 1], np.zeros(2))
            box = self.reaches[k] * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
            keep(foot[k + 1] - before, -there, box)
        found = cast(Any, linprog)(
            -np.eye(1, n)[0],
            A_ub=np.vstack(rows),
            b_ub=np.concatenate(bounds),
            bounds=[(0.0, None)] + [(None, None)] * (n - 1),
        )
        return float(found.x[0]) if found.status == 0 else 0.0


def _programs(
    snapshot: Snapshot, robot: Robot, double_support: float, direction: Vector, steps: StepClass
) -> Iterator[_Program]:
    """The programs of all times and support feet to choose from."""
    T, omega = double_support, snapshot.pendulum.omega
    sides = [snapshot.support.side]
    if snapshot.phase is not Phase.SINGLE_SUPPORT and steps.is_adaptive:
        sides.append(snapshot.support.side.other)
    shortest = StepTiming(T, steps.durations[0] - T, omega)
    viable = viable_vertices(robot.sole, 0.0, robot.foothold_region, shortest, T)
    for side in sides:
        support, swing = snapshot.feet[side], snapshot.feet[side.other]
        R = rotation(support.yaw)
        to_swing = (swing.position - support.position) @ R
        landing = [side.other if k % 2 == 0 else side for k in range(NB_STEPS)]
        both = np.vstack([_sole(robot, side), to_swing + _sole(robot, side.other)])
        soles = (_sole(robot, side), *(_sole(robot, foot) for foot in landing), convex_hull(both))
        for waiting, flight, total in _first_steps(snapshot, T, steps):
            for second, third in product(steps.durations, repeat=2):
                durations = [second, third, *[steps.durations[0]] * (NB_STEPS - 3)]
                phases = [_single(waiting, omega, -1)] if waiting > 0.0 else []
                phases += [_single(total - waiting, omega, 0)]
                for k, duration in enumerate(durations):
                    phases += [_double(T, omega, k), _single(duration - T, omega, k + 1)]
                phases += [_double(T, omega, NB_STEPS - 1)]
                yield _Program(
                    dcm=(snapshot.dcm - support.position) @ R,
                    push=direction @ R / (robot.mass * omega),
                    phases=tuple(phases),
                    soles=soles,
                    regions=tuple(_region(robot, foot) for foot in landing),
                    swing=to_swing,
                    reaches=tuple(t * robot.max_foot_speed for t in (flight, *(d - T for d in durations))),
                    viable=viable[landing[-1]][-1],
                )


def _first_steps(snapshot: Snapshot, T: float, steps: StepClass) -> Iterator[tuple[float, float, float]]:
    """Rest of the double support, time in the air and time to the touchdown of the step under way [s]."""
    if snapshot.phase is Phase.STANDING:
        for flight in np.arange(steps.shortest_swing, steps.durations[-1], TOUCHDOWNS):
            yield 0.0, float(flight), float(flight)
        return
    total = snapshot.time_to_touchdown
    if snapshot.phase is Phase.DOUBLE_SUPPORT:
        waiting = total - (snapshot.step_duration - T)
        soonest = waiting + steps.shortest_swing
    else:
        waiting = 0.0
        soonest = max(total - snapshot.step_duration + T + steps.shortest_swing, 0.005)
    again = total + steps.durations[-1]  # of a foot that lands, leaves again and lands once more
    times = np.append(np.arange(again, soonest, -TOUCHDOWNS), min(soonest, total)) if steps.is_adaptive else [total]
    for time in times:
        yield waiting, float(time) - waiting, float(time)


def _sole(robot: Robot, side: Side) -> Matrix:
    return robot.sole if side is Side.LEFT else mirrored(robot.sole)


def _region(robot: Robot, side: Side) -> Matrix:
    bands = [(region.lowest_yaw, region.highest_yaw) for region in robot.foothold_regions]
    return foothold_vertices(robot.foothold_regions[closest_band(bands, 0.0)].vertices, side)
