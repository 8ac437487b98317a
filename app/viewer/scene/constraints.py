"""Which bounds of the QP a plan touches: edges for the CoP (26), edges for footholds (section 5), reach (30).

Found from the plan's geometry: a bound binds where the plan comes within a millimetre of it.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
import viser
from scipy.spatial import ConvexHull

from app.drawing.outlines import carriers
from app.drawing.palette import ACTIVE
from app.viewer.scene.shapes import Points, raised
from app.viewer.transport.stream import Stream
from walkcore import Parameters, Robot, Snapshot, WalkError
from walkcore.mpc.gait import Phase
from walkcore.mpc.regions import inset_vertices
from walkcore.mpc.stance import Footstep, sole_vertices
from walkcore.values import Matrix, Vector, rotation

TOUCH = 1e-3  # [m]
HEIGHT = 0.016  # [m]
FRAMES_PER_DRAWING = 3  # a client builds lines anew

Segment = tuple[Vector, Vector]


def binding(robot: Robot, snapshot: Snapshot, parameters: Parameters) -> list[Segment]:
    """The bounds that the plan touches, as segments on the ground in the world frame [m]."""
    if snapshot.plan is None:
        return []
    segments = [*_cop_edges(robot, snapshot, parameters), *_foothold_edges(robot, snapshot)]
    return [*segments, *_reach(robot, snapshot)]


def _cop_edges(robot: Robot, snapshot: Snapshot, parameters: Parameters) -> Iterator[Segment]:
    plan = snapshot.plan
    assert plan is not None
    points: dict[tuple[int, ...], list[Vector]] = {}
    polygons: dict[tuple[int, ...], tuple[Footstep, ...]] = {}
    for feet, cop in zip(carriers(snapshot, parameters), plan.cop, strict=False):
        key = tuple(id(foot) for foot in feet)
        polygons[key] = feet
        points.setdefault(key, []).append(cop)
    for key, feet in polygons.items():
        corners = np.vstack([sole_vertices(robot.sole, foot) for foot in feet])
        try:
            inner = inset_vertices(corners, parameters.cop_margin)
        except WalkError:
            continue
        yield from _touched(inner, points[key])


def _foothold_edges(robot: Robot, snapshot: Snapshot) -> Iterator[Segment]:
    assert snapshot.plan is not None
    for before, foothold in pairwise((snapshot.support, *snapshot.plan.footholds)):
        region = robot.foothold_region_at(foothold.yaw - before.yaw, foothold.side)
        yield from _touched(before.position + region @ rotation(before.yaw).T, [foothold.position])


def _reach(robot: Robot, snapshot: Snapshot) -> Iterator[Segment]:
    """From the foot in the air to its foothold, where it can get no farther in time."""
    assert snapshot.plan is not None
    if not snapshot.plan.footholds or snapshot.phase is not Phase.SINGLE_SUPPORT:
        return
    foothold = snapshot.plan.footholds[0]
    swing = snapshot.feet[foothold.side].position
    way = rotation(snapshot.support.yaw).T @ (foothold.position - swing)
    if np.any(np.abs(way) > snapshot.time_to_touchdown * robot.max_foot_speed - TOUCH):
        yield swing, foothold.position


def _touched(vertices: Matrix, points: Sequence[Vector]) -> Iterator[Segment]:
    """Edges of a convex polygon, shape (V, 2), that some point comes close to from inside, or is beyond."""
    corners = vertices[ConvexHull(vertices).vertices]  # counter-clockwise
    ends = np.roll(corners, -1, axis=0)
    along = ends - corners
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    depth = np.sum(outward * corners, axis=1) - np.array(points) @ outward.T
    for i in np.flatnonzero(np.min(depth, axis=0) < TOUCH):
        yield corners[i], ends[i]


class ActiveConstraints:
    """The bounds that bind, lit up."""

    def __init__(self, server: viser.ViserServer, root: str, robot: Robot) -> None:
        """Make the nodes once. Lines go with the CoM."""
        self._robot = robot
        self._frame, self._lines = f"{root}/at_com", f"{root}/at_com/lines"
        server.scene.add_frame(self._frame, show_axes=False)
        server.scene.add_line_segments(
            self._lines, np.zeros((1, 2, 3)), colors=ACTIVE, thickness=6.0, thickness_units="screen", visible=False
        )
        self._count = 0

    def update(self, stream: Stream, snapshot: Snapshot, parameters: Parameters) -> None:
        """Light up what binds in the snapshot's plan."""
        com = snapshot.com.position
        stream.on_ground(self._frame, com)
        self._count += 1
        if self._count % FRAMES_PER_DRAWING:
            return
        segments = binding(self._robot, snapshot, parameters)
        stream.visible(self._lines, bool(segments))
        if segments:
            stream.properties(self._lines, points=_lifted(segments, com))


def _lifted(segments: Sequence[Segment], com: Vector) -> Points:
    ends = np.round(np.array(segments).reshape(-1, 2) - com, 4)
    return raised(ends, HEIGHT).reshape(-1, 2, 3)
