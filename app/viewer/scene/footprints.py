"""Soles on the ground: where they stood, and where the plan puts them."""

from itertools import zip_longest

from app.drawing.palette import LEFT_FOOT, RIGHT_FOOT
from app.viewer.scene.frame import PRINTS_PER_FOOT, Canvas, Frame
from app.viewer.scene.primitives import GroundPolygon, PolygonStyle, add_flat_picture, counter_clockwise
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import Robot
from walkcore.mpc.stance import Footstep, Side, mirrored
from walkcore.values import Matrix

FOOTHOLDS_PER_FOOT = 4  # of a long horizon; the default one has two
FRESH_OPACITY = 0.85
PRINT_HEIGHT, PLAN_HEIGHT = 0.002, 0.004  # [m]
GREYS = {Side.LEFT: LEFT_FOOT, Side.RIGHT: RIGHT_FOOT}


def sole_outline(robot: Robot, side: Side) -> Matrix:
    """Outline of a sole in its own frame, counter-clockwise [m], shape (V, 2)."""
    return counter_clockwise(robot.sole if side is Side.LEFT else mirrored(robot.sole))


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

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the footprints, if a sole has come to the ground since they were drawn."""
        if frame.history.nb_changes == self._drawn:
            return
        self._drawn = frame.history.nb_changes
        for side, places in frame.history.footprints.items():
            for name, place in zip_longest(self._names[side], places):
                updates.visible(name, place is not None)
                if place is not None:
                    x, y, yaw = place
                    updates.on_ground(name, (x, y), yaw)


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
    """Footholds of the plan."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the nodes once, invisible."""
        styles = {side: PolygonStyle(grey, PLAN_HEIGHT, opacity=0.34, thickness=4.0) for side, grey in GREYS.items()}
        self._marks = FootholdMarks(canvas, canvas.root, styles)

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the footholds of the snapshot's plan."""
        self._marks.draw(updates, frame.snapshot.plan.footholds if frame.snapshot.plan is not None else ())
