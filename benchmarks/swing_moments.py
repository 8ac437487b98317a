"""Fit `swing_moments` of a robot file by least squares: what the swinging leg adds to the true CoP.

Run `.venv/bin/python benchmarks/swing_moments.py talos`; `walk import` does the same.
"""

import sys

from walkcore import load_robot
from walkcore.robot_import.swing_fit import fit_swing_moments


def main(robot_name: str) -> None:
    """Print the moments, and what they leave unexplained."""
    robot = load_robot(robot_name)
    fit = fit_swing_moments(robot, robot.parameters.control_period)
    found = fit.moments
    print(f"swing_moments: {{foot: {found.foot:.4f}, knee: {found.knee:.4f}, com: {found.com:.4f}}}")
    print(f"error of the CoP, p95: {fit.error:.4f} m; unexplained: {fit.unexplained:.4f} m")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "talos")
