"""Methods that decide without a QP: what the paper compares itself with, and today's usual baseline.

Each is one file with the letters of its source. A method is a function of the state of CoM and feet alone. Soles,
regions and foot speed limit it as they limit the QPs; it has no choice of the step's duration.
"""

from collections.abc import Mapping
from types import MappingProxyType

from walkcore.methods.dcm_tracker import DCMTracker
from walkcore.methods.method import Decision, Method
from walkcore.methods.morisawa import Morisawa
from walkcore.methods.planning import MethodPlans
from walkcore.methods.situation import Situation
from walkcore.methods.sugihara import Sugihara

METHODS: Mapping[str, Method] = MappingProxyType(
    {"sugihara": Sugihara(), "morisawa": Morisawa(), "dcm_tracker": DCMTracker()}
)
"""Methods by the names that `SCHEMES` has for them."""

__all__ = ["METHODS", "DCMTracker", "Decision", "Method", "MethodPlans", "Morisawa", "Situation"]
