# pyright: basic, reportMissingImports=false
# (Pinocchio and Coal ship no types)
"""Distances between the legs of a body.

Thighs, shins with their knees, ankles and feet of one side against those of the
other: the four links at the end of each leg, as the URDF's collision meshes, or as its
visual ones where a leg has none. Their convex hulls stand for them: never smaller, the
same distances where legs meet, and a hundred times faster to ask. Pairs that the robot's
SRDF disables are left out.
"""

from itertools import product

import coal
import numpy as np
import pinocchio as pin

from walkcore.motion.shapes import urdf_shapes
from walkcore.mpc.stance import Side
from walkcore.robot import BodyModel
from walkcore.values import Vector

NB_LINKS = 4  # thigh, shin, ankle, foot
SAFETY_DISTANCE = 0.015  # [m] between any two links
THIGH_DISTANCE = 0.005  # [m] between the thighs: their upper ends are built 12 mm apart, and hardly move at the hips


def leg_joints(body: BodyModel, model: pin.Model, side: Side) -> list[int]:
    """Joints from the hip to the sole, in the order of the chain."""
    root_and_universe = 2
    foot = model.frames[model.getFrameId(body.sole(side))].parentJoint
    return list(model.supports[foot])[root_and_universe:]


class LegDistances:
    """Distances between the links of the left and of the right leg. Holds scratch memory only."""

    def __init__(self, body: BodyModel, model: pin.Model) -> None:
        """Load the meshes.

        Args:
            body: names the URDF.
            model: built from the same URDF.
        """
        self._model, self._data = model, model.createData()
        for kind in (pin.GeometryType.COLLISION, pin.GeometryType.VISUAL):
            every = urdf_shapes(model, body.urdf, body.package_folder, kind)
            self._geometry = pin.GeometryModel()
            indices = {side: self._add_hulls(every, leg_joints(body, model, side)[-NB_LINKS:]) for side in Side}
            if all(indices.values()):
                break
        for left, right in product(indices[Side.LEFT], indices[Side.RIGHT]):
            self._geometry.addCollisionPair(pin.CollisionPair(left, right))
        if body.srdf is not None:
            pin.removeCollisionPairs(model, self._geometry, str(body.srdf), False)
        self._geometry_data = pin.GeometryData(self._geometry)
        thighs = {leg_joints(body, model, side)[-NB_LINKS] for side in Side}
        self._required = np.array(
            [
                THIGH_DISTANCE if {self._joint(pair.first), self._joint(pair.second)} == thighs else SAFETY_DISTANCE
                for pair in self._geometry.collisionPairs
            ]
        )

    def _add_hulls(self, every: pin.GeometryModel, joints: list[int]) -> list[int]:
        """Add the hulls of all meshes that these joints move, and their simpler shapes as they are; their indices."""
        indices: list[int] = []
        for link in every.geometryObjects:
            if link.parentJoint in joints:
                hull = link.copy()
                if isinstance(link.geometry, coal.BVHModelBase):
                    link.geometry.buildConvexHull(True, "Qt")
                    hull.geometry = link.geometry.convex
                indices.append(self._geometry.addGeometryObject(hull))
        return indices

    def _joint(self, index: int) -> int:
        """The joint that moves a link."""
        return self._geometry.geometryObjects[index].parentJoint

    def distances(self, q: Vector) -> Vector:
        """Distances between all pairs of links of opposite legs [m], shape (P,); negative where they overlap.

        Args:
            q: configuration in Pinocchio's order, shape (nq,).
        """
        pin.computeDistances(self._model, self._data, self._geometry, self._geometry_data, q)
        return np.array([result.min_distance for result in self._geometry_data.distanceResults])

    def clearance(self, q: Vector) -> float:
        """Least distance of a pair beyond its safety distance [m]; negative where a pair is too close.

        Infinite for a body whose legs have no shapes at all.

        Args:
            q: configuration of the body, shape (nq,).
        """
        return float(np.min(self.distances(q) - self._required, initial=np.inf))
