"""The schemes that the paper compares: the terms of their objectives, and the authority over the footholds.

A new scheme is an entry here: the command line, the panel and the schema of scenarios read this table.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

from walkcore.mpc.objective import Term, Weights, cop, foothold, jerk, mean_velocity, velocity


class Footholds(Enum):
    """The authority over the footholds."""

    FREE = "the QP"
    ADAPTED = "a planner, and the QP may move them at a cost"
    PLANNED = "a planner, from the reference velocity"
    REGULATED = "a control law without a QP, which moves planned ones"


@dataclass(frozen=True, slots=True)
class Scheme:
    """A choice of terms, constraints and footholds."""

    label: str
    """Equation or source, for menus."""
    terms: Callable[[Weights], tuple[Term, ...]]
    footholds: Footholds = Footholds.FREE
    is_constrained: bool = True
    """Whether the CoP is kept inside its polygons."""
    nb_steps_ahead: int = 1
    """Whole steps that the horizon has to hold."""
    nb_steps_to_last: int = 1
    """Whole steps that the horizon should hold: with fewer a robot may fall that nobody pushes, see docs/method.md."""

    @property
    def has_foothold_variables(self) -> bool:
        """Whether the footholds are variables of the QP."""
        return self.footholds is not Footholds.PLANNED

    @property
    def has_planned_footholds(self) -> bool:
        """Whether a planner proposes the footholds, which the QP then takes, or may move at a cost."""
        return self.footholds is not Footholds.FREE

    def least_horizon(self, samples_per_step: int) -> int:
        """Samples that the horizon needs: to hold the next foothold, and all steps that the scheme looks at."""
        return max(samples_per_step + 1, self.nb_steps_ahead * samples_per_step)

    def lasting_horizon(self, samples_per_step: int) -> int:
        """Samples with which a walk goes on for as long as nobody pushes the robot."""
        return max(self.least_horizon(samples_per_step), self.nb_steps_to_last * samples_per_step)


def _cop_tracking(w: Weights) -> tuple[Term, ...]:
    """The terms of (11)."""
    return Term(w.alpha, jerk), Term(w.cop_tracking, cop)


SCHEMES: Mapping[str, Scheme] = MappingProxyType(
    {
        "full": Scheme(
            "(19), the paper's", lambda w: (Term(w.alpha, jerk), Term(w.beta, velocity), Term(w.gamma, cop))
        ),
        "speed_and_jerk": Scheme("(19) without γ", lambda w: (Term(w.alpha, jerk), Term(w.beta, velocity))),
        "speed_only": Scheme("(17)", lambda w: (Term(w.beta, velocity),)),
        "mean_velocity": Scheme(
            "(31), mean velocity",
            lambda w: (Term(w.alpha, jerk), Term(w.delta, mean_velocity), Term(w.gamma, cop)),
            nb_steps_ahead=4,
        ),
        "adapted_steps": Scheme(
            "planned steps, moved at a cost [1]",
            lambda w: (*_cop_tracking(w), Term(w.foothold_weight, foothold)),
            Footholds.ADAPTED,
            nb_steps_to_last=3,
        ),
        "fixed_steps": Scheme(
            "(11), planned steps, constrained [20]", _cop_tracking, Footholds.PLANNED, nb_steps_to_last=3
        ),
        "preview_control": Scheme(
            "(11), planned steps, no constraints [7]",
            _cop_tracking,
            Footholds.PLANNED,
            is_constrained=False,
            nb_steps_to_last=3,
        ),
        "morisawa": Scheme("analytic, foot place modified at once [11], no QP", _cop_tracking, Footholds.REGULATED),
        "sugihara": Scheme("saturated regulator [16], no QP", _cop_tracking, Footholds.REGULATED),
        "dcm_tracker": Scheme("DCM tracking, Englsberger 2015, no QP", _cop_tracking, Footholds.REGULATED),
    }
)
DEPRECATED: Mapping[str, str] = MappingProxyType({"mean_speed": "mean_velocity"})
"""Older names that are still accepted."""
