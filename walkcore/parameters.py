"""Parameters of walking: everything that may be chosen, with the paper's values as defaults."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

from walkcore.errors import InvalidValueError
from walkcore.mpc.gait import Timing
from walkcore.mpc.lipm import GRAVITY
from walkcore.mpc.qp import SOLVERS
from walkcore.mpc.schemes import DEPRECATED, SCHEMES, Scheme
from walkcore.values import check_choice, check_flag, check_keys, check_range

LIMITS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "alpha": (0.0, 1e3),
        "beta": (0.0, 1e3),
        "gamma": (0.0, 1e3),
        "delta": (0.0, 1e3),
        "cop_tracking": (1e-6, 1e3),
        "foothold_weight": (1e-6, 1e6),
        "horizon_samples": (2, 64),
        "sampling_period": (0.01, 1.0),
        "control_period": (0.001, 1.0),
        "step_duration": (0.2, 5.0),
        "double_support_duration": (0.01, 1.0),
        "initial_double_support_duration": (0.01, 5.0),
        "cop_margin": (0.0, 0.2),
        "swing_height": (0.0, 0.2),
        "gravity": (0.1, 100.0),
    }
)
"""Lowest and highest value of each parameter that is a number."""
PLANTS = ("ideal", "mujoco")
CHOICES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "scheme": tuple(SCHEMES),
        "solver": tuple(SOLVERS),
        "step_timing": ("fixed", "adaptive"),
        "plant": PLANTS,
    }
)
"""Choices of each parameter that is one of some words."""
COM_HEIGHT_LIMITS = (0.1, 2.0)  # [m]
FIXED = ("control_period", "sampling_period", "double_support_duration", "com_height", "gravity", "plant")
"""Parameters that hold for a whole walk."""


@dataclass(frozen=True)  # no slots: every tick reads the properties many times, and they are computed once
class Parameters:
    """Weights, horizon, timing and margins of the walking motion generation."""

    scheme: str = "full"
    """Terms of the objective and authority over the footholds: a name of `schemes.py`; `full` is (19)."""
    alpha: float = 1e-6
    """Weight of the jerk in (19)."""
    beta: float = 1.0
    """Weight of the velocity error in (19)."""
    gamma: float = 1e-6
    """Weight of the distance from the CoP to the middle of the foot in (19)."""
    delta: float = 1.0
    """Weight of the error of the mean velocity over two steps in (31)."""
    cop_tracking: float = 1.0
    """Weight of the distance from the CoP to the middle of the foot in (11), where nothing else drives the motion."""
    foothold_weight: float = 1.0
    """Weight of the distance from the footholds to the planned ones, where the QP may move them."""
    horizon_samples: int = 16
    """N, number of samples of the horizon."""
    sampling_period: float = 0.1
    """T, between samples of the horizon [s]."""
    control_period: float = 0.005
    """Duration of a tick [s]; at `sampling_period` the scheme is exactly the paper's."""
    step_duration: float = 0.8
    """Time from one touchdown to the next: double support, then single support [s]."""
    double_support_duration: float = 0.1
    """Equal to `sampling_period`, so that no sample falls inside a double support (section 4) [s]."""
    initial_double_support_duration: float = 0.8
    """Time on both feet before the first step, while the CoM sways over the first support [s]."""
    step_timing: str = "fixed"
    """Whether a robot that is threatened may put its foot down sooner: `fixed`, the paper's, or `adaptive`."""
    stepping_in_place: bool = False
    """Whether the robot keeps stepping while the reference is zero, as the paper's does."""
    dynamic_filter: bool = False
    """Whether the body's CoM leaves the model's by some millimetres, to keep the true CoP at the model's."""
    cop_margin: float = 0.03
    """Distance that the CoP at the samples keeps from the edges of its polygon [m]."""
    com_height: float | None = None
    """h, height of the CoM above the ground [m]; None takes the robot's own."""
    swing_height: float = 0.05
    """Highest point of the sole in the air [m]."""
    gravity: float = GRAVITY
    """g [m/s^2]."""
    plant: str = "ideal"
    """Body that moves: `ideal` does what is planned, `mujoco` stands on the ground by contact forces."""
    twin: bool = False
    """Whether an ideal robot walks beside one that is not, on the same commands."""
    solver: str = "piqp"
    """Solver of the QP: `piqp`, or `daqp`, which is exact and faster for many walks at once."""

    def __post_init__(self) -> None:
        if isinstance(self.scheme, str):  # pyright: ignore[reportUnnecessaryIsInstance]  # a client sends anything
            object.__setattr__(self, "scheme", DEPRECATED.get(self.scheme, self.scheme))
        for name, choices in CHOICES.items():
            check_choice(name, getattr(self, name), choices)
        for name, (low, high) in LIMITS.items():
            check_range(name, getattr(self, name), low, high)
        for name in ("stepping_in_place", "dynamic_filter", "twin"):
            check_flag(name, getattr(self, name))
        if self.com_height is not None:
            check_range("com_height", self.com_height, *COM_HEIGHT_LIMITS)
        if self.horizon_samples != int(self.horizon_samples):
            raise InvalidValueError("horizon_samples", self.horizon_samples, "must be a whole number")
        object.__setattr__(self, "horizon_samples", int(self.horizon_samples))  # 16.0 is one, too
        if self.alpha == 0.0 and self.beta == 0.0:
            raise InvalidValueError("alpha", self.alpha, "alpha and beta may not both be zero")
        if not any(term.weight for term in self.formulation.terms(self)):
            raise InvalidValueError("scheme", self.scheme, "needs a weight above zero; all weights of its terms are")
        self._check_multiple("sampling_period", "control_period")
        self._check_multiple("step_duration", "sampling_period")
        self._check_multiple("initial_double_support_duration", "sampling_period")
        if self.double_support_duration != self.sampling_period:
            raise InvalidValueError(
                "double_support_duration", self.double_support_duration, "must equal sampling_period (section 4)"
            )
        if self.timing.samples_per_step < 2:
            raise InvalidValueError("step_duration", self.step_duration, "must be at least two sampling periods")
        least = self.formulation.least_horizon(self.timing.samples_per_step)
        if self.horizon_samples < least:
            limit = f"must be at least {least}, to hold the next foothold and all steps that {self.scheme} looks at"
            raise InvalidValueError("horizon_samples", self.horizon_samples, limit)

    def _check_multiple(self, name: str, of: str) -> None:
        ratio = getattr(self, name) / getattr(self, of)
        if abs(ratio - round(ratio)) > 1e-9 or round(ratio) < 1:
            raise InvalidValueError(name, getattr(self, name), f"must be a multiple of {of} = {getattr(self, of):g}")

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> "Parameters":
        """Parameters of which some are given and the others have their defaults.

        Raises:
            InvalidValueError: for an unknown name, or a value beyond its limit.
        """
        return cls().changed(values)

    def changed(self, values: Mapping[str, Any]) -> "Parameters":
        """These parameters with some of them replaced; raises as `from_mapping` does."""
        check_keys("parameters", values, {field.name for field in fields(self)})
        return replace(self, **values)

    def to_mapping(self) -> dict[str, Any]:
        """Plain numbers and strings by name."""
        return asdict(self)

    def check_change(self, new: "Parameters") -> "Parameters":
        """The new parameters, if a walk that is under way can go on with them.

        Raises:
            InvalidValueError: for the first one that a walk has to begin with.
        """
        for name in FIXED:
            if getattr(new, name) != getattr(self, name):
                raise InvalidValueError(name, getattr(new, name), f"is {getattr(self, name)} for the whole walk")
        return new

    @property
    def formulation(self) -> Scheme:
        """Terms, constraints and footholds of the scheme."""
        return SCHEMES[self.scheme]

    @cached_property
    def timing(self) -> Timing:
        """Periods and durations of the gait."""
        return Timing(
            self.horizon_samples,
            self.sampling_period,
            self.control_period,
            self.step_duration,
            self.initial_double_support_duration,
        )
