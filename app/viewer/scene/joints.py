"""Motion of the drawn joints: poses in their parents' frames, from the configuration of the robot.

A joint that turns by the angle t about its axis a, in a place turned by the quaternion p, has the quaternion

    p (cos t/2 + a sin t/2) = p cos t/2 + p a sin t/2

so that a drawn frame needs no matrices. It is written for plain numbers: a core that has slept since the last
frame takes longer to come back to the code of numpy or Pinocchio than for all of this.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports] (its wheel is found through a .pth file)

from app.viewer.transport.scene_updates import SceneUpdates

Quaternion = tuple[float, float, float, float]  # w, x, y, z


class Joint(Protocol):
    """Joint that moves a node."""

    def move(self, updates: SceneUpdates, node: str, q: Sequence[float]) -> None:
        """Put a node where a configuration, shape (nq,), has the joint."""
        ...


def joint_of(model: Any, index: int) -> Joint:
    """Joint of a model of Pinocchio by its index."""
    kind = model.joints[index]
    match kind.shortname():
        case "JointModelFreeFlyer" if model.jointPlacements[index].isIdentity():
            return FreeFlyer(kind.idx_q)
        case name if name.startswith("JointModelR") and kind.nq == 1:
            data = kind.createData()
            kind.calc(data, pin.neutral(model))  # fills in the axis
            place = pin.Quaternion(model.jointPlacements[index].rotation)
            return Hinge(kind.idx_q, _wxyz(place), _wxyz(place * pin.Quaternion(0.0, *data.S[3:].ravel())))
        case _:
            return AnyJoint(model, index)


@dataclass(frozen=True, slots=True)
class FreeFlyer:
    """Joint of a floating base, whose pose stands in the configuration."""

    first: int
    """Index of its first number in the configuration."""

    def move(self, updates: SceneUpdates, node: str, q: Sequence[float]) -> None:
        """See `Joint`."""
        x, y, z, qx, qy, qz, qw = q[self.first : self.first + 7]
        updates.position(node, (x, y, z))
        updates.orientation(node, (qw, qx, qy, qz))


@dataclass(frozen=True, slots=True)
class Hinge:
    """Revolute joint."""

    index: int
    """Index of its angle in the configuration."""
    place: Quaternion
    """p of the module's equation."""
    turned: Quaternion
    """p a of the module's equation."""

    def move(self, updates: SceneUpdates, node: str, q: Sequence[float]) -> None:
        """See `Joint`."""
        half = q[self.index] / 2
        c, s = math.cos(half), math.sin(half)
        (pw, px, py, pz), (tw, tx, ty, tz) = self.place, self.turned
        updates.orientation(node, (c * pw + s * tw, c * px + s * tx, c * py + s * ty, c * pz + s * tz))


class AnyJoint:
    """Joint of any other kind, by Pinocchio."""

    def __init__(self, model: Any, index: int) -> None:
        """Take a joint of a model."""
        self._kind, self._place = model.joints[index], model.jointPlacements[index]
        self._data = self._kind.createData()

    def move(self, updates: SceneUpdates, node: str, q: Sequence[float]) -> None:
        """See `Joint`."""
        self._kind.calc(self._data, np.array(q))
        x, y, z, qx, qy, qz, qw = pin.SE3ToXYZQUAT(self._place * self._data.M).tolist()
        updates.position(node, (x, y, z))
        updates.orientation(node, (qw, qx, qy, qz))


def _wxyz(quaternion: Any) -> Quaternion:
    return quaternion.w, quaternion.x, quaternion.y, quaternion.z
