"""Survival of pushes: the largest impulse that a walk survives, from a saved state of it.

The nominal walk goes from rest to its steady state once; every trial branches from a state of that walk, so that no
trial walks there again. A trial is survived if the robot has not fallen 8 s after the push began, and has recovered by
the rule of `push_recovery`.

Survival is not monotonic in the impulse: a push that is hard enough to make the robot step at once may be survived
where a weaker one is not. So the whole range is scanned in coarse intervals, each interval between a survived and a
lethal impulse is bisected, and what is survived beyond the first lethal impulse is told as islands. An island that
lies between two impulses of the scan is not seen.
"""

from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from walkcore.analysis.push_bound import StepClass, largest_impulse
from walkcore.analysis.push_recovery import PushRecoveryMonitor, balance_state
from walkcore.command import Command, Push, Reference
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status
from walkcore.mpc.schemes import Footholds
from walkcore.mpc.stance import Side
from walkcore.parameters import Parameters
from walkcore.plant.world import PERFECT, World
from walkcore.robot import Robot
from walkcore.simulation import Simulation
from walkcore.snapshot import Snapshot
from walkcore.state import SimulationState
from walkcore.values import Vector

OBSERVED = 8.0
"""Time from the beginning of a push for which the robot has to stay on its feet [s]."""
STEADY = 8.0
"""Time of walking before the step that is pushed [s]."""
LOST_FOR = 0.05
"""Time for which a walk of fixed step timing has to be beyond capture until it counts as a fall [s]."""


@dataclass(frozen=True, slots=True)
class ImpulseScan:
    """Impulses to try, in one direction."""

    max_impulse: float
    """The largest impulse [N s]."""
    coarse: float
    """Largest distance between the impulses that are tried first [N s]."""
    tolerance: float
    """Width down to which the interval between a survived and a lethal impulse is bisected [N s]."""

    @property
    def grid(self) -> list[float]:
        """The impulses that are tried first, and none at all before them [N s]."""
        nb_intervals = max(1, int(np.ceil(self.max_impulse / self.coarse - 1e-9)))
        return np.linspace(0.0, self.max_impulse, nb_intervals + 1).tolist()


@dataclass(frozen=True, slots=True)
class SurvivedImpulses:
    """The impulses that are survived in one direction."""

    largest: float
    """The largest impulse that is survived with all smaller ones that were tried [N s]."""
    islands: tuple[tuple[float, float], ...]
    """Least and largest impulse of each further interval that is survived, beyond the first lethal one [N s]."""


def survived_impulses(survives: Callable[[float], bool], scan: ImpulseScan) -> SurvivedImpulses:
    """Scan coarsely, and bisect every interval between a survived and a lethal impulse.

    Args:
        survives: whether an impulse is survived [N s]; asked once for each. No push is survived without asking.
        scan: impulses to try.
    """
    grid = scan.grid
    outcomes = [True, *(survives(impulse) for impulse in grid[1:])]
    ends = [0.0]  # of the survived and lethal intervals in turn, the tried impulses next to each border
    for k in range(len(grid) - 1):
        if outcomes[k] is not outcomes[k + 1]:
            ends += _bisected(survives, grid[k], grid[k + 1], outcomes[k], scan.tolerance)
    if outcomes[-1]:
        ends.append(scan.max_impulse)
    # Borders alternate: survived from ends[0] to ends[1], lethal from ends[2] to ends[3], survived from ends[4] on.
    survived = [(ends[i], ends[i + 1]) for i in range(0, len(ends) - 1, 4)]
    return SurvivedImpulses(survived[0][1], tuple(survived[1:]))


def largest_survived(survives: Callable[[float], bool], scan: ImpulseScan) -> float:
    """The `largest` of `survived_impulses`, without a look beyond the first lethal impulse [N s].

    Args:
        survives: whether an impulse is survived [N s]; asked once for each.
        scan: impulses to try.
    """
    for low, high in pairwise(scan.grid):
        if not survives(high):
            return _bisected(survives, low, high, True, scan.tolerance)[0]
    return scan.max_impulse


def _bisected(
    survives: Callable[[float], bool], low: float, high: float, is_low_survived: bool, tolerance: float
) -> tuple[float, float]:
    """The two impulses on either side of a border, no farther from each other than the tolerance [N s]."""
    while high - low > tolerance:
        middle = (low + high) / 2
        if survives(middle) is is_low_survived:
            low = middle
        else:
            high = middle
    return low, high


@dataclass(frozen=True, slots=True, eq=False)
class BranchPoint:
    """A tick of the nominal walk, just before a push may begin."""

    state: SimulationState
    monitor: PushRecoveryMonitor
    """The judge of recoveries, which has seen the walk so far."""


