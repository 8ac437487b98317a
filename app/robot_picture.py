"""Picture of a robot that stands as it walks: from the front, from the left and from above.

Links are drawn as the hulls of their shapes; over them the frames of soles and torso (x red, y green, z blue), the
outlines of the soles, the CoM with its height, and where each foot may land beside the other one.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports] (its wheel is found through a .pth file)
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull, QhullError

from app.drawing import palette
from app.drawing.axes import STYLE, ink
from walkcore.motion.shapes import urdf_shapes
from walkcore.motion.swing_foot import standing
from walkcore.motion.whole_body import BodyTarget, WholeBody
from walkcore.mpc.stance import Side, sole_vertices
from walkcore.robot import BodyModel, Robot
from walkcore.robot_import.soles import shape_points
from walkcore.values import Matrix, Vector

SIZE = (10.0, 5.6)  # [in]
AXIS = 0.12  # length of the axes of a frame, in heights of the CoM
AXES = ("#d62424", "#26a650", "#1454c8")
BODY = ink(palette.DEFAULT_MATERIAL)


@dataclass(frozen=True, slots=True)
class View:
    """Projection of the world onto a panel."""

    title: str
    across: int
    """Axis of the world that goes to the right."""
    up: int
    """Axis of the world that goes up."""
    sign: float
    """-1 where the first one goes to the left."""

    def seen(self, points: Matrix) -> Matrix:
        """Points of the world, shape (P, 3), on the panel, shape (P, 2) [m]."""
        return np.column_stack([self.sign * points[:, self.across], points[:, self.up]])


VIEWS = (View("from the front", 1, 2, 1.0), View("from the left", 0, 2, -1.0), View("from above", 1, 0, -1.0))


def draw_robot(robot: Robot, path: Path) -> None:
    """Draw a robot with a body into a file, PNG or SVG by its ending.

    Args:
        robot: with a body.
        path: of the picture.
    """
    assert robot.body is not None
    body = WholeBody(robot.body)
    feet = [standing(robot.foot_at_rest(side)) for side in Side]
    q = body.at_rest(BodyTarget(np.array([0.0, 0.0, robot.com_height]), *feet, heading=0.0))
    data = body.model.createData()
    pin.framesForwardKinematics(body.model, data, q)
    links = _links(robot.body, body.model, data)
    with matplotlib.rc_context(STYLE):
        sheet = Figure(figsize=SIZE, layout="constrained")
        for axes, view in zip(sheet.subplots(1, len(VIEWS)), VIEWS, strict=True):
            for link in links:
                _draw_hull(axes, view.seen(link))
            _draw_footholds(axes, view, robot)
            for side in Side:
                sole = sole_vertices(robot.sole, robot.foot_at_rest(side))
                corners = view.seen(np.column_stack([sole, np.zeros(len(sole))]))
                axes.add_patch(Polygon(corners, facecolor="none", edgecolor=ink(palette.SUPPORT), linewidth=1.6))
            for frame in (*(robot.body.sole(side) for side in Side), robot.body.torso):
                _draw_frame(axes, view, data.oMf[body.model.getFrameId(frame)], AXIS * robot.com_height)
            com = view.seen(np.array([[0.0, 0.0, robot.com_height], [0.0, 0.0, 0.0]]))
            axes.plot(*com.T, color=ink(palette.COM), linewidth=0.8)
            axes.plot(*com[0], "o", color=ink(palette.COM))
            axes.set_title(view.title)
            axes.set_aspect("equal")
            axes.set_xlabel("m")
        sheet.suptitle(
            f"{robot.title}: {robot.mass:.1f} kg, CoM at {robot.com_height:g} m, feet {robot.stance_width:g} m apart"
        )
        sheet.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None, dpi=120)


def _links(body: BodyModel, model: Any, data: Any) -> list[Matrix]:
    """Points of the shapes of each link in the world, those that are drawn, or those of collisions, (P, 3) [m] each."""
    for kind in (pin.GeometryType.VISUAL, pin.GeometryType.COLLISION):
        shapes = urdf_shapes(model, body.urdf, body.package_folder, kind)
        places = [(data.oMi[shape.parentJoint], shape_points(shape)) for shape in shapes.geometryObjects]
        if places:
            return [points @ place.rotation.T + place.translation for place, points in places]
    return []


def _draw_hull(axes: Axes, points: Matrix) -> None:
    try:
        corners = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):  # a link that is seen edge-on
        return
    axes.add_patch(Polygon(corners, facecolor=f"{BODY}70", edgecolor="#77777790", linewidth=0.5))
    axes.update_datalim(corners)
    axes.autoscale_view()


def _draw_footholds(axes: Axes, view: View, robot: Robot) -> None:
    """Draw the region of straight feet beside each foot, where the ground is seen from above."""
    if view.up == VIEWS[0].up:
        return
    for side in Side:
        support = robot.foot_at_rest(Side.RIGHT if side is Side.LEFT else Side.LEFT)
        corners = robot.foothold_region_at(0.0, side) + support.position
        seen = view.seen(np.column_stack([corners, np.zeros(len(corners))]))
        axes.add_patch(Polygon(seen, facecolor=f"{ink(palette.REGION)}18", edgecolor=ink(palette.REGION)))
        axes.update_datalim(seen)
    axes.autoscale_view()


def _draw_frame(axes: Axes, view: View, place: Any, length: float) -> None:
    origin: Vector = np.array(place.translation)
    for axis, colour in enumerate(AXES):
        end = origin + length * place.rotation[:, axis]
        axes.plot(*view.seen(np.array([origin, end])).T, color=colour, linewidth=1.6)
