"""The schemes that the paper compares: which terms the one objective has, and who decides the footholds.

1/2 sum of weight * || term ||^2

jerk            || jerks ||                                     alpha
velocity        || dC - reference ||                            beta
cop             || Z - centre of the support ||                 gamma, in (11) cop_tracking
mean_velocity   || E C / (2 T_step) - reference ||  (31)        delta
foothold        || footholds - planned ones ||                  foothold_weight
"""

from dataclasses import dataclass
from enum import Enum


class Footholds(Enum):
    """Who decides where the feet land."""

    FREE = "the QP"
    ADAPTED = "a planner, and the QP may move them at a cost"
    PLANNED = "a planner, from the reference velocity"


@dataclass(frozen=True, slots=True)
class Scheme:
    """A choice from the objective; `weights` names the parameter that weighs each of its terms."""

    weights: dict[str, str]
    footholds: Footholds = Footholds.FREE
    is_constrained: bool = True
    """Whether the CoP is kept inside its polygons."""


_TRACKING = {"jerk": "alpha", "cop": "cop_tracking"}  # (11)

SCHEMES = {
    "preview_control": Scheme(_TRACKING, Footholds.PLANNED, is_constrained=False),  # [7]
    "fixed_steps": Scheme(_TRACKING, Footholds.PLANNED),  # (11) with the constraints of [20]
    "adapted_steps": Scheme(_TRACKING | {"foothold": "foothold_weight"}, Footholds.ADAPTED),  # [1]
    "speed_only": Scheme({"velocity": "beta"}),  # (17)
    "speed_and_jerk": Scheme({"jerk": "alpha", "velocity": "beta"}),  # (19) with gamma = 0
    "full": Scheme({"jerk": "alpha", "velocity": "beta", "cop": "gamma"}),  # (19)
    "mean_speed": Scheme({"jerk": "alpha", "mean_velocity": "delta", "cop": "gamma"}),  # (31)
}
