"""Soles on the ground: where they stood, and where the plan puts them, and when.

A step that is shorter than usual is marked in magenta: its foothold while the foot is in the air, its print afterwards.
"""

from itertools import zip_longest

from app.drawing.palette import LEFT_FOOT, PUSH, RIGHT_FOOT
from app.viewer.scene.frame import PRINTS_PER_FOOT, Canvas, Frame, is_shortened
from app.viewer.scene.primitives import (
    GroundPolygon,
    Points,
    PolygonStyle,
    add_flat_picture,
    add_lines,
    counter_clockwise,
    disc,
    outline,
    raised,
)
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import Robot
from walkcore.mpc.gait import Phase
from walkcore.mpc.stance import Footstep, Side, on_side
from walkcore.values import Matrix

FOOTHOLDS_PER_FOOT = 4  # of a long horizon; the default one has two
FRESH_OPACITY = 0.85
PRINT_HEIGHT, PLAN_HEIGHT = 0.002, 0.004  # [m]
MARK_HEIGHT, RING_HEIGHT = 0.003, 0.012  # [m]
MARK_THICKNESS, RING_THICKNESS = 3.0, 3.0  # pixels
RING_RADIUS, RING_SPEED = 0.15, 0.4  # [m] around a foothold of size 1 at touchdown, [m/s] at which the ring shrinks
RING_CORNERS = 32
GREYS = {Side.LEFT: LEFT_FOOT, Side.RIGHT: RIGHT_FOOT}


def sole_outline(robot: Robot, side: Side) -> Matrix:
    """Outline of a sole in its own frame, counter-clockwise [m], shape (V, 2)."""
    return counter_clockwise(on_side(side, robot.sole))


class PastFootprints:
    """Last soles set down by each foot: a fixed number of prints, each fainter than the one after it."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the nodes once, invisible."""
        self._drawn = -1
        self._names = {
            side: [f"{canvas.root}/{side.name.lower()}_{age}" for age in range(PRINTS_PER_FOOT)] for side in Side
        }
        for side, names in self._names.items():
            sole = sole_outline(canvas.robot, side)
            for age, name in enumerate(names):
                opacity = FRESH_OPACITY * (1.0 - age / PRINTS_PER_FOOT)
                canvas.server.scene.add_frame(name, show_axes=False, visible=False)
                add_flat_picture(canvas.server, f"{name}/print", sole, GREYS[side], opacity, PRINT_HEIGHT)
                canvas.server.scene.add_line_segments(
                    f"{name}/shortened",
                    outline(raised(sole, MARK_HEIGHT)),
                    colors=PUSH,
                    thickness=MARK_THICKNESS,
                    thickness_units="screen",
                    visible=False,
                )

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the footprints, if a sole has come to the ground since they were drawn."""
        if frame.history.nb_changes == self._drawn:
            return
        self._drawn = frame.history.nb_changes
        for side, places in frame.history.footprints.items():
            for name, place in zip_longest(self._names[side], places):
                updates.visible(name, place is not None)
                if place is not None:
                    x, y, yaw = place.pose
                    updates.on_ground(name, (x, y), yaw)
                    updates.visible(f"{name}/shortened", place.is_of_shortened_step)


class FootholdMarks:
    """Outlined soles at given footholds, with a style for each side."""

    def __init__(self, canvas: Canvas, root: str, styles: dict[Side, PolygonStyle]) -> None:
        """Make the nodes once, invisible."""
        self._marks = {
            side: [
                GroundPolygon(canvas.server, f"{root}/{side.name.lower()}_{i}", style, sole_outline(canvas.robot, side))
                for i in range(FOOTHOLDS_PER_FOOT)
            ]
            for side, style in styles.items()
        }

    def draw(self, updates: SceneUpdates, footholds: tuple[Footstep, ...]) -> None:
        """Draw footholds, or none."""
        for side, marks in self._marks.items():
            feet = [foot for foot in footholds if foot.side is side]
            for mark, foot in zip_longest(marks, feet[: len(marks)]):
                mark.place(updates, foot.position, foot.yaw) if foot is not None else mark.hide(updates)


class PlannedFootholds:
    """Footholds of the plan, and a ring around the next one that shrinks until the foot in the air lands."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the nodes once, invisible."""
        styles = {side: PolygonStyle(grey, PLAN_HEIGHT, opacity=0.34, thickness=4.0) for side, grey in GREYS.items()}
        self._marks = FootholdMarks(canvas, canvas.root, styles)
        self._frame, self._size = f"{canvas.root}/ring", canvas.proportions.size
        canvas.server.scene.add_frame(self._frame, show_axes=False, visible=False)
        self._rings = {False: f"{self._frame}/usual", True: f"{self._frame}/shortened"}
        for is_short, ring in self._rings.items():
            add_lines(canvas.server, ring, PUSH if is_short else LEFT_FOOT, RING_THICKNESS, nb_segments=RING_CORNERS)

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the footholds of the snapshot's plan."""
        plan = frame.snapshot.plan
        self._marks.draw(updates, plan.footholds if plan is not None else ())
        is_in_air = plan is not None and bool(plan.footholds) and frame.snapshot.phase is Phase.SINGLE_SUPPORT
        updates.visible(self._frame, is_in_air)
        if plan is None or not is_in_air:
            return
        updates.on_ground(self._frame, plan.footholds[0].position)
        is_short = is_shortened(frame.snapshot.step_duration, frame.parameters)
        for is_of_short, ring in self._rings.items():
            updates.visible(ring, is_of_short == is_short)
        if frame.has_lines:
            updates.properties(
                self._rings[is_short], points=countdown_ring(frame.snapshot.time_to_touchdown, self._size)
            )


def countdown_ring(time_to_touchdown: float, size: float) -> Points:
    """Ring around a foothold that shrinks until the touchdown, as segments [m], shape (RING_CORNERS, 2, 3).

    Args:
        time_to_touchdown: [s].
        size: of the robot; see `Proportions`.
    """
    corners, _ = disc(round(size * (RING_RADIUS + RING_SPEED * time_to_touchdown), 3), RING_CORNERS)
    return outline(raised(corners[:, :2], RING_HEIGHT))
