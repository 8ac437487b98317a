"""Pushes as arrows at the height of the chest: the last one for a moment, and the one that somebody is aiming.

With the aimed push its effect is drawn: the DCM right after it, the steps that the QP would take,
and a word where there are none, since a robot that stands catches a light push without a step.
"""

import numpy as np

from app.drawing.palette import PUSH
from app.viewer.scene.footprints import FootholdMarks
from app.viewer.scene.frame import Canvas, Frame, is_shortened
from app.viewer.scene.points import MODEL_DCM
from app.viewer.scene.primitives import Points, PolygonStyle, add_arrow, add_dot, raised
from app.viewer.scene.proportions import Proportions
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import Parameters, Robot, Snapshot
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status
from walkcore.mpc.schemes import Footholds
from walkcore.mpc.stance import Side
from walkcore.values import Vector

CHEST = 1.35  # height of the arrow, in heights of the CoM
# Lengths of a robot of size 1; see `Proportions`.
CLEARANCE = 0.46  # [m] from the CoM to the near end of the arrow, outside the arms: a light push has a short arrow
LENGTH, LENGTH_PER_SPEED = 0.15, 0.9  # [m], [m per m/s] of the velocity that the impulse gives
LENGTH_PER_WEIGHT = 2.65  # [m] of the arrow of a force as large as the weight
SHAFT = 0.022  # [m]
SECONDS_SHOWN = 0.6
RECENT = 2.4  # [s] of simulated time, which passes up to four times as fast
STEP_STYLE = PolygonStyle(PUSH, 0.010, opacity=0.35, thickness=3.0)  # above the steps planned without the push
LABEL_LIFT = 0.12  # [m] above the arrow


class PushDrawing:
    """Arrow of the last push, shown for a moment, and the preview of the next one."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the nodes once, invisible."""
        self._frame, self._arrow = f"{canvas.root}/at_com", f"{canvas.root}/at_com/last"
        canvas.server.scene.add_frame(self._frame, show_axes=False)
        self._robot = canvas.proportions
        add_arrow(canvas.server, self._arrow, PUSH, SHAFT * self._robot.size)
        self._seconds_left = 0.0
        self._preview = PushPreview(canvas)

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw a push since the last frame, hide it after its time, and draw a push that is being aimed."""
        snapshot, push = frame.snapshot, frame.history.new_push
        self._seconds_left = max(0.0, self._seconds_left - frame.elapsed)
        # An older one was given while nobody was watching.
        if push is not None and (snapshot.tick - push.tick) * frame.parameters.control_period < RECENT:
            self._seconds_left = SECONDS_SHOWN
            points = arrow_away(-np.array(push.impulse), CHEST * snapshot.com_height, self._robot)[:, ::-1]
            updates.properties(self._arrow, points=points)
        if self._seconds_left > 0.0:
            updates.on_ground(self._frame, snapshot.com.position)
        is_held = frame.aim is not None and frame.aim.force is not None  # which is drawn as an arrow of its own
        updates.visible(self._arrow, self._seconds_left > 0.0 and not is_held)
        self._preview.update(updates, frame)


class PushPreview:
    """Arrow, impulse and effect of a push that somebody is aiming."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the nodes once, invisible."""
        scene = canvas.server.scene
        self._robot, self._proportions = canvas.robot, canvas.proportions
        self._root = f"{canvas.root}/preview"
        self._dcm, self._frame = f"{self._root}/dcm", f"{self._root}/at_com"
        self._arrow, self._label = f"{self._frame}/arrow", f"{self._frame}/label"
        scene.add_frame(self._root, show_axes=False, visible=False)
        scene.add_frame(self._frame, show_axes=False)
        size = self._proportions.size
        add_arrow(canvas.server, self._arrow, PUSH, SHAFT * size)
        scene.add_label(self._label, "", anchor="bottom-center", font_size_mode="screen", font_screen_scale=1.4)
        add_dot(canvas.server, self._dcm, MODEL_DCM.colour, MODEL_DCM.radius * size)
        self._steps = FootholdMarks(canvas, f"{self._root}/steps", dict.fromkeys(Side, STEP_STYLE))

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the aimed push, or nothing."""
        aim, snapshot = frame.aim, frame.snapshot
        updates.visible(self._root, aim is not None)
        if aim is None:
            return
        after = aim.preview
        if aim.force is None or aim.point is None:
            arrow = arrow_away(aim.impulse, CHEST * snapshot.com_height, self._proportions)
            updates.on_ground(self._frame, snapshot.com.position)
        else:
            arrow = arrow_from(aim.force, self._proportions)
            updates.position(self._frame, aim.point)
        updates.visible(self._arrow, True)
        updates.properties(self._arrow, points=arrow)
        updates.position(self._label, arrow[0, 1] + np.array([0.0, 0.0, LABEL_LIFT * self._proportions.size]))
        effect = "" if after is None else f": {effect_of_push(self._robot, after, frame.parameters)}"
        impulse = f"{np.hypot(*aim.impulse):.0f} N·s"
        text = f"{impulse}{effect}" if aim.force is None else f"{np.hypot(*aim.force):.0f} N, {impulse} so far"
        updates.properties(self._label, text=text)
        self._steps.draw(updates, after.plan.footholds if after is not None and after.plan is not None else ())
        updates.visible(self._dcm, after is not None)
        if after is not None:
            updates.on_ground(self._dcm, after.dcm, height=STEP_STYLE.height)


def arrow_away(impulse: Vector, height: float, robot: Proportions) -> Points:
    """Ends of an arrow along an impulse that starts at the robot, relative to the CoM on the ground.

    Args:
        impulse: [N s], shape (2,).
        height: above the ground [m].
        robot: that is pushed.

    Returns:
        Tail and tip [m], shape (1, 2, 3).
    """
    strength = float(np.hypot(*impulse))
    direction = impulse / strength
    tail = robot.size * CLEARANCE * direction
    tip = tail + robot.size * (LENGTH + LENGTH_PER_SPEED * strength / robot.impulse_per_speed) * direction
    return raised(np.round([tail, tip], 3), height)[None]


def arrow_from(force: Vector, robot: Proportions) -> Points:
    """Ends of an arrow along a force, from the point where it acts [m], shape (1, 2, 3).

    Args:
        force: horizontal [N], shape (2,).
        robot: that is pushed.
    """
    strength = float(np.hypot(*force))
    tip = robot.size * (LENGTH + LENGTH_PER_WEIGHT * strength / robot.weight) * force / strength
    return raised(np.round([np.zeros(2), tip], 3), 0.0)[None]


def effect_of_push(robot: Robot, after: Snapshot, parameters: Parameters) -> str:
    """Effect of a push in a few words.

    Args:
        robot: that is pushed.
        after: first snapshot after the push.
        parameters: in force.
    """
    if after.plan is None or not after.plan.is_capturable:
        has_planned = after.plan is None or parameters.formulation.footholds is not Footholds.REGULATED
        return "would fall" if has_planned else "may fall"  # a law without a QP catches some that its forecast loses
    if after.plan.max_leg_extension() > robot.max_com_distance:
        return "would probably fall"  # unless the next ticks find better steps, which is rare
    durations = (after.step_duration, after.next_step_duration)
    shortened = sorted({round(d, 2) for d in durations if is_shortened(d, parameters)})
    if after.plan.footholds and shortened:
        return f"shortens steps to {' to '.join(f'{duration:g}' for duration in shortened)} s"
    if after.status is Status.RELAXED:
        return "at its limit"
    if after.phase is Phase.STANDING:
        return "steps" if after.plan.footholds else "stands"
    return "walks on"
