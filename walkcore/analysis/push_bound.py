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

The CoPs are free in their soles, so that they leave one Minkowski sum V of the viable set and the soles S, and the
footholds another one of the regions R, where the reach is left out:

    G (xi_before + J d / (m omega)) - sum of c_k f_k    in  V = viable set + sum of W_i S_i
    G (xi_before + J d / (m omega))                     in  V + sum of C_k R_k              without the reach

with G the growth up to the end. The first has no variables but J and f_k, in one program for all times. The second
bounds J without any program; times whose bound is below a J that was found already are not tried. The impulses that
are survived at some times are a convex polygon: its edge at the maximum in one direction, which the multipliers of
the program tell, bounds J in all others.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np

from walkcore.errors import InfeasibleError, NoSolutionFoundError
from walkcore.mpc.capture import StepTiming, viable_vertices
from walkcore.mpc.gait import Phase
from walkcore.mpc.qp import QP, InteriorPointSolver, Solver
from walkcore.mpc.regions import half_planes
from walkcore.mpc.stance import Side, convex_hull, on_side
from walkcore.robot import Robot
from walkcore.snapshot import Snapshot
from walkcore.values import Matrix, Vector, rotation

NB_STEPS = 4  # whose footholds are variables; the viable set stands for those after them
TOUCHDOWNS = 0.05  # [s] between the times of the first touchdown that are tried
ALIGNED = 1e-9  # of a direction along an edge, whose bound says nothing about it


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
    return float(largest_impulses(snapshot, robot, double_support, direction[None], steps)[0])


def largest_impulses(
    snapshot: Snapshot, robot: Robot, double_support: float, directions: Matrix, steps: StepClass
) -> Vector:
    """The largest impulse in each direction that any controller of the class could survive [N s], shape (D,).

    Args:
        snapshot: before the push.
        robot: with its mass, soles, regions and foot speed.
        double_support: its duration T [s].
        directions: of the pushes in the world frame, unit vectors, shape (D, 2).
        steps: times to choose from.
    """
    grounds = _grounds(snapshot, robot, double_support, steps)
    choices = [(ground, times) for ground in grounds for times in _step_times(snapshot, double_support, steps)]
    if not choices:
        return np.zeros(len(directions))
    bounds = np.array([ground.bounds_without_reach(times, directions) for ground, times in choices])
    largest, solver = np.zeros(len(directions)), InteriorPointSolver()

    @cache
    def program(choice: int) -> _Program:
        ground, times = choices[choice]
        return ground.program(times)

    for k in range(len(directions)):
        while bounds[choice := int(np.argmax(bounds[:, k])), k] > largest[k]:
            found, elsewhere = program(choice).maximum(directions, k, solver, bounds[choice])
            largest[k] = max(largest[k], found)
            bounds[choice] = np.minimum(bounds[choice], elsewhere)
            bounds[choice, k] = found
    return largest


SUPPORT, BOTH = 0, -1
"""Foot of a CoP that is not the k-th foothold: the support foot, or both feet as they stand now."""


class _StepTimes:
    """Times of the touchdowns, and the CoPs over them by what each adds to the DCM at the end.

    The DCM at the end is growth * xi - sum of weights[i] z_i.
    """

    def __init__(self, waiting: float, flights: tuple[float, ...], double_support: float, omega: float) -> None:
        """Multiply the growth of the phases up, from the last one back to the first.

        Args:
            waiting: rest of the double support under way [s].
            flights: of each foot to its foothold [s].
            double_support: after each of them [s].
            omega: of the pendulum [1/s].
        """
        self.flights = flights
        a = math.exp(omega * double_support)
        mean = (a - 1.0) / (omega * double_support)
        last = len(flights)
        self.growth = 1.0
        weights: dict[int, float] = {}

        def add(foot: int, weight: float) -> None:
            weights[foot] = weights.get(foot, 0.0) + self.growth * weight

        for k in range(last, 0, -1):  # the flight to foothold k, over the foot before, and the double support after it
            add(k - 1, a - mean)
            add(k, mean - 1.0)
            self.growth *= a
            e = math.exp(omega * flights[k - 1])
            add(k - 1, e - 1.0)
            self.growth *= e
        if waiting > 0.0:
            e = math.exp(omega * waiting)
            add(BOTH, e - 1.0)
            self.growth *= e
        self.weights: Mapping[int, float] = weights
        """Sum of the weights of the CoPs in each sole, by its foot."""
        in_terminal_set = np.eye(last)[-1]
        self.foothold_weights = np.array([weights[k] for k in range(1, last + 1)]) + in_terminal_set
        """Coefficient of each foothold in the condition at the end, shape (K,)."""


