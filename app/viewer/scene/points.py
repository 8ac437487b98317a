"""Points that tell the balance: dots on the ground, with the lines of where each was and where the plan has it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.drawing.palette import (
    COM,
    COP,
    COP_TRAIL,
    DCM,
    GRID_CELL,
    GROUND_COP,
    MEASURED_DCM,
    TRUE_COP,
    Colour,
)
from app.viewer.scene.frame import TRAIL_POINTS, Canvas, Frame
from app.viewer.scene.primitives import add_dot, add_lines, path
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import Snapshot
from walkcore.mpc.plan import Plan, Status
from walkcore.mpc.regions import nearest_within
from walkcore.values import Matrix, Vector

TRAIL_HEIGHT, PREVIEW_HEIGHT = 0.007, 0.008  # [m]
BALL_RADIUS = 0.045  # [m] of a robot of size 1


@dataclass(frozen=True, slots=True)
class PointStyle:
    """Point of the ground, and how it is drawn."""

    position: Callable[[Snapshot], Vector | None]
    """[m], shape (2,); None for a robot that has no such point."""
    preview: Callable[[Plan], Matrix | None]
    """Point at each sample [m], shape (N, 2); None where the model does not know it."""
    colour: Colour
    line: Colour
    radius: float
    """Radius of the dot for a robot of size 1 [m]."""
    height: float
    """Height of the dot [m], so that none hides another."""
    hole: float = 0.0
    """Radius of a hole in it, in radii: a ring shows what lies at the same place."""
    is_cop: bool = False
    """Whether it is a centre of pressure, which lies within the support, and which a fallen robot does not have."""


def body_com(snapshot: Snapshot) -> Vector:
    """Horizontal position of the CoM as it is [m], shape (2,): the measured one where the plant is not ideal."""
    return snapshot.com.position if snapshot.plant is None else snapshot.plant.measured.com[:2]


def ground_cop(snapshot: Snapshot) -> Vector | None:
    """Centre of pressure of the contact forces [m], shape (2,); None without physics, or where nothing is carried."""
    return None if snapshot.plant is None else snapshot.plant.contact.cop


def measured_dcm(snapshot: Snapshot) -> Vector | None:
    """DCM of the body as it is, where the model has its own [m], shape (2,); None without physics.

    The dynamic filter moves the body's CoM against the model's, which is taken off.
    """
    if snapshot.plant is None:
        return None
    body = snapshot.plant.measured
    return body.com[:2] - snapshot.com_offset + body.com_velocity[:2] / snapshot.pendulum.omega


CENTRE_OF_MASS = PointStyle(body_com, lambda plan: plan.com, COM, COM, 0.024, 0.009)
MODEL_COP = PointStyle(lambda now: now.cop, lambda plan: plan.cop, COP, COP_TRAIL, 0.038, 0.011, hole=0.52, is_cop=True)
FULL_COP = PointStyle(lambda now: now.true_cop, lambda _: None, TRUE_COP, TRUE_COP, 0.022, 0.013, is_cop=True)
CONTACT_COP = PointStyle(ground_cop, lambda _: None, GROUND_COP, GROUND_COP, 0.014, 0.017, is_cop=True)
MEASURED = PointStyle(measured_dcm, lambda _: None, MEASURED_DCM, MEASURED_DCM, 0.018, 0.019)
MODEL_DCM = PointStyle(lambda now: now.dcm, lambda plan: plan.dcm, DCM, DCM, 0.026, 0.008)


def drawn_point(style: PointStyle, snapshot: Snapshot) -> Vector | None:
    """Place of a point as it is drawn [m], shape (2,); None where there is none.

    A centre of pressure beyond the edge of the support does not exist: the motion that asks for one tips the soles
    about that edge, where the pressure then is.
    """
    point = style.position(snapshot)
    if point is None or not style.is_cop:
        return point
    return None if snapshot.status is Status.FALLEN else nearest_within(snapshot.stance.polygon, point)


class PointDrawing:
    """Dot of one point, its trail, and its preview. The lines move with the CoM."""

    def __init__(self, style: PointStyle, canvas: Canvas) -> None:
        """Make the nodes once, invisible."""
        self._style, self._dot, self._frame = style, f"{canvas.root}/dot", f"{canvas.root}/at_com"
        self._trail, self._preview = f"{self._frame}/trails/trail", f"{self._frame}/preview/line"
        add_dot(canvas.server, self._dot, style.colour, canvas.proportions.size * style.radius, style.hole)
        canvas.server.scene.add_frame(self._frame, show_axes=False)
        for layer in ("trails", "preview"):
            canvas.server.scene.add_frame(f"{self._frame}/{layer}", show_axes=False, visible=layer in canvas.shown)
            canvas.switched[layer].append(f"{self._frame}/{layer}")
        fade = np.linspace(0.0, 1.0, TRAIL_POINTS)[:, None]
        colours = (fade * style.line + (1.0 - fade) * GRID_CELL).astype(np.uint8)
        of_ends = np.stack([colours[:-1], colours[1:]], axis=1)
        add_lines(canvas.server, self._trail, of_ends, 2.0, nb_segments=TRAIL_POINTS - 1)
        add_lines(canvas.server, self._preview, style.line, 2.5)

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Put the dot on the point, and draw its lines if their layers are shown."""
        point, com = drawn_point(self._style, frame.snapshot), frame.snapshot.com.position
        updates.visible(self._dot, point is not None)
        if point is not None:
            updates.on_ground(self._dot, point, height=self._style.height)
        if frame.shown & {"trails", "preview"}:
            updates.on_ground(self._frame, com)
        if frame.has_lines:
            self._draw_trail(updates, frame, com)
            self._draw_preview(updates, frame, point, com)

    def _draw_trail(self, updates: SceneUpdates, frame: Frame, com: Vector) -> None:
        past = (
            [drawn_point(self._style, snapshot) for snapshot in frame.history.trail] if "trails" in frame.shown else []
        )
        known = [point for point in past if point is not None]
        is_shown = len(known) == TRAIL_POINTS
        updates.visible(self._trail, is_shown)
        if is_shown:
            updates.properties(self._trail, points=path(np.array(known) - com, TRAIL_HEIGHT))

    def _draw_preview(self, updates: SceneUpdates, frame: Frame, point: Vector | None, com: Vector) -> None:
        plan = frame.snapshot.plan
        preview = self._style.preview(plan) if plan is not None and "preview" in frame.shown else None
        updates.visible(self._preview, preview is not None)
        if preview is not None and point is not None:
            line = path(np.vstack([point, preview]) - com, PREVIEW_HEIGHT)
            is_dashed = self._style.line is COP_TRAIL
            updates.properties(self._preview, points=line[::2] if is_dashed else line)


