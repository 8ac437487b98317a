"""A robot as the walking motion generation sees it: mass, height, soles, and the regions of its feet."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import distribution
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from walkcore.command import Push, Reference
from walkcore.errors import UnknownNameError
from walkcore.mpc.regions import closest_band, foothold_vertices
from walkcore.mpc.stance import Footstep, Side
from walkcore.plain_yaml import load_yaml
from walkcore.values import Matrix, Vector, check_range, frozen_copy

ROBOTS = files("walkcore") / "robots"


@dataclass(frozen=True, slots=True)
class BodyModel:
    """Files and frames that describe the whole body of a robot."""

    urdf: Path
    srdf: Path
    package_folder: Path
    """Folder in which the `package://` addresses of the URDF start."""
    posture: str
    """Name of a reference configuration of the SRDF."""
    left_sole: str
    right_sole: str
    torso: str
    """Names of the frames that the whole-body control holds."""

    def sole(self, side: Side) -> str:
        """Name of a foot's sole frame: x forward, origin in the plane of the sole."""
        return self.left_sole if side is Side.LEFT else self.right_sole


@dataclass(frozen=True, slots=True)
class SwingMoments:
    """Moments of the moving masses about the CoM, per weight of the robot: see `dynamic_filter`."""

    foot: float
    """[s^2]."""
    knee: float
    """[s^2]."""
    com: float
    """[s^2]."""


@dataclass(frozen=True, slots=True, eq=False)
class FootholdRegion:
    """Region of the left foot for a band of yaws against the right foot; mirrored for the right foot."""

    lowest_yaw: float
    """Toes out is positive [rad]."""
    highest_yaw: float
    """[rad]."""
    vertices: Matrix
    """Corners in the right foot's frame [m], shape (V, 2)."""


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """The quantities of a robot, as `robots/<name>.yaml` holds them."""

    name: str
    mass: float
    """[kg]."""
    com_height: float
    """Height of the CoM above the ground [m]."""
    stance_width: float
    """Distance between the sole frames at rest [m]."""
    sole: Matrix
    """Outline of the left sole in its own frame [m], shape (V, 2); the right one is its mirror image."""
    foothold_regions: tuple[FootholdRegion, ...]
    """Regions of a foothold, from toes in to toes out."""
    max_foot_speed: Vector
    """v_max of (30), along x and y of the support foot's frame [m/s], shape (2,)."""
    max_foot_yaw_rate: float
    """Largest yaw rate of the foot in the air [rad/s]."""
    max_com_distance: float
    """Horizontal distance of the CoM from the support foot beyond which the leg is too short: a fall [m]."""
    max_reference: Mapping[str, tuple[float, float]]
    """Lowest and highest reference vx, vy [m/s] and yaw_rate [rad/s]."""
    max_push: float
    """Largest impulse that may be given [N s]."""
    swing_moments: SwingMoments
    """Zero for a robot without a body."""
    body: BodyModel | None
    """None for a robot that is simulated as a point mass with feet."""

    @property
    def foothold_region(self) -> Matrix:
        """Region of the left foot, straight, in the right foot's frame [m], shape (V, 2)."""
        return self.foothold_region_at(0.0, Side.LEFT)

    def foothold_region_at(self, yaw: float, landing: Side) -> Matrix:
        """Region of a foot in the frame of the support foot [m], shape (V, 2).

        Args:
            yaw: of the landing foot against the support foot, counter-clockwise [rad].
            landing: side of the landing foot, not of the support.
        """
        bands = [(region.lowest_yaw, region.highest_yaw) for region in self.foothold_regions]
        return foothold_vertices(self.foothold_regions[closest_band(bands, yaw * landing.sign)].vertices, landing)

    def foot_at_rest(self, side: Side) -> Footstep:
        """Place of a foot before the first command: the robot stands around the origin, facing x."""
        return Footstep(side, np.array([0.0, side.sign * self.stance_width / 2]), 0.0)

    def check_reference(self, reference: Reference) -> Reference:
        """The reference, if it lies within the limits of this robot.

        Raises:
            InvalidValueError: naming the component, its value and its limits.
        """
        for name, (low, high) in self.max_reference.items():
            check_range(f"reference.{name}", getattr(reference, name), low, high)
        return reference

    def clamped_reference(self, reference: Reference) -> Reference:
        """The nearest reference within the limits of this robot."""
        limits = self.max_reference
        return Reference(
            **{name: min(max(getattr(reference, name), limits[name][0]), limits[name][1]) for name in limits}
        )

    def check_push(self, push: Push) -> Push:
        """The push, if it is not stronger than this robot's limit.

        Raises:
            InvalidValueError: naming the strength and its limit.
        """
        check_range("push.impulse", math.hypot(*push.impulse), 0.0, self.max_push)
        check_range("push.duration", push.duration, 0.0, 10.0)
        return push


def robot_names() -> list[str]:
    """Names of the robots that ship."""
    return sorted(Path(str(entry)).stem for entry in ROBOTS.iterdir() if str(entry).endswith(".yaml"))


@cache
def load_robot(name: str) -> Robot:
    """The robot of that name, a value that is read once.

    Raises:
        UnknownNameError: if there is none.
    """
    if name not in robot_names():
        raise UnknownNameError("robot", name, robot_names())
    data = load_yaml(ROBOTS / f"{name}.yaml", "robot")
    return Robot(
        name=data["name"],
        mass=float(data["mass"]),
        com_height=float(data["com_height"]),
        stance_width=float(data["stance_width"]),
        sole=frozen_copy(data["sole"]),
        foothold_regions=tuple(
            FootholdRegion(float(band["yaw"][0]), float(band["yaw"][1]), frozen_copy(band["region"]))
            for band in data["foothold_regions"]
        ),
        max_foot_speed=frozen_copy(data["max_foot_speed"], shape=(2,)),
        max_foot_yaw_rate=float(data["max_foot_yaw_rate"]),
        max_com_distance=float(data["max_com_distance"]),
        max_reference={key: (float(low), float(high)) for key, (low, high) in data["max_reference"].items()},
        max_push=float(data["max_push"]),
        swing_moments=SwingMoments(**data.get("swing_moments", {"foot": 0.0, "knee": 0.0, "com": 0.0})),
        body=_body_model(data["body"]) if "body" in data else None,
    )


def _body_model(data: Mapping[str, Any]) -> BodyModel:
    folder = Path(str(distribution(data["package"]).locate_file(data["folder"])))
    return BodyModel(
        urdf=folder / data["urdf"],
        srdf=folder / data["srdf"],
        package_folder=folder.parents[2],
        posture=data["posture"],
        left_sole=data["left_sole"],
        right_sole=data["right_sole"],
        torso=data["torso"],
    )
