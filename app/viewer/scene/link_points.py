"""Points of the drawn links: from a place in the scene to a link of the robot, and back while the link moves."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports] (its wheel is found through a .pth file)

from walkcore import Snapshot
from walkcore.motion.body_model import load_model
from walkcore.robot import BodyModel
from walkcore.values import Matrix, Vector


class LinkPoints:
    """Forward kinematics of the drawn robot, for points that somebody holds."""

    def __init__(self, body: BodyModel, links: Mapping[str, str], world: Callable[[], tuple[Matrix, Vector]]) -> None:
        """Take the robot of a scene.

        Args:
            body: of the robot.
            links: joint that moves each drawn mesh, by the path of its node.
            world: rotation of the world in the scene, shape (3, 3), and place of its origin there [m], shape (3,); both
                move with the robot.
        """
        self._model: Any = load_model(body)
        self._data = self._model.createData()
        self._links, self._world = links, world

    def grabbed(self, node: str, p_scene_point: Vector, snapshot: Snapshot) -> tuple[str, Vector]:
        """The link of a mesh, and a point of it in the frame of its joint [m], shape (3,).

        Args:
            node: path of the mesh.
            p_scene_point: place of the point in the scene [m], shape (3,).
            snapshot: of the robot.
        """
        link, (rotation, origin) = self._links[node], self._world()
        return link, self._place(link, snapshot).actInv(rotation.T @ (p_scene_point - origin))

    def in_world(self, link: str, point: Vector, snapshot: Snapshot) -> Vector:
        """Place of a point of a link in the world frame [m], shape (3,)."""
        return np.array(self._place(link, snapshot).act(point))

    def in_scene(self, link: str, point: Vector, snapshot: Snapshot) -> Vector:
        """Place of a point of a link in the scene [m], shape (3,)."""
        rotation, origin = self._world()
        return rotation @ self.in_world(link, point, snapshot) + origin

    def _place(self, link: str, snapshot: Snapshot) -> Any:
        pin.forwardKinematics(self._model, self._data, snapshot.q)
        return self._data.oMi[self._model.getJointId(link)]
