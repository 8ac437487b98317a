"""A robot as the walking motion generation sees it: mass, height, soles, and the regions of its feet."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from walkcore.command import Push, Reference
from walkcore.mpc.lipm import Pendulum
from walkcore.mpc.regions import closest_band
from walkcore.mpc.stance import Footstep, Side, on_side
from walkcore.parameters import Parameters
from walkcore.values import Matrix, Vector, check_range


@dataclass(frozen=True, slots=True)
class FixedFrame:
    """Frame that is fixed to a link: of a sole, x forward and origin in its plane; of the torso, upright."""

    name: str
    link: str
    """Frame of the URDF that it is fixed to; the frame itself where both have the same name."""
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Origin in that frame [m]."""
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Roll, pitch and yaw in that frame [rad]."""


@dataclass(frozen=True, slots=True)
class ReplacedLimits:
    """Limits of a joint that stand instead of those of the URDF, where a better source is known."""

    joint: str
    source: str
    """Where they come from, and why they are better than the URDF's."""
    velocity: float | None = None
    """[rad/s]; None keeps the URDF's."""
    effort: float | None = None
    """[N m]; None keeps the URDF's."""


@dataclass(frozen=True, slots=True)
class BodyModel:
    """Files and frames that describe the whole body of a robot."""

    urdf: Path
    package_folder: Path
    """Folder in which the `package://` addresses of the URDF start."""
    left_sole_frame: FixedFrame
    right_sole_frame: FixedFrame
    torso_frame: FixedFrame
    """Frame that is held upright, and turns with the heading."""
    srdf: Path | None = None
    posture: str = ""
    """Name of a reference configuration of the SRDF, where there is one."""
    posture_angles: tuple[tuple[str, float], ...] = ()
    """Joints by name, and their angles in the posture [rad]; the others are at zero, or as the SRDF says."""
    fixed_joints: tuple[str, ...] = ()
    """Joints that are held fast at their angle in the posture, such as those of hands."""
    replaced_limits: tuple[ReplacedLimits, ...] = ()
    """Limits that are not the URDF's."""

    @property
    def left_sole(self) -> str:
        """Name of the left sole frame."""
        return self.left_sole_frame.name

    @property
    def right_sole(self) -> str:
        """Name of the right sole frame."""
        return self.right_sole_frame.name

    @property
    def torso(self) -> str:
        """Name of the torso's frame."""
        return self.torso_frame.name

    def sole(self, side: Side) -> str:
        """Name of a foot's sole frame."""
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
    title: str
    """Name as it is written in a sentence, with its capitals."""
    source: str
    """Name or path from which `load_robot` reads it again."""
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
    tipping_margin: float
    """Distance that the CoP commanded to a body in physics keeps from the edges of its soles: nearer, they tip [m]."""
    swing_moments: SwingMoments
    """Zero for a robot without a body."""
    parameters: Parameters
    """The paper's, with the gait that suits this robot's size."""
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
        return on_side(landing, self.foothold_regions[closest_band(bands, yaw * landing.sign)].vertices)

    def pendulum(self, parameters: Parameters) -> Pendulum:
        """The model that the CoM follows with some parameters, which may name another height."""
        height = self.com_height if parameters.com_height is None else parameters.com_height
        return Pendulum(height, parameters.gravity)

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
