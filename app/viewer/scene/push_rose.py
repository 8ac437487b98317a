"""The rose of pushes on the ground around the robot: filled as far as it survives, outlined where no controller does.

Its distance from the CoM in a direction is the impulse of a push in that direction; the weakest one has its numbers.
"""

import numpy as np

from app.drawing.palette import PUSH, PUSH_ROSE
from app.viewer.scene.frame import Canvas, Frame
from app.viewer.scene.primitives import Faces, Points, add_lines, outline, raised
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore.analysis.push_rose import NB_DIRECTIONS, PushRose
from walkcore.mpc.plan import Status
from walkcore.values import Vector

LENGTH_PER_SPEED = 1.3  # [m per m/s] of the velocity that the impulse gives, of a robot of size 1
FARTHEST = 1.0  # [m/s] beyond which nothing is drawn: a robot of size 1 would see it 1.3 m away
HEIGHT = 0.004  # [m]
OPACITY = 0.45
FACES: Faces = np.array([[0, 1 + k, 1 + (k + 1) % NB_DIRECTIONS] for k in range(NB_DIRECTIONS)], dtype=np.uint32)
LABEL_PLACE, LABEL_HEIGHT = 0.7, 0.02  # of the way to the edge, [m]


class PushRoseDrawing:
    """Filled rose, its outer outline, and the weakest direction as a number; in a frame that moves with the CoM."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the nodes once, invisible."""
        scene, self._robot = canvas.server.scene, canvas.proportions
        self._frame = f"{canvas.root}/at_com"
        self._fill, self._edge = f"{self._frame}/survived", f"{self._frame}/edge"
        self._bound, self._label = f"{self._frame}/bound", f"{self._frame}/weakest"
        scene.add_frame(self._frame, show_axes=False, visible=False)
        scene.add_mesh_simple(
            self._fill,
            _rose(np.full(NB_DIRECTIONS, 0.01)),
            FACES,
            color=PUSH_ROSE,
            opacity=OPACITY,
            cast_shadow=False,
            receive_shadow=False,
        )
        add_lines(canvas.server, self._edge, PUSH_ROSE, 2.5, nb_segments=NB_DIRECTIONS, visible=True)
        add_lines(canvas.server, self._bound, PUSH, 1.5, nb_segments=NB_DIRECTIONS, visible=True)
        scene.add_label(self._label, "", anchor="center-center", font_size_mode="screen", font_screen_scale=1.2)
        self._drawn: PushRose | None = None

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Move the rose with the robot, and reshape it where there is a newer one."""
        snapshot, rose = frame.snapshot, frame.push_rose
        is_shown = rose is not None and snapshot.status is not Status.FALLEN
        updates.visible(self._frame, is_shown)
        if rose is None or not is_shown:
            return
        updates.on_ground(self._frame, snapshot.com.position, snapshot.heading, HEIGHT)
        if rose is self._drawn:
            return
        self._drawn = rose
        per_impulse = self._robot.size * LENGTH_PER_SPEED / self._robot.impulse_per_speed
        farthest = self._robot.size * LENGTH_PER_SPEED * FARTHEST
        survived, bound = (_rose(np.minimum(per_impulse * radii, farthest)) for radii in (rose.survived, rose.bound))
        updates.properties(self._fill, vertices=survived)
        updates.properties(self._edge, points=outline(survived[1:]))
        updates.properties(self._bound, points=outline(bound[1:]))
        weakest = int(np.argmin(rose.survived))
        x, y = (LABEL_PLACE * survived[1 + weakest, :2]).tolist()
        updates.position(self._label, (x, y, LABEL_HEIGHT))
        updates.properties(self._label, text=f"{rose.survived[weakest]:.0f} of {rose.bound[weakest]:.0f} N·s")


def _rose(radii: Vector) -> Points:
    """The middle, then a corner in each direction, counter-clockwise from x, shape (1 + D, 3)."""
    angles = np.linspace(0.0, 2.0 * np.pi, len(radii), endpoint=False)
    corners = radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return raised(np.round(np.vstack([np.zeros(2), corners]), 3), 0.0)
