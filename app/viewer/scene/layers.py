"""Layers of the scene, each with its meaning, its colour, its drawing, and whether it is shown at the start.

A new layer is an entry here: the panel, its legend, the REST interface and the links of the page read this table.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from app.drawing import palette
from app.drawing.palette import Colour
from app.viewer.scene.foot_forces import FootForcesDrawing
from app.viewer.scene.footprints import PastFootprints, PlannedFootholds
from app.viewer.scene.frame import Canvas, Drawing
from app.viewer.scene.ghosts import COMMANDED_BODY, PAST_BODY, TWIN_BODY, GhostDrawing
from app.viewer.scene.points import (
    CONTACT_COP,
    FULL_COP,
    MEASURED,
    MODEL_COP,
    MODEL_DCM,
    CentreOfMassDrawing,
    PointDrawing,
)
from app.viewer.scene.push_rose import PushRoseDrawing
from app.viewer.scene.pushes import PushDrawing
from app.viewer.scene.robot import robot_drawing
from app.viewer.scene.strips import StripsDrawing
from app.viewer.scene.supports import ActiveBounds, FootholdRegions, NeededStepDrawing, margin_polygon, support_polygon
from app.viewer.scene.velocities import CoMVelocityDrawing, ReferenceDrawing


@dataclass(frozen=True, slots=True)
class Layer:
    """Part of the scene that can be shown or hidden."""

    label: str
    meaning: str
    colour: Colour | None = None
    """Colour in the legend; None for a layer that is not in it."""
    draw: Callable[[Canvas], Drawing] | None = None
    """Makes the drawing; None for a layer that changes how others are drawn."""
    is_on: bool = True
    """Whether the layer is shown at the start."""


SEE_THROUGH = "see_through"
"""Layer that has no nodes of its own: it changes the robot's."""
PUSH_ROSE = "push_rose"
"""Layer that is computed only while it is shown."""

LAYERS = {
    "robot": Layer("robot", "The robot itself, as it is", draw=robot_drawing),
    "commanded": Layer(
        "commanded",
        "The configuration that is commanded",
        palette.COMMANDED,
        partial(GhostDrawing, COMMANDED_BODY),
        False,
    ),
    "twin": Layer(
        "twin", "The model on the same commands, drawn one metre aside", palette.TWIN, partial(GhostDrawing, TWIN_BODY)
    ),
    "was": Layer(
        "walk that was",
        "The walk that was, where the robot went on from an earlier tick",
        palette.PAST,
        partial(GhostDrawing, PAST_BODY),
    ),
    "strips": Layer("strips", "Strips across the ground, where the world has any", palette.STRIP, StripsDrawing),
    "footprints": Layer(
        "past footsteps",
        "Soles where they stood: left darker, right lighter; outlined after a shortened step",
        palette.LEFT_FOOT,
        PastFootprints,
    ),
    "plan": Layer(
        "planned footsteps",
        "Footholds that the QP decided at this tick; a ring shrinks until the touchdown",
        palette.RIGHT_FOOT,
        PlannedFootholds,
    ),
    "regions": Layer(
        "foothold regions", "Where each planned foot may land", palette.REGION, FootholdRegions, is_on=False
    ),
    "support": Layer("support polygon", "Hull of the soles that carry the robot", palette.SUPPORT, support_polygon),
    "margin": Layer(
        "margin", "Where (28) holds the CoP: the support less the margin", palette.MARGIN, margin_polygon, is_on=False
    ),
    "com": Layer("CoM", "Centre of mass, and its place above the ground", palette.COM, CentreOfMassDrawing),
    "cop": Layer("CoP", "Centre of pressure of the model, (5)-(6)", palette.COP, partial(PointDrawing, MODEL_COP)),
    "true_cop": Layer(
        "true CoP",
        "Centre of pressure from the full inverse dynamics",
        palette.TRUE_COP,
        partial(PointDrawing, FULL_COP),
    ),
    "ground_cop": Layer(
        "contact CoP",
        "Centre of pressure of the contact forces, in physics",
        palette.GROUND_COP,
        partial(PointDrawing, CONTACT_COP),
    ),
    "forces": Layer("foot force", "Normal force on each sole, in physics", palette.FOOT_FORCE, FootForcesDrawing),
    "capture_point": Layer(
        "capture point",
        "DCM c + dc/ω: a foot there would stop the robot",
        palette.DCM,
        partial(PointDrawing, MODEL_DCM),
    ),
    "measured_dcm": Layer(
        "measured DCM",
        "DCM of the body in physics, beside the planned one",
        palette.MEASURED_DCM,
        partial(PointDrawing, MEASURED),
        is_on=False,
    ),
    "trails": Layer("trails", "Where these points were during the last two seconds", is_on=False),
    "preview": Layer("preview", "Where the model will have them over the horizon"),
    "reference": Layer("reference", "Reference velocity", palette.REFERENCE, ReferenceDrawing),
    "velocity": Layer("velocity", "Velocity of the centre of mass", palette.COM, CoMVelocityDrawing, is_on=False),
    "push": Layer("push", "The last push, and the effect of the next one", palette.PUSH, PushDrawing),
    "needed_step": Layer(
        "needed step",
        "After a fall: the step that would have stopped the robot, and the region that it is beyond",
        palette.NEEDED_STEP,
        NeededStepDrawing,
    ),
    PUSH_ROSE: Layer(
        "push rose",
        "How hard a push in each direction would be survived now; outlined, what no controller could survive",
        palette.PUSH_ROSE,
        PushRoseDrawing,
        is_on=False,
    ),
    "active": Layer(
        "active constraints", "Bounds of the QP that the plan rests on", palette.ACTIVE, ActiveBounds, is_on=False
    ),
    SEE_THROUGH: Layer("see-through", "Let the centre of mass show through the robot", is_on=False),
}
DEFAULT_LAYERS = {name: layer.is_on for name, layer in LAYERS.items()}
