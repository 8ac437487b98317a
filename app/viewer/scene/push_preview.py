"""The push that a hand is about to give: its arrow, its impulse, and what the QP would answer with.

That is the capture point right after it, and the steps, or a word where there are none: a robot that
stands catches a light push without.
"""

import math

import numpy as np
import viser

from app.drawing.outlines import is_caught
from app.drawing.palette import PUSH
from app.viewer.scene.arrows import CHEST, add_arrow, pull_points
from app.viewer.scene.footprints import PlannedSoles
from app.viewer.scene.markers import STYLES, add_dot, capture_point
from app.viewer.transport.stream import Stream
from walkcore import Parameters, Robot, Snapshot
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Side
from walkcore.values import Vector

HEIGHT = 0.010  # [m] of the steps, above those that are planned without the push
LABEL_LIFT = 0.12  # [m] above the arrow


class PushPreview:
    """Drawn while somebody drags."""

    def __init__(self, server: viser.ViserServer, root: str, robot: Robot) -> None:
        """Make the nodes once, invisible."""
        self._robot = robot
        self._root = f"{root}/preview"
        self._capture = f"{self._root}/capture_point"
        self._frame = f"{self._root}/at_com"
        self._arrow, self._label = f"{self._frame}/arrow", f"{self._frame}/label"
        server.scene.add_frame(self._root, show_axes=False, visible=False)
        server.scene.add_frame(self._frame, show_axes=False)
        add_arrow(server, self._arrow, PUSH, 0.022)
        server.scene.add_label(self._label, "", anchor="bottom-center", font_size_mode="screen", font_screen_scale=1.4)
        add_dot(server, self._capture, STYLES["capture_point"])
        colours = {Side.LEFT: PUSH, Side.RIGHT: PUSH}
        self._steps = PlannedSoles(
            server, f"{self._root}/steps", robot, colours, height=HEIGHT, opacity=0.35, thickness=3.0
        )

    def update(
        self,
        stream: Stream,
        snapshot: Snapshot,
        parameters: Parameters,
        impulse: Vector | None,
        answer: Snapshot | None,
    ) -> None:
        """Draw a push that is being aimed, or nothing.

        Args:
            stream: takes the changes.
            snapshot: of the robot now.
            parameters: in force.
            impulse: in the world frame [N s], shape (2,); None while nobody drags.
            answer: what the robot would do, where that is known already.
        """
        stream.visible(self._root, impulse is not None)
        if impulse is None:
            return
        height = CHEST * snapshot.com_height
        arrow = pull_points(impulse, height)
        stream.on_ground(self._frame, snapshot.com.position)
        stream.visible(self._arrow, True)
        stream.properties(self._arrow, points=arrow)
        stream.position(self._label, arrow[0, 1] + np.array([0.0, 0.0, LABEL_LIFT]))
        verdict = "" if answer is None else f": {_verdict(self._robot, answer, parameters)}"
        stream.properties(self._label, text=f"{np.hypot(*impulse):.0f} N·s{verdict}")
        self._steps.draw(stream, answer.plan.footholds if answer is not None and answer.plan is not None else ())
        stream.visible(self._capture, answer is not None)
        if answer is not None:
            omega = math.sqrt(parameters.gravity / answer.com_height)
            stream.on_ground(self._capture, capture_point(answer, omega), height=HEIGHT)


def _verdict(robot: Robot, answer: Snapshot, parameters: Parameters) -> str:
    if answer.plan is None or not answer.plan.is_capturable:
        return "would fall"
    if not is_caught(robot, answer, parameters):
        return "would probably fall"  # unless the next ticks find better steps, as few do
    if answer.status is Status.RELAXED:
        return "gives up margin"
    if answer.phase is Phase.STANDING:
        return "steps" if answer.plan.footholds else "stands"
    return "walks on"