class CentreOfMassDrawing:
    """Ball at the CoM, a line from it to the ground, and its dot there."""

    def __init__(self, canvas: Canvas) -> None:
        """Make the nodes once."""
        self._point = PointDrawing(CENTRE_OF_MASS, canvas)
        self._mass = f"{canvas.root}/mass"
        self._ball, self._plumb_line = f"{self._mass}/ball", f"{self._mass}/plumb_line"
        canvas.server.scene.add_frame(self._mass, show_axes=False)
        radius = BALL_RADIUS * canvas.proportions.size
        canvas.server.scene.add_icosphere(self._ball, radius=radius, color=COM, cast_shadow=False)
        add_lines(canvas.server, self._plumb_line, COM, 1.5, visible=True)
        self._height = np.nan

    def update(self, updates: SceneUpdates, frame: Frame) -> None:
        """Put ball, line and dot in place."""
        self._point.update(updates, frame)
        snapshot = frame.snapshot
        lies_where_it_is_not_known = snapshot.status is Status.FALLEN and snapshot.plant is None
        updates.visible(self._mass, not lies_where_it_is_not_known)
        updates.on_ground(self._mass, body_com(snapshot))
        height = round(snapshot.com_height if snapshot.plant is None else float(snapshot.plant.measured.com[2]), 3)
        if height != self._height:
            self._height = height
            top = (0.0, 0.0, height)
            updates.position(self._ball, top)
            updates.properties(self._plumb_line, points=np.array([[top, (0.0, 0.0, 0.0)]], dtype=np.float32))
