"""The push that a hand is about to give: its arrow, its impulse, and the steps that the QP would answer with."""

import numpy as np
import viser

from app.palette import PUSH
from app.viewer.arrows import CHEST, add_arrow, pull_points
from app.viewer.footprints import PlannedSoles
from app.viewer.stream import Stream
from walkcore import Robot, Snapshot
from walkcore.gait import Side
from walkcore.pattern_generator import Status
from walkcore.values import Vector

HEIGHT = 0.010  # [m] of the steps, above those that are planned without the push
LABEL_LIFT = 0.12  # [m] above the arrow


class PushPreview:
    """Drawn while somebody drags."""

    def __init__(self, server: viser.ViserServer, root: str, robot: Robot) -> None:
        """Make the nodes once, invisible."""
        self._root = f"{root}/preview"
        self._frame = f"{self._root}/at_com"
        self._arrow, self._label = f"{self._frame}/arrow", f"{self._frame}/label"
        server.scene.add_frame(self._root, show_axes=False, visible=False)
        server.scene.add_frame(self._frame, show_axes=False)
        add_arrow(server, self._arrow, PUSH, 0.022)
        server.scene.add_label(self._label, "", anchor="bottom-center", font_size_mode="screen", font_screen_scale=1.4)
        colours = {Side.LEFT: PUSH, Side.RIGHT: PUSH}
        self._steps = PlannedSoles(
            server, f"{self._root}/steps", robot, colours, height=HEIGHT, opacity=0.35, thickness=3.0
        )

    def update(self, stream: Stream, snapshot: Snapshot, impulse: Vector | None, answer: Snapshot | None) -> None:
        """Draw a push that is being aimed, or nothing.

        Args:
            stream: takes the changes.
            snapshot: of the robot now.
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
        stream.properties(self._label, text=f"{np.hypot(*impulse):.0f} N·s{_verdict(answer)}")
        self._steps.draw(stream, answer.plan.footholds if answer is not None and answer.plan is not None else ())


def _verdict(answer: Snapshot | None) -> str:
    if answer is None:
        return ""
    if answer.plan is None or not answer.plan.is_capturable:
        return ", would fall"
    return ", without margin" if answer.status is Status.RELAXED else ""
