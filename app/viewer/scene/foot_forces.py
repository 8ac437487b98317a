"""Forces of the ground as bars beside the soles, as high as the force is large."""

import numpy as np

from app.drawing.palette import FOOT_FORCE
from app.viewer.scene.frame import Canvas, Frame
from app.viewer.scene.primitives import add_lines
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore.mpc.stance import Side
from walkcore.values import rotation

HEIGHT_OF_WEIGHT = 0.6  # [m] of a bar for the whole weight of a robot of size 1
BESIDE = 0.07  # [m] from the outer edge of its sole, so that the leg does not hide it
THICKNESS = 9.0  # pixels
RESOLUTION = 0.005  # [m]; a smaller change is not sent


class FootForcesDrawing:
    """One bar for each sole."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the nodes once, invisible."""
        robot = canvas.proportions
        self._per_newton = HEIGHT_OF_WEIGHT * robot.size / robot.weight
        self._beside = float(canvas.robot.sole[:, 1].max()) + BESIDE * robot.size
        self._bars = {side: f"{canvas.root}/{side.name.lower()}" for side in Side}
        for bar in self._bars.values():
            add_lines(canvas.server, bar, FOOT_FORCE, THICKNESS)

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the normal force on each sole that has any."""
        plant = frame.snapshot.plant
        for side, bar in self._bars.items():
            force = 0.0 if plant is None else plant.contact.forces[side]
            height = RESOLUTION * round(force * self._per_newton / RESOLUTION)
            updates.visible(bar, height > 0.0)
            if plant is not None and height > 0.0:
                sole = plant.measured.soles[side]
                outwards = side.sign * self._beside
                updates.on_ground(bar, sole.position[:2] + rotation(sole.yaw) @ np.array([0.0, outwards]))
                updates.properties(bar, points=np.array([[(0.0, 0.0, 0.0), (0.0, 0.0, height)]], dtype=np.float32))
