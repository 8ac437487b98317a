"""Metrics of a walk, by the names of `expectations.METRICS`, with the steady walks and pushes that they sum up.

No solve times: the core reads no clock, and the same scenario gives the same metrics. `walk bench` measures them.
"""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from walkcore.analysis.columns import BodyUse, Mask, Walk, cop_error, has_column, heading, points, ticks_relaxed
from walkcore.analysis.margins import dcm, support_margins
from walkcore.analysis.push_recovery import PushRecovery, push_recoveries
from walkcore.analysis.steady_walking import SteadyWalk, steady_walks
from walkcore.analysis.twin import twin_difference
from walkcore.mpc.plan import Status
from walkcore.values import Vector


def metrics(walk: Walk) -> dict[str, Any]:
    """All metrics of a walk; None where it has none of that name."""
    walks, pushes = steady_walks(walk), push_recoveries(walk)
    is_up = walk["status"] != Status.FALLEN
    return {
        "ticks": len(is_up),
        "duration": len(is_up) * walk.parameters["control_period"],
        "mean_velocity": [float(walk["com_vx"].mean()), float(walk["com_vy"].mean())],
        "ticks_relaxed": ticks_relaxed(walk),
        "status_counts": {s.name.lower(): int(np.sum(walk["status"] == s)) for s in Status},
        "has_fallen": not bool(is_up.all()),
        "reason": walk.reason,
        **_progress(walk),
        **_tracking(walks),
        **_recovery(pushes),
        **_balance(walk, is_up),
        **_plant(walk, is_up),
        **_body(walk.body_use),
        "steady_walks": [asdict(steady) for steady in walks],
        "pushes": [asdict(push) for push in pushes],
    }


def _progress(walk: Walk) -> dict[str, float]:
    com, yaw = points(walk, "com"), heading(walk)
    return {
        "distance_x": float(com[-1, 0] - com[0, 0]),
        "distance_y": float(com[-1, 1] - com[0, 1]),
        "turn": float(yaw[-1] - yaw[0]),
        "final_speed": float(np.hypot(walk["com_vx"][-1], walk["com_vy"][-1])),
    }


def _tracking(walks: Sequence[SteadyWalk]) -> dict[str, float | None]:
    return {
        "velocity_error": max((steady.velocity_error for steady in walks), default=None),
        "yaw_rate_error": max((steady.yaw_rate_error for steady in walks), default=None),
    }


def _recovery(pushes: Sequence[PushRecovery]) -> dict[str, float | None]:
    return {
        "recovery_time": max((push.time for push in pushes if push.time is not None), default=None),
        "recovery_steps": max((push.steps for push in pushes if push.steps is not None), default=None),
        "pushes_unrecovered": sum(push.time is None for push in pushes),
        "com_deviation": max((push.com_deviation for push in pushes if push.com_deviation is not None), default=None),
    }


def _balance(walk: Walk, is_up: Mask) -> dict[str, float | None]:
    """Margins and centres of pressure while the robot is on its feet."""
    margins = {
        "cop_margin": support_margins(walk, points(walk, "cop")),
        "true_cop_margin": support_margins(walk, points(walk, "true_cop")),
        "capturability_margin": support_margins(walk, dcm(walk)),
    }
    found: dict[str, float | None] = {}
    for name, margin in margins.items():
        found |= {name: _percentile(margin[is_up], 0), f"{name}_p1": _percentile(margin[is_up], 1)}
    found |= _distribution("cop_error", np.hypot(*cop_error(walk).T)[is_up])
    distance = np.hypot(*(points(walk, "com") - points(walk, "support")).T)
    return found | {"com_distance": float(distance.max())}


def _plant(walk: Walk, is_up: Mask) -> dict[str, Any]:
    """Contact physics against the model; None for the ideal plant."""
    if not has_column(walk, "ground_cop_x"):
        names = ("ground_cop_error", "ground_cop_error_p95", "ground_cop_error_median", "dcm_error", "twin_distance")
        return dict.fromkeys(names)
    found = _distribution("ground_cop_error", np.hypot(*(points(walk, "ground_cop") - points(walk, "cop")).T)[is_up])
    found["dcm_error"] = _percentile(np.hypot(*points(walk, "dcm_error").T)[is_up], 100)
    return found | _twin(walk, is_up)


def _twin(walk: Walk, is_up: Mask) -> dict[str, Any]:
    """The robot against the ideal one beside it."""
    if not has_column(walk, "twin_com_x"):
        return {"twin_distance": None}
    distance = np.hypot(*(points(walk, "measured_com") - points(walk, "twin_com")).T)
    is_twin_up = walk["twin_status"] != Status.FALLEN
    return {
        "twin_distance": _percentile(distance[is_up & is_twin_up], 100),
        "twin_has_fallen": not bool(is_twin_up.all()),
        "twin_difference": twin_difference(walk),
    }


def _distribution(name: str, error: Vector) -> dict[str, float | None]:
    """The largest, the 95th percentile and the median of an error."""
    percentiles = {name: 100, f"{name}_p95": 95, f"{name}_median": 50}
    return {name: _percentile(error, percentile) for name, percentile in percentiles.items()}


def _body(use: BodyUse | None) -> dict[str, Any]:
    if use is None:
        names = ("com_error", "sole_error", "torque_use", "torque_use_p99", "speed_use", "speed_use_p99")
        return dict.fromkeys(names) | {"joints": {}}
    # A push or a foothold that moves at the last moment is a jerk of one tick: the p99 is what a motor feels.
    joints: dict[str, dict[str, float | None]] = {
        joint: {
            f"{name}_use{ending}": _percentile(values[:, i], percentile)
            for name, values in (("torque", use.torque), ("speed", use.speed))
            for ending, percentile in (("", 100), ("_p99", 99))
        }
        for i, joint in enumerate(use.joints)
    }
    worst = {
        name: max((share for joint in joints.values() if (share := joint[name]) is not None), default=None)
        for name in ("torque_use", "torque_use_p99", "speed_use", "speed_use_p99")
    }
    errors = {name: _percentile(getattr(use, name), 100) for name in ("com_error", "sole_error")}
    return errors | worst | {"joints": joints}


def _percentile(values: Vector, percentile: float) -> float | None:
    """A percentile of the finite values; None if there are none."""
    finite = values[np.isfinite(values)]
    return float(np.percentile(finite, percentile)) if len(finite) else None