@dataclass(frozen=True, slots=True, eq=False)
class _Edges:
    """A polygon as the points p with normals @ p <= bounds."""

    normals: Matrix
    """Shape (E, 2)."""
    bounds: Vector
    """[m], shape (E,)."""


class _Ground:
    """The support foot and what the controller may do from it, in the frame of that foot."""

    def __init__(self, snapshot: Snapshot, robot: Robot, side: Side, double_support: float, steps: StepClass) -> None:
        """Collect soles, regions and the viable set, with their extent along the normals of all of their edges.

        Args:
            snapshot: before the push.
            robot: that walks.
            side: of the support foot.
            double_support: its duration [s].
            steps: times to choose from.
        """
        omega = snapshot.pendulum.omega
        support, swing = snapshot.feet[side], snapshot.feet[side.other]
        self._R = rotation(support.yaw)
        self._swing = (swing.position - support.position) @ self._R
        self._dcm = (snapshot.dcm - support.position) @ self._R
        self._dcm_per_impulse = 1.0 / (robot.mass * omega)
        self._max_foot_speed = robot.max_foot_speed
        landing = [side.other if k % 2 == 0 else side for k in range(NB_STEPS)]
        shortest = StepTiming(double_support, steps.durations[0] - double_support, omega)
        viable = viable_vertices(robot.sole, 0.0, robot.foothold_region, shortest)[landing[-1]][-1]
        outlines = {foot: on_side(foot, robot.sole) for foot in Side}
        both = convex_hull(np.vstack([outlines[side], self._swing + outlines[side.other]]))
        soles = {SUPPORT: outlines[side], BOTH: both} | {k + 1: outlines[foot] for k, foot in enumerate(landing)}
        regions = [robot.foothold_region_at(0.0, foot) for foot in landing]
        self._regions = [_edges(region) for region in regions]
        shapes = [*regions[:2], viable, *(soles[foot] for foot in (SUPPORT, BOTH, 1))]
        self._normals = np.vstack([np.eye(2), -np.eye(2), *(_edges(shape).normals for shape in shapes)])
        self._of_soles = {foot: self._extent(sole) for foot, sole in soles.items()}
        self._of_regions = np.array([self._extent(region) for region in regions])
        self._of_viable = self._extent(viable)

    def _extent(self, vertices: Matrix) -> Vector:
        """How far a set reaches along each of the normals [m], shape (E,)."""
        return np.max(self._normals @ vertices.T, axis=1)

    def _room(self, times: _StepTimes) -> Vector:
        """How far the sum of the viable set and the soles reaches along each normal [m], shape (E,)."""
        return self._of_viable + sum(weight * self._of_soles[foot] for foot, weight in times.weights.items())

    def bounds_without_reach(self, times: _StepTimes, directions: Matrix) -> Vector:
        """An upper bound of `maximum` in each direction [N s], shape (D,): feet but the first fly at any speed.

        Args:
            times: of the touchdowns.
            directions: in the world frame, unit vectors, shape (D, 2).
        """
        extents = self._of_regions.copy()
        flown = np.abs(self._normals) @ (times.flights[0] * self._max_foot_speed)
        extents[0] = np.minimum(extents[0], self._normals @ self._swing + flown)
        of_steps = np.cumsum(times.foothold_weights[::-1])[::-1]
        room = self._room(times) + of_steps @ extents - times.growth * (self._normals @ self._dcm)
        along = times.growth * self._dcm_per_impulse * (self._normals @ (directions @ self._R).T)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.min(np.where(along > ALIGNED, room[:, None] / along, np.inf), axis=0)

    def program(self, times: _StepTimes) -> "_Program":
        """The program for these times of the touchdowns."""
        nb_feet = len(times.flights)
        n = 2 + 2 * nb_feet
        foot = [np.zeros((2, n)), *(np.eye(2, n, 2 + 2 * k) for k in range(nb_feet))]
        footholds = sum(weight * foot[k + 1] for k, weight in enumerate(times.foothold_weights))
        at_end = self._R.T @ np.eye(2, n) - footholds / times.growth
        rows = [self._normals @ at_end]
        bounds = [self._room(times) / times.growth - self._normals @ self._dcm]
        sides = np.vstack([np.eye(2), -np.eye(2)])
        for k, (region, flight) in enumerate(zip(self._regions, times.flights, strict=True)):
            rows.append(region.normals @ (foot[k + 1] - foot[k]))
            bounds.append(region.bounds)
            before, there = (foot[0], self._swing) if k == 0 else (foot[k - 1], np.zeros(2))
            rows.append(sides @ (foot[k + 1] - before))
            bounds.append(np.tile(flight * self._max_foot_speed, 2) + sides @ there)
        return _Program(np.vstack(rows), np.concatenate(bounds), self._dcm_per_impulse)


