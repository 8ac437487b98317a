"""The rose of pushes: how hard a push in each direction could be now, with the robot on its feet afterwards.

Two impulses for each direction. The one is survived by the plan that the controller would make in the next tick: the
DCM at its end can be caught by further steps, and the legs are long enough for it. That plan is made, as a preview,
for impulse after impulse: a word of the controller itself, given in a millisecond, where to walk on until the robot
stands or lies would take a second. The other is the bound of `push_bound`, which no controller of that class survives.
"""

import math
from dataclasses import dataclass

import numpy as np

from walkcore.analysis.push_bound import StepClass, largest_impulses
from walkcore.analysis.survival import ImpulseScan, largest_survived
from walkcore.command import Command, Push, Reference
from walkcore.simulation import Simulation
from walkcore.snapshot import Snapshot
from walkcore.values import Vector, freeze

NB_DIRECTIONS = 16
NB_INTERVALS, NB_HALVINGS = 4, 4
"""Intervals of the impulses that are tried first, up to the robot's limit, and halvings of each border."""


@dataclass(frozen=True, slots=True, eq=False)
class PushRose:
    """Largest impulses of a push at a tick, in evenly spaced directions, counter-clockwise from straight ahead."""

    tick: int
    survived: Vector
    """Survived by the controller's plan, with all smaller ones that were tried; at most the robot's limit [N s]."""
    bound: Vector
    """Survived by no controller, but for rounding, that is harder [N s]."""

    @property
    def directions(self) -> Vector:
        """Directions of the pushes in the heading frame [rad], shape (D,)."""
        return np.linspace(0.0, 2.0 * math.pi, len(self.survived), endpoint=False)


def push_rose(simulation: Simulation, reference: Reference, nb_directions: int = NB_DIRECTIONS) -> PushRose | None:
    """The rose at the coming tick of a robot, which does not feel it; None once it has fallen.

    Args:
        simulation: of the robot.
        reference: that it follows.
        nb_directions: from which it is pushed.
    """
    robot, parameters = simulation.robot, simulation.parameters
    before = simulation.preview(Command(reference))
    if before.plan is None:
        return None
    step = robot.max_push / NB_INTERVALS
    scan = ImpulseScan(robot.max_push, step, step / 2**NB_HALVINGS)
    angles = before.heading + np.linspace(0.0, 2.0 * math.pi, nb_directions, endpoint=False)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])

    def survives(direction: Vector, impulse: float) -> bool:
        push = Push((1.0 - 1e-9) * impulse * direction, frame="world")  # so that rounding stays below the limit
        return is_survived(simulation.preview(Command(reference, push)), robot.max_com_distance)

    survived = [largest_survived(lambda impulse, d=d: survives(d, impulse), scan) for d in directions]
    bound = largest_impulses(before, robot, parameters.double_support_duration, directions, StepClass())
    return PushRose(before.tick, freeze(np.array(survived)), freeze(bound))


def is_survived(after: Snapshot, max_com_distance: float) -> bool:
    """Whether steps can catch the robot at the end of the plan right after a push, and its legs are long enough for it.

    Args:
        after: first snapshot after the push.
        max_com_distance: horizontal distance of the CoM from the support foot for which a leg is long enough [m].
    """
    plan = after.plan
    return plan is not None and plan.is_capturable and plan.max_leg_extension() <= max_com_distance
