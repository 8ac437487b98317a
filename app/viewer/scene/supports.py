"""Polygons that bound the plan: support and margin, foothold regions, active bounds, and a step out of reach."""

from collections.abc import Callable
from functools import partial
from itertools import zip_longest

import numpy as np

from app.drawing.palette import ACTIVE, MARGIN, NEEDED_STEP, REGION, SUPPORT
from app.viewer.scene.footprints import FOOTHOLDS_PER_FOOT, FootholdMarks
from app.viewer.scene.frame import Canvas, Frame
from app.viewer.scene.primitives import GroundPolygon, PolygonStyle, add_lines, raised
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import WalkError
from walkcore.mpc.plan import Status
from walkcore.mpc.regions import inset_vertices
from walkcore.mpc.stance import Side, Stance, convex_hull
from walkcore.plant.fall_watch import NeededStep
from walkcore.values import Matrix, rotation

SUPPORT_STYLE = PolygonStyle(SUPPORT, 0.005, opacity=0.3, thickness=2.5)
MARGIN_STYLE = PolygonStyle(MARGIN, 0.006, opacity=0.12, thickness=2.0)
REGION_STYLE = PolygonStyle(REGION, 0.003, opacity=0.10, thickness=1.5)
OUT_OF_REACH_STYLE = PolygonStyle(REGION, 0.007, opacity=0.25, thickness=3.0)
NEEDED_STYLE = PolygonStyle(NEEDED_STEP, 0.010, opacity=0.45, thickness=4.0)
ACTIVE_HEIGHT = 0.016  # [m]


class StancePolygon:
    """Polygon that changes with the stance, in the frame of the first foot that carries the robot.

    A node for each kind of stance, of which one is shown: else a slow client, which shows a new shape late, would
    show the old one at the new place.
    """

    def __init__(self, style: PolygonStyle, corners: Callable[[Stance, float], Matrix], canvas: Canvas) -> None:
        """Make the nodes once, invisible; `corners` computes the polygon [m], shape (V, 2), for a margin [m]."""
        self._corners = corners
        self._nodes = {
            (side, nb_feet): GroundPolygon(canvas.server, f"{canvas.root}/{side.name.lower()}_{nb_feet}", style)
            for side in Side
            for nb_feet in (1, 2)
        }
        self._drawn: object = None

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the polygon of the snapshot's stance, unless it is drawn already; a robot that lies has none."""
        stance, margin = frame.snapshot.stance, frame.parameters.cop_margin
        has_fallen = frame.snapshot.status is Status.FALLEN
        key = (has_fallen, [(foot.side, foot.position.tolist(), foot.yaw) for foot in stance.feet], margin)
        if key == self._drawn:
            return
        self._drawn, foot = key, stance.feet[0]
        for node in self._nodes.values():
            node.hide(updates)
        corners = self._corners(stance, margin)
        if len(corners) and not has_fallen:
            node = self._nodes[foot.side, len(stance.feet)]
            node.reshape(updates, (corners - foot.position) @ rotation(foot.yaw))
            node.place(updates, foot.position, foot.yaw)


def _inset(stance: Stance, margin: float) -> Matrix:
    """Corners of what a margin [m] leaves of a support polygon [m], shape (V, 2); no corners if it leaves nothing."""
    try:
        return convex_hull(inset_vertices(stance.polygon, margin))
    except WalkError:
        return np.zeros((0, 2))


support_polygon = partial(StancePolygon, SUPPORT_STYLE, lambda stance, _: stance.polygon)
margin_polygon = partial(StancePolygon, MARGIN_STYLE, _inset)


class FootholdRegions:
    """Region where each foothold of the plan may lie, given the foot before it."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the nodes once, invisible."""
        self._nodes = [
            GroundPolygon(canvas.server, f"{canvas.root}/{i}", REGION_STYLE) for i in range(2 * FOOTHOLDS_PER_FOOT)
        ]

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the regions of the snapshot's plan."""
        plan = frame.snapshot.plan
        regions = () if plan is None else zip(plan.predecessors, plan.regions, strict=True)
        for node, found in zip_longest(self._nodes, list(regions)[: len(self._nodes)]):
            if found is None:
                node.hide(updates)
                continue
            before, region = found
            node.reshape(updates, region)
            node.place(updates, before.position, before.yaw)


class NeededStepDrawing:
    """Step that would have stopped a robot which has fallen, and the region that it is beyond."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the nodes once, invisible."""
        self._region = GroundPolygon(canvas.server, f"{canvas.root}/region", OUT_OF_REACH_STYLE)
        self._step = FootholdMarks(canvas, f"{canvas.root}/step", dict.fromkeys(Side, NEEDED_STYLE))
        self._drawn: NeededStep | tuple[()] | None = ()  # nothing yet

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the snapshot's step, unless it is drawn already."""
        step = frame.snapshot.needed_step
        if step is self._drawn:
            return
        self._drawn = step
        self._step.draw(updates, () if step is None else (step.foothold,))
        if step is None:
            self._region.hide(updates)
            return
        self._region.reshape(updates, step.region)
        self._region.place(updates, step.support.position, step.support.yaw)


class ActiveBounds:
    """Bounds of the QP that are active, as bright lines that move with the CoM."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the nodes once, invisible."""
        self._frame, self._lines = f"{canvas.root}/at_com", f"{canvas.root}/at_com/lines"
        canvas.server.scene.add_frame(self._frame, show_axes=False)
        add_lines(canvas.server, self._lines, ACTIVE, 6.0)

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the active bounds of the snapshot's plan: edges of polygons, and the way of a foot that is too slow."""
        snapshot, com = frame.snapshot, frame.snapshot.com.position
        updates.on_ground(self._frame, com)
        if not frame.has_lines:
            return
        edges: list[Matrix] = []
        if snapshot.plan is not None:
            swing = snapshot.feet[snapshot.support.side.other].position
            edges = list(snapshot.plan.active_edges(frame.parameters.cop_margin, swing))
        updates.visible(self._lines, bool(edges))
        if edges:
            distinct = np.unique(np.round(np.array(edges) - com, 4), axis=0)
            updates.properties(self._lines, points=raised(distinct, ACTIVE_HEIGHT).reshape(-1, 2, 3))