@dataclass(frozen=True, slots=True, eq=False)
class _Program:
    """Moves x of the DCM that are survived at some times: those with footholds f so that rows @ (x, f) <= bounds."""

    rows: Matrix
    """Shape (r, 2 + 2 K); x is in the world frame."""
    bounds: Vector
    """[m], shape (r,)."""
    dcm_per_impulse: float
    """How far an impulse moves the DCM [m/(N s)]."""

    def maximum(self, directions: Matrix, k: int, solver: Solver, known: Vector) -> tuple[float, Vector]:
        """The largest impulse in one direction; 0 if there is none [N s].

        Args:
            directions: in the world frame, unit vectors, shape (D, 2).
            k: number of that direction.
            solver: of the program.
            known: bounds of all directions so far [N s], shape (D,).

        Returns:
            That impulse, or its bound so far where the solver stalls; and the one at which each direction leaves the
            half plane of the edge that it lies on, shape (D,): no larger one is survived there.
        """
        G = np.column_stack([self.rows[:, :2] @ directions[k], self.rows[:, 2:]])
        n, nothing = G.shape[1], np.full(len(G), -np.inf)
        try:
            solution = solver.solve(QP(np.zeros((n, n)), -np.eye(1, n)[0], G, nothing, self.bounds))
        except InfeasibleError:
            return 0.0, known
        except NoSolutionFoundError:
            return float(known[k]), known
        y = solution.multipliers  # y @ rows is zero but for x: what follows from the rows for x alone
        along = directions @ (y @ self.rows[:, :2])
        with np.errstate(divide="ignore", invalid="ignore"):
            elsewhere = np.where(along > ALIGNED, y @ self.bounds / along, np.inf)
        return max(float(solution.u[0]), 0.0) / self.dcm_per_impulse, elsewhere / self.dcm_per_impulse


def _edges(vertices: Matrix) -> _Edges:
    planes = half_planes(vertices)
    both = np.isfinite(planes.lower)
    normals = np.vstack([planes.normals, -planes.normals[both]])
    return _Edges(normals, np.concatenate([planes.upper, -planes.lower[both]]))


def _grounds(snapshot: Snapshot, robot: Robot, double_support: float, steps: StepClass) -> list[_Ground]:
    """The ground of each foot that may carry the robot through the step under way."""
    sides = [snapshot.support.side]
    if snapshot.phase is not Phase.SINGLE_SUPPORT and steps.is_adaptive:
        sides.append(snapshot.support.side.other)
    return [_Ground(snapshot, robot, side, double_support, steps) for side in sides]


def _step_times(snapshot: Snapshot, T: float, steps: StepClass) -> Iterator[_StepTimes]:
    """All times to choose from."""
    for waiting, flight in _first_steps(snapshot, T, steps):
        for second, third in product(steps.durations, repeat=2):
            durations = [second, third, *[steps.durations[0]] * (NB_STEPS - 3)]
            flights = (flight, *(duration - T for duration in durations))
            yield _StepTimes(waiting, flights, T, snapshot.pendulum.omega)


def _first_steps(snapshot: Snapshot, T: float, steps: StepClass) -> Iterator[tuple[float, float]]:
    """Rest of the double support, and time in the air of the step under way [s]."""
    if snapshot.phase is Phase.STANDING:
        for flight in np.arange(steps.shortest_swing, steps.durations[-1], TOUCHDOWNS):
            yield 0.0, float(flight)
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
        yield waiting, float(time) - waiting
