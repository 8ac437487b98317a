"""Proportions of a robot, in which arrows, dots, camera and drags follow its size.

All sizes of the scene are given for a robot whose CoM is `HEIGHT` above the ground. For another one lengths go with the
height of its CoM, and impulses with its mass times the speed of a walk that looks alike, which goes with the root of
the height (Froude number); forces go with its weight.
"""

import math
from dataclasses import dataclass

from walkcore import Robot

HEIGHT = 0.87  # [m] of the CoM
GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True, slots=True)
class Proportions:
    """Size and mass of a robot."""

    size: float
    """Height of its CoM over `HEIGHT`: ratio of its lengths to those that the scene's sizes are given for."""
    mass: float
    """[kg]"""

    @classmethod
    def of(cls, robot: Robot) -> "Proportions":
        """Proportions of a robot."""
        return cls(robot.com_height / HEIGHT, robot.mass)

    @property
    def weight(self) -> float:
        """[N]."""
        return self.mass * GRAVITY

    @property
    def impulse_per_speed(self) -> float:
        """Impulse that looks like one that changes the velocity of a robot of size 1 by 1 m/s [N s / (m/s)]."""
        return self.mass * math.sqrt(self.size)
