"""Swing moments of a robot for the dynamic filter: what its swinging leg adds to the true CoP, by least squares.

    p_true - p_model = foot ddf + knee ddz n + com ddc        (`motion/dynamic_filter.py`)

over the single supports of short walks in the ideal model. Walks that end in a fall count until then.
"""

from dataclasses import dataclass, replace

import numpy as np

from walkcore.command import Command, Reference
from walkcore.errors import InvalidValueError
from walkcore.motion.swing_foot import swing_accelerations
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status
from walkcore.robot import Robot, SwingMoments
from walkcore.simulation import Simulation
from walkcore.values import Matrix, Vector

WALKS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.6, 0.5))  # shares of the largest reference speeds
DURATION, SKIPPED = 5.0, 1.5  # [s] of each walk, the first of which are still on the way to its speed
LATE = 0.01  # [s] before touchdown, when a foothold that moves makes the foot jump
LEAST_SAMPLES = 100


@dataclass(frozen=True, slots=True)
class SwingFit:
    """Moments, and how well they explain the error of the CoP."""

    moments: SwingMoments
    error: float
    """Error of the CoP without them, 95th percentile [m]."""
    unexplained: float
    """The same with them [m]."""


def fit_swing_moments(robot: Robot, control_period: float) -> SwingFit:
    """Walk, and fit.

    Args:
        robot: with a body.
        control_period: of the walks [s].

    Raises:
        InvalidValueError: if the robot falls before there is enough to fit.
    """
    rows, errors = _samples(robot, control_period)
    if len(errors) < LEAST_SAMPLES:
        raise InvalidValueError("robot", robot.name, "falls too soon in the ideal model to fit its swing moments")
    found, *_ = np.linalg.lstsq(rows, errors, rcond=None)
    error, unexplained = (float(np.percentile(np.abs(one), 95)) for one in (errors, errors - rows @ found))
    foot, knee, com = found.tolist()
    return SwingFit(SwingMoments(foot, knee, com), error, unexplained)


def _samples(robot: Robot, control_period: float) -> tuple[Matrix, Vector]:
    """Rows (foot, knee, com) and the error of the CoP, for x and y below each other."""
    rows: list[tuple[float, float, float]] = []
    errors: list[float] = []
    p = replace(robot.parameters, control_period=control_period)
    (slowest, fastest), (_, sideways) = robot.max_reference["vx"], robot.max_reference["vy"]
    for forward, left in WALKS:
        vx = forward * fastest if forward > 0.0 else -forward * slowest
        simulation, reference = Simulation(robot, p), Reference(vx=vx, vy=left * sideways)
        for tick in range(round(DURATION / control_period)):
            s = simulation.step(Command(reference))
            if s.status is Status.FALLEN:
                break
            is_late = s.time_to_touchdown < LATE
            if tick * control_period < SKIPPED or s.phase is not Phase.SINGLE_SUPPORT or is_late:
                continue
            assert s.plan is not None and s.true_cop is not None
            landing, foot = s.time_to_touchdown, s.feet[s.support.side.other]
            lift_off = landing - p.step_duration + p.double_support_duration
            of_motion, of_apex = swing_accelerations(0.0, landing, lift_off, np.zeros(1))
            xy = (of_motion @ [*foot.matrix[:, :2], s.plan.footholds[0].position])[0]
            z = float(p.swing_height * of_apex[0])
            rows += [(xy[0], z, s.com.acceleration[0]), (xy[1], 0.0, s.com.acceleration[1])]
            errors += list(s.true_cop - s.cop)
    return np.array(rows).reshape(-1, 3), np.array(errors)
