"""Fit `swing_moments` of a robot file by least squares: what the swinging leg adds to the true CoP.

Run `.venv/bin/python benchmarks/swing_moments.py talos`.
"""

import sys

import numpy as np

from walkcore import Command, Reference, Simulation, load_robot
from walkcore.motion.swing_foot import swing_accelerations
from walkcore.mpc.gait import Phase

WALKS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.6, 0.5))  # shares of the largest reference speeds
TICKS, SKIPPED = 1000, 300  # of each walk; the first ones are still on the way to its speed


def samples(robot_name: str) -> tuple[np.ndarray, np.ndarray]:
    """Rows (foot, knee, com) and the error of the CoP, over single supports, for x and y below each other."""
    rows, errors = [], []
    robot = load_robot(robot_name)
    p, (slowest, fastest) = robot.parameters, robot.max_reference["vx"]
    for forward, left in WALKS:
        vx = forward * fastest if forward > 0.0 else -forward * slowest
        simulation = Simulation(robot)
        reference = Reference(vx, left * robot.max_reference["vy"][1])
        for tick in range(TICKS):
            s = simulation.step(Command(reference))
            if tick < SKIPPED or s.phase is not Phase.SINGLE_SUPPORT or s.time_to_touchdown < 0.01:
                continue
            landing, foot = s.time_to_touchdown, s.feet[s.support.side.other]
            lift_off = landing - p.step_duration + p.double_support_duration
            of_motion, of_apex = swing_accelerations(0.0, landing, lift_off, np.zeros(1))
            xy = of_motion @ [*foot.matrix[:, :2], s.plan.footholds[0].position]
            z = p.swing_height * of_apex
            rows += [(xy[0, 0], z[0], s.com.acceleration[0]), (xy[0, 1], 0.0, s.com.acceleration[1])]
            errors += list(s.true_cop - s.cop)
    return np.array(rows), np.array(errors)


def main(robot_name: str) -> None:
    """Print the moments, and what they leave unexplained."""
    rows, errors = samples(robot_name)
    moments, *_ = np.linalg.lstsq(rows, errors, rcond=None)
    left = errors - rows @ moments
    foot, knee, com = moments
    print(f"swing_moments: {{foot: {foot:.4f}, knee: {knee:.4f}, com: {com:.4f}}}")
    p95, unexplained = (np.percentile(np.abs(error), 95) for error in (errors, left))
    print(f"error of the CoP, p95: {p95:.4f} m; unexplained: {unexplained:.4f} m")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "talos")
