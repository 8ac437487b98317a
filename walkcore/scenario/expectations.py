"""Expectations of a scenario: bounds on metrics, which make it a test."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from walkcore.errors import InvalidValueError
from walkcore.values import check_flag, check_mapping, check_range

METRICS: Mapping[str, str] = MappingProxyType(
    {
        "ticks_relaxed": "ticks with another plan than the paper's QP, which had no solution or led to a fall",
        "velocity_error": "mean velocity over whole gait cycles against the reference, largest [m/s]",
        "yaw_rate_error": "mean yaw rate over whole gait cycles against the reference, largest [rad/s]",
        "distance_x": "from the first CoM to the last, along x of the world [m]",
        "distance_y": "the same along y [m]",
        "turn": "from the first heading to the last, counter-clockwise [rad]",
        "final_speed": "of the CoM at the last tick [m/s]",
        "recovery_time": "from a push until the walk repeats itself, longest [s]",
        "recovery_steps": "touchdowns in that time, most",
        "pushes_unrecovered": "pushes after which another came, or the walk ended or fell, before it repeated itself",
        "com_deviation": "of the CoM from the gait cycle before a push, repeated; largest [m]",
        "com_distance": "horizontal, from the CoM to the support foot, largest [m]",
        "cop_margin": "from the model's CoP to the edge of the support polygon, least; negative outside [m]",
        "cop_margin_p1": "the same, first percentile [m]",
        "true_cop_margin": "from the true CoP to the edge of the support polygon, least; negative outside [m]",
        "true_cop_margin_p1": "the same, first percentile [m]",
        "capturability_margin": "from the DCM to the edge of the support polygon, least; negative calls for a step [m]",
        "capturability_margin_p1": "the same, first percentile [m]",
        "cop_error": "from the model's CoP to the true one, largest [m]",
        "cop_error_p95": "the same, 95th percentile [m]",
        "cop_error_median": "the same, median [m]",
        "ground_cop_error": "from the model's CoP to that of the contact forces, largest [m]",
        "ground_cop_error_p95": "the same, 95th percentile [m]",
        "ground_cop_error_median": "the same, median [m]",
        "dcm_error": "of the measured DCM from the model's, largest [m]",
        "twin_distance": "between the CoMs of the robot and of its ideal twin, largest while both are up [m]",
        "com_error": "of the inverse kinematics, from the requested CoM of the body to the reached one, largest [m]",
        "sole_error": "the same of the soles, largest [m]",
        "torque_use": "torque over its limit, of all joints the largest",
        "torque_use_p99": "the same, 99th percentile of the joint that has the highest",
        "speed_use": "joint speed over its limit, of all joints the largest",
        "speed_use_p99": "the same, 99th percentile of the joint that has the highest",
    }
)
"""Metrics that can be bounded, with their meanings; null where a walk has none."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict on an expectation."""

    name: str
    bound: float | bool
    measured: float | bool | None
    """None where the walk does not have that metric, which is a failure."""
    holds: bool


@dataclass(frozen=True, slots=True)
class Expectation:
    """One bound: `max_` or `min_` of a metric, or whether the robot stays on its feet."""

    name: str
    """The key in the scenario."""
    bound: float | bool

    def verdict(self, metrics: Mapping[str, Any]) -> Verdict:
        """Whether the metrics of a walk keep it."""
        if self.name == "not_fallen":
            not_fallen = not metrics["has_fallen"]
            return Verdict(self.name, self.bound, not_fallen, not_fallen is self.bound)
        measured = metrics.get(self.name[4:])
        if measured is None:
            return Verdict(self.name, self.bound, None, False)
        holds = measured <= self.bound if self.name.startswith("max_") else measured >= self.bound
        return Verdict(self.name, self.bound, measured, bool(holds))


def expectation_names() -> list[str]:
    """Every key that `expect` may have."""
    return ["not_fallen", *(f"{side}_{metric}" for metric in METRICS for side in ("max", "min"))]


def expectations_from_mapping(data: Any) -> tuple[Expectation, ...]:
    """The expectations under the key `expect` of a scenario.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
    """
    expectations: list[Expectation] = []
    for name, bound in check_mapping("expect", data).items():
        if name not in expectation_names():
            limit = f"unknown; not_fallen, or max_ or min_ and one of {', '.join(METRICS)}"
            raise InvalidValueError(f"expect.{name}", bound, limit)
        check = check_flag if name == "not_fallen" else check_range
        expectations.append(Expectation(name, check(f"expect.{name}", bound)))
    return tuple(expectations)