class NominalWalk:
    """The steady walk of a robot to one reference, and what becomes of it after pushes.

    The point mass with feet walks for the ideal plant unless the body is wanted: its decisions are the same, but it
    knows no falls of the inverse kinematics, and a tick costs a sixth.
    """

    def __init__(
        self,
        robot: Robot,
        parameters: Parameters,
        reference: Reference,
        world: World = PERFECT,
        *,
        has_body: bool = False,
    ) -> None:
        """Walk from rest to the touchdown of the left foot that follows the steady state.

        Args:
            robot: that walks.
            parameters: of its walk.
            reference: to follow.
            world: that a plant with contact physics stands in.
            has_body: whether the whole body walks with the ideal plant, too; with contact physics it always does.
        """
        is_point_mass = parameters.plant == "ideal" and not has_body
        self.robot = replace(robot, body=None) if is_point_mass else robot
        self.parameters, self.reference, self.world = parameters, reference, world
        self._command = Command(reference)
        self._simulation = Simulation(self.robot, parameters, world=world)
        self._nb_ticks = round(OBSERVED / parameters.control_period)
        # A method without a QP only forecasts: it may catch what its forecast says is lost.
        is_planned = parameters.formulation.footholds is not Footholds.REGULATED
        self._is_loss_final = parameters.step_timing == "fixed" and parameters.plant == "ideal" and is_planned
        self._step_ticks = round(parameters.step_duration / parameters.control_period)
        self._points: dict[int, BranchPoint] = {}
        self._walk_to_touchdown()

    @property
    def has_fallen(self) -> bool:
        """Whether the robot fell before any push."""
        return not self._points

    def _walk_to_touchdown(self) -> None:
        """Walk on, and keep the branch points of one whole step, counted from the touchdown of the left foot."""
        simulation, monitor = self._simulation, PushRecoveryMonitor()
        steady = round(STEADY / self.parameters.control_period)
        before: Snapshot | None = None
        first: int | None = None
        for tick in range(steady + 3 * self._step_ticks):
            point = BranchPoint(simulation.state, deepcopy(monitor)) if tick >= steady else None
            now = simulation.step(self._command)
            if now.status is Status.FALLEN:
                self._points.clear()
                return
            if point is not None and first is None and _begins(before, now):
                first = tick
            if point is not None and first is not None:
                self._points[tick - first] = point
                if tick - first == self._step_ticks - 1:
                    return
            monitor.update(balance_state(now, self.robot.mass))
            before = now

    def branch_point(self, phase: float) -> BranchPoint:
        """The state at a phase of the step, counted from the touchdown of the left foot, in [0, 1).

        A robot that stands has no steps: its phase counts from some sample, over the time that a step would take.
        """
        return self._points[min(round(phase * self._step_ticks), self._step_ticks - 1)]

    def push_tick(self, phase: float) -> int:
        """Ticks from rest to the push at a phase of the step."""
        return self.branch_point(phase).state.model.tick

    def survives(self, phase: float, push: Push, seed: int | None = None) -> bool:
        """Whether the robot survives a push, decided as soon as that is certain.

        A robot that has recovered, and has walked one more step by the paper's QP, converges to its steady walk: each
        step leaves less than half of the distance. With fixed step timing a DCM that no step can catch is out of reach
        of a QP for good, since no later step comes sooner; a method without a QP is followed to the fall.
        Waiting for the end of `after` decides the same; a test compares them.

        Args:
            phase: of the step, in [0, 1).
            push: that begins then.
            seed: of the noise of the sensors from the push on; None for that of the world.
        """
        recovered_for = lost_for = 0
        lost_ticks = round(LOST_FOR / self.parameters.control_period)
        for now, monitor in self.after(phase, push, seed):
            if now.status is Status.FALLEN:
                return False
            assert now.plan is not None
            lost_for = lost_for + 1 if self._is_loss_final and not now.plan.is_capturable else 0
            if lost_for > lost_ticks:
                return False
            outcome = monitor.last
            has_recovered = outcome is not None and outcome.survived is True and now.status is Status.SOLVED
            recovered_for = recovered_for + 1 if has_recovered else 0
            if recovered_for > self._step_ticks:
                return True
        return recovered_for > 0

    def after(
        self, phase: float, push: Push, seed: int | None = None
    ) -> Iterator[tuple[Snapshot, PushRecoveryMonitor]]:
        """The ticks from a push on for which the robot has to stay on its feet, with the judge of the recovery.

        Args:
            phase: of the step, in [0, 1).
            push: that begins then.
            seed: as of `survives`.
        """
        point, simulation = self.branch_point(phase), self._with_seed(seed)
        monitor = deepcopy(point.monitor)
        simulation.restore(point.state)
        command = Command(self.reference, push)
        for _ in range(self._nb_ticks):
            now = simulation.step(command)
            monitor.update(balance_state(now, self.robot.mass))
            yield now, monitor
            command = self._command

    def _with_seed(self, seed: int | None) -> Simulation:
        if seed is None or seed == self._simulation.world.seed:
            return self._simulation
        return Simulation(self.robot, self.parameters, world=replace(self.world, seed=seed))

    def bound(self, phase: float, direction: Vector) -> float:
        """The largest impulse that any controller of the class of `push_bound` could survive [N s].

        Args:
            phase: of the step, in [0, 1).
            direction: unit vector in the heading frame, shape (2,).
        """
        self._simulation.restore(self.branch_point(phase).state)
        before = self._simulation.preview(self._command)
        double_support = self.parameters.double_support_duration
        return largest_impulse(before, self.robot, double_support, direction, StepClass())


def _begins(before: Snapshot | None, now: Snapshot) -> bool:
    """Whether the step that is pushed begins at a tick: the left foot has landed, or the robot stands anyway."""
    if now.phase is Phase.STANDING:
        return True
    has_landed = before is not None and before.phase is Phase.SINGLE_SUPPORT and now.phase is Phase.DOUBLE_SUPPORT
    return has_landed and now.support.side is Side.LEFT
