"""The world of a plant with contact physics: its ground, its load, and the sensors that the robot has of it.

The model knows nothing of all this: it assumes flat ground, the mass of the robot file and exact measurements. How
far it carries in another world can be tried.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from types import MappingProxyType
from typing import Any

from walkcore.values import check_choice, check_keys, check_range, check_whole

LIMITS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "friction": (0.1, 2.0),
        "slope": (-0.1, 0.1),
        "strip_height": (0.0, 0.03),
        "payload": (0.0, 30.0),
        "mass_error": (-0.2, 0.2),
        "delay": (0.0, 0.05),
    }
)
"""Lowest and highest value of each key that is a number with a unit."""
SENSORS = ("exact", "noisy")
STRIP_SPACING = 0.5  # [m] from one strip to the next, along x
STRIP_WIDTH = 0.1  # [m]
MAX_SEED = 2**32 - 1


@dataclass(frozen=True, slots=True)
class World:
    """Everything around and in the robot that the model does not know."""

    friction: float = 0.8
    """Coulomb friction of the ground."""
    slope: float = 0.0
    """Angle by which the ground rises along x; x, y and z are those of the ground [rad]."""
    strip_height: float = 0.0
    """Height of strips that lie across the x axis every half metre, none under the robot at the start [m]."""
    payload: float = 0.0
    """Mass at the CoM of the torso [kg]."""
    mass_error: float = 0.0
    """Share by which every link is heavier than in the robot file."""
    sensors: str = "exact"
    """`noisy`: the CoM is estimated from an IMU, joint encoders and foot forces, each with noise."""
    delay: float = 0.0
    """Age of the measurements that the stabiliser gets [s]."""
    seed: int = 0
    """Of the noise."""

    def __post_init__(self) -> None:
        for name, (low, high) in LIMITS.items():
            object.__setattr__(self, name, check_range(f"world.{name}", getattr(self, name), low, high))
        check_choice("world.sensors", self.sensors, SENSORS)
        check_whole("world.seed", self.seed, 0, MAX_SEED)

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> "World":
        """A world of which some keys are given and the others have their defaults.

        Raises:
            InvalidValueError: for an unknown name, or a value beyond its limit.
        """
        return cls().changed(values)

    def changed(self, values: Mapping[str, Any]) -> "World":
        """This world with some keys replaced; raises as `from_mapping` does."""
        check_keys("world", values, {field.name for field in fields(self)})
        return replace(self, **values)

    def to_mapping(self) -> dict[str, Any]:
        """Plain numbers and strings by name."""
        return asdict(self)

    def gravity(self, g: float) -> tuple[float, float, float]:
        """Acceleration of gravity of magnitude g [m/s^2] in the frame of the ground."""
        return -g * math.sin(self.slope), 0.0, -g * math.cos(self.slope)


PERFECT = World()
"""Flat ground, no load, exact measurements."""
