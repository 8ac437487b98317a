"""Polygons that bound the plan: the support polygon, what the margin leaves of it, foothold regions, active bounds."""

from collections.abc import Callable
from itertools import zip_longest

import numpy as np

from app.drawing.palette import ACTIVE, MARGIN, REGION, SUPPORT, Colour
from app.viewer.scene.footprints import FOOTHOLDS_PER_FOOT
from app.viewer.scene.frame import Canvas, Frame
from app.viewer.scene.primitives import GroundPolygon, add_lines, raised
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import WalkError
from walkcore.mpc.regions import inset_vertices
from walkcore.mpc.stance import Side, convex_hull
from walkcore.values import Matrix, rotation

REGION_HEIGHT, SUPPORT_HEIGHT, MARGIN_HEIGHT, ACTIVE_HEIGHT = 0.003, 0.005, 0.006, 0.016  # [m]


class StancePolygon:
    """Polygon that changes with the stance, in the frame of its first foot.

    A node for each kind of stance, of which one is shown: else a slow client, which shows a new shape late, would
    show the old one at the new place.
    """

    def __init__(
        self,
        polygon: Callable[[Matrix, float], Matrix],
        canvas: Canvas,
        colour: Colour,
        height: float,
        *,
        opacity: float,
        thickness: float,
    ) -> None:
        """Make the nodes once, invisible.

        Args:
            polygon: corners to draw [m], shape (V, 2), or none of them, from those of the support polygon and the
                margin of the CoP [m].
            canvas: gets the nodes.
            colour: see `GroundPolygon`, as of what follows.
            height: above the ground [m].
            opacity: of the face.
            thickness: of the border, in pixels.
        """
        self._polygon = polygon
        self._nodes = {
            (side, kind): GroundPolygon(
                canvas.server,
                f"{canvas.root}/{side.name.lower()}_{kind}",
                colour,
                height,
                opacity=opacity,
                thickness=thickness,
            )
            for side in Side
            for kind in ("sole", "hull")
        }
        self._drawn: object = None

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Draw the polygon of the snapshot's stance."""
        stance, margin = frame.snapshot.stance, frame.parameters.cop_margin
        key = ([(foot.side, foot.position.tolist(), foot.yaw) for foot in stance.feet], margin)
        if key == self._drawn:
            return
        self._drawn, foot = key, stance.feet[0]
        for node in self._nodes.values():
            node.hide(updates)
        corners = self._polygon(stance.polygon, margin)
        if len(corners):
            node = self._nodes[foot.side, "hull" if stance.is_double_support else "sole"]
            node.reshape(updates, (corners - foot.position) @ rotation(foot.yaw))
            node.place(updates, foot.position, foot.yaw)


def _inset(corners: Matrix, margin: float) -> Matrix:
    """Polygon at a distance inside another [m], both of shape (V, 2); no corners where nothing is left."""
    try:
        return convex_hull(inset_vertices(corners, margin))
    except WalkError:
        return np.zeros((0, 2))


def support_drawing(canvas: Canvas) -> StancePolygon:
    """Drawing of the support polygon."""
    return StancePolygon(lambda corners, _: corners, canvas, SUPPORT, SUPPORT_HEIGHT, opacity=0.3, thickness=2.5)


def margin_drawing(canvas: Canvas) -> StancePolygon:
    """Drawing of what the margin leaves of the support polygon for the CoP."""
    return StancePolygon(_inset, canvas, MARGIN, MARGIN_HEIGHT, opacity=0.12, thickness=2.0)


class FootholdRegions:
    """Region where each foothold of the plan may lie, given the foot before it."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the nodes once, invisible."""
        self._nodes = [
            GroundPolygon(canvas.server, f"{canvas.root}/{i}", REGION, REGION_HEIGHT, opacity=0.10, thickness=1.5)
            for i in range(2 * FOOTHOLDS_PER_FOOT)
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
