"""The fastest references that a robot walks within the limits of its joints, found by short walks in the ideal model.

Each direction starts from its limit in the robot file, and goes down until a walk keeps the promises of one: it does
not fall, soles and CoM are within a millimetre of their targets, and no joint turns faster than its limit.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from walkcore.command import Command, Reference
from walkcore.mpc.plan import Status
from walkcore.robot import Robot
from walkcore.simulation import Simulation

PERIOD = 0.01  # [s] of a tick: joint speeds are means over it
NB_STEPS = 6  # of a walk: from rest to the speed that it keeps
SLOWER = 0.85  # from one try to the next
NB_TRIES = 12  # down to a sixth
MAX_IK_ERROR = 1e-3  # [m]


def keeps_limits(robot: Robot, reference: Reference) -> bool:
    """Whether the robot walks with a reference within the limits of its joints.

    Args:
        robot: with a body.
        reference: from rest on.
    """
    p = replace(robot.parameters, control_period=PERIOD, dynamic_filter=True)
    simulation, q = Simulation(robot, p), None
    body = simulation.body
    assert body is not None
    for _ in range(round(NB_STEPS * p.step_duration / PERIOD)):
        now = simulation.step(Command(reference))
        if now.status is Status.FALLEN or now.q is None:
            return False
        com = np.array([*(now.com.position + now.com_offset), now.com_height])
        if max(body.errors(now.q, com, now.feet)) > MAX_IK_ERROR:
            return False
        if q is not None and np.any(np.abs(now.q - q)[7:] > body.max_speeds * PERIOD):
            return False
        q = now.q
    return True


def fastest_references(robot: Robot) -> Iterator[tuple[str, tuple[float, float]]]:
    """Lowest and highest reference of each component that the robot keeps, none beyond those of its file.

    Zero where not even a sixth of the file's is kept.

    Args:
        robot: with a body.
    """
    for name, (low, high) in robot.max_reference.items():
        yield name, (_kept(robot, name, low), _kept(robot, name, high))


def _kept(robot: Robot, name: str, limit: float) -> float:
    tries = (round(limit * SLOWER**step, 3) for step in range(NB_TRIES))
    return next((value for value in tries if keeps_limits(robot, Reference(**{name: value}))), 0.0)
