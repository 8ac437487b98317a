"""What can be seen, each with what it means, its colour, and whether somebody sees it who has never been here."""

from dataclasses import dataclass

from app.drawing import palette
from app.drawing.palette import Colour


@dataclass(frozen=True, slots=True)
class Layer:
    """A part of the scene that can be switched."""

    label: str
    meaning: str
    colour: Colour | None = None
    """None for what has colours of its own."""
    is_on: bool = True
    """At the start."""


LAYERS = {
    "robot": Layer("robot", "The robot itself"),
    "footprints": Layer("past footsteps", "Soles where they stood: left darker, right lighter", palette.LEFT_FOOT),
    "plan": Layer("planned footsteps", "Footholds that the QP decided at this tick", palette.RIGHT_FOOT),
    "regions": Layer("foothold regions", "Where each planned foot may land", palette.REGION, is_on=False),
    "support": Layer("support polygon", "Hull of the soles that carry the robot", palette.SUPPORT),
    "margin": Layer("margin", "Where (28) holds the CoP: the support less the margin", palette.MARGIN, is_on=False),
    "com": Layer("CoM", "Centre of mass, and its place above the ground", palette.COM),
    "cop": Layer("CoP", "Centre of pressure of the model, (5)-(6)", palette.COP),
    "true_cop": Layer("true CoP", "Centre of pressure from the full inverse dynamics", palette.TRUE_COP),
    "capture_point": Layer(
        "capture point", "c + dc/ω: a foot there would stop the robot", palette.CAPTURE, is_on=False
    ),
    "trails": Layer("trails", "Where these points were during the last two seconds", is_on=False),
    "preview": Layer("preview", "Where the model will have them over the horizon", is_on=False),
    "reference": Layer("reference", "Velocity asked for", palette.REFERENCE),
    "velocity": Layer("velocity", "Velocity of the centre of mass", palette.COM, is_on=False),
    "push": Layer("push", "The last push, and what the next one would do", palette.PUSH),
    "active": Layer("active constraints", "Bounds of the QP that the plan touches", palette.ACTIVE, is_on=False),
}
