"""A scenario that was written for one robot, in the proportions of another one.

    v' = v sqrt(h' / h)              speeds, with h the height of the CoM in force: the same Froude number v^2 / (g h)
    t' = t T' / T                    times, with T the duration of a step: what came at a step comes at that step
    w' = w T / T'                    yaw rates: the same turn in a step
    p' = p m' / m sqrt(h' / h)       impulses: the same change of the Froude number

A reference beyond the limits of the other robot becomes slower as a whole: its direction and its curvature stay.
Parameters stay what they are, lengths like `cop_margin`, `swing_height` and `com_height` too.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from walkcore.errors import InvalidValueError
from walkcore.parameters import Parameters
from walkcore.robot import Robot
from walkcore.scenario.scenario import Scenario, scenario_from_mapping

DIGITS = 4
PROMISES: Mapping[str, float | bool] = {
    "not_fallen": True,
    "min_cop_margin": 0.0,
    "max_com_error": 1e-3,
    "max_sole_error": 1e-3,
    "max_speed_use": 1.0,
    "max_pushes_unrecovered": 0,
}
"""Expectations that any robot with a body keeps on a walk within its limits, in the ideal model."""
OF_THE_BODY = ("max_com_error", "max_sole_error", "max_speed_use")
COUNTS = ("ticks_relaxed", "recovery_steps", "pushes_unrecovered")
"""Metrics without a unit, whose bounds hold for a robot of any size that times its steps alike."""


@dataclass(frozen=True, slots=True)
class Scale:
    """Factors from one robot to another."""

    speed: float
    time: float
    impulse: float


def scaled(scenario: Scenario, robot: Robot) -> Scenario:
    """The scenario for another robot; itself for its own one.

    Its expectations that are lengths, speeds or times of the first robot give way to the promises of any robot. Its
    counts stay, but for a robot with another step timing: one that hurries its steps takes more, by other plans.

    Args:
        scenario: as it was written.
        robot: that walks it.

    Raises:
        InvalidValueError: for what belongs to the first robot alone: its state, its links, or parameters that do not
            suit the other one.
    """
    if robot.source == scenario.robot.source:
        return scenario
    source = scenario.source
    if source.get("initial_state") is not None:
        raise InvalidValueError("initial_state", scenario.robot.name, f"is no state of {robot.name}: leave it out")
    parameters = robot.parameters.changed(source.get("parameters") or {})
    scale = _scale(scenario, robot, parameters)
    events = [_event(f"events[{i}]", event, scale, robot) for i, event in enumerate(source.get("events") or [])]
    slowest = min((share for _, share in events), default=1.0)
    note = f"Scaled to {robot.title}: speeds by {scale.speed:.2f} (Froude number), durations by {scale.time:.2f}"
    note += "." if slowest == 1.0 else f"; its max_reference takes references down to {slowest:.2f} of that."
    return scenario_from_mapping(
        dict(source)
        | {
            "name": f"{scenario.name}-{robot.name}",
            "description": f"{scenario.description} {note}".strip(),
            "robot": robot.source,
            "duration": round(scenario.duration * scale.time, DIGITS),
            "events": [event for event, _ in events],
            "expect": _expectations(scenario, robot, parameters),
        }
    )


def _scale(scenario: Scenario, robot: Robot, parameters: Parameters) -> Scale:
    before = scenario.robot
    speed = before.pendulum(scenario.parameters).omega / robot.pendulum(parameters).omega  # sqrt(g h) is g / omega
    time = parameters.step_duration / scenario.parameters.step_duration
    return Scale(speed, time, robot.mass / before.mass * speed)


def _event(where: str, event: Mapping[str, Any], scale: Scale, robot: Robot) -> tuple[dict[str, Any], float]:
    """The event for the robot, and the share of its scaled reference that is within the robot's limits."""
    changed, share = dict(event), 1.0
    for key in ("t", "over"):
        if key in event:
            changed[key] = round(event[key] * scale.time, DIGITS)
    if "reference" in event:
        changed["reference"], share = _reference(event["reference"], scale, robot)
    if "push" in event:
        changed["push"] = _push(where, event["push"], scale, robot)
    return changed, share


def _reference(reference: Mapping[str, float], scale: Scale, robot: Robot) -> tuple[dict[str, float], float]:
    factors = {"vx": scale.speed, "vy": scale.speed, "yaw_rate": 1.0 / scale.time}
    unlimited = {key: value * factors[key] for key, value in reference.items()}
    limits = {key: robot.max_reference[key][value > 0.0] for key, value in unlimited.items()}
    share = min((limits[key] / value for key, value in unlimited.items() if abs(value) > abs(limits[key])), default=1.0)
    kept = {key: round(share * value, DIGITS) for key, value in unlimited.items()}
    return {key: math.copysign(min(abs(value), abs(limits[key])), value) for key, value in kept.items()}, share


def _push(where: str, push: Mapping[str, Any], scale: Scale, robot: Robot) -> dict[str, Any]:
    if push.get("link"):
        limit = f"is a link of the robot that the scenario was written for, not of {robot.name}: leave it out"
        raise InvalidValueError(f"{where}.push.link", push["link"], limit)
    strength = scale.impulse * math.hypot(*push["impulse"])
    factor = scale.impulse * (min(1.0, robot.max_push / strength) if strength > 0.0 else 1.0)
    # Rounded up it might be too strong.
    impulse = [math.trunc(factor * part * 10**DIGITS) / 10**DIGITS for part in push["impulse"]]
    duration = {"duration": push["duration"] * scale.time} if "duration" in push else {}
    return dict(push) | {"impulse": impulse} | duration


def _expectations(scenario: Scenario, robot: Robot, parameters: Parameters) -> dict[str, float | bool]:
    """Expectations of the other robot's walk: its promises and the counts; that it falls, where that is expected."""
    expected: Mapping[str, float | bool] = scenario.source.get("expect") or {}
    if expected.get("not_fallen") is False:
        return {"not_fallen": False}
    without = () if robot.body is not None else OF_THE_BODY
    if not any(event.push for event in scenario.events):
        without = (*without, "max_pushes_unrecovered")
    promises = {key: bound for key, bound in PROMISES.items() if key not in without}
    if parameters.step_timing != scenario.parameters.step_timing:
        return promises
    return promises | {key: bound for key, bound in expected.items() if key[4:] in COUNTS}
