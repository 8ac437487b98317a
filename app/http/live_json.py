"""The live snapshot as JSON: the columns of a recording, the plan, and how the walk keeps up. NaN becomes null."""

import math
from collections.abc import Iterable
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from app.live.live_state import LiveState
from app.live.tick_scheduler import LATENESS_EDGES, TickTiming
from walkcore import Robot, Snapshot
from walkcore.analysis.push_rose import PushRose, is_survived
from walkcore.scenario.recording import plant_columns, row


def live_json(state: LiveState) -> dict[str, Any]:
    """The latest snapshot, and who drives."""
    snapshot, plant = state.snapshot, state.snapshot.plant
    columns = row(snapshot) | plant_columns(snapshot)
    return {name: value if math.isfinite(value) else None for name, value in columns.items()} | {
        "q": None if snapshot.q is None else _finite(snapshot.q.tolist()),
        **({} if plant is None else {"q_commanded": _finite(plant.q_commanded.tolist())}),
        "robot": state.robot,
        "plant": state.plant,
        "plant_reason": state.plant_reason,
        "world": state.world.to_mapping(),
        "twin_difference": state.twin_difference,
        "plan": _plan_json(snapshot),
        "timing": _timing_json(state),
        "running": state.running,
        "speed": state.speed,
        "real_t": state.real_t,
        "driver": state.driver,
        "driver_client": state.driver_client,
        "last_push": None if state.last_push is None else asdict(state.last_push),
        "random_pushes": None if state.random_pushes is None else asdict(state.random_pushes),
        "reason": snapshot.reason,
        "fault": state.fault,
        "walk": state.walk,
        "fork": None if state.comparison is None else asdict(state.comparison),
        "push_rose": None if state.push_rose is None else _push_rose_json(state.push_rose),
    }


def _push_rose_json(rose: PushRose) -> dict[str, Any]:
    """How hard a push in each direction would be survived [N s], from straight ahead on counter-clockwise."""
    return {
        "tick": rose.tick,
        "survived": np.round(rose.survived, 1).tolist(),
        "bound": np.round(rose.bound, 1).tolist(),
    }


def past_json(state: LiveState, snapshot: Snapshot) -> dict[str, Any]:
    """An earlier tick as `live_json` has the present one.

    Args:
        state: of the present walk.
        snapshot: of the tick.
    """
    return live_json(
        replace(
            state,
            snapshot=snapshot,
            last_push=None,
            twin_difference="",
            comparison=None,
            push_rose=None,
            driver="past",
            driver_client="",
        )
    )


def preview_json(snapshot: Snapshot, robot: Robot) -> dict[str, Any]:
    """Effect of a push, by the first snapshot after it."""
    return {
        "status": snapshot.status.value,
        "survives": is_survived(snapshot, robot.max_com_distance),
        "step_duration": snapshot.step_duration,
        "next_step_duration": snapshot.next_step_duration,
        "plan": _plan_json(snapshot),
    }


def late_json(timing: TickTiming) -> dict[str, int]:
    """Number of ticks that started later than each edge, by the edge in ms."""
    return {f"{1e3 * edge:g}": timing.later_than(edge) for edge in LATENESS_EDGES}


def _timing_json(state: LiveState) -> dict[str, Any]:
    timing = state.timing
    return {
        "tick_ms": timing.tick_ms,
        "tick_ms_max": timing.tick_ms_max,
        "stages": dict(timing.stages),
        "ticks": timing.ticks,
        "misses": timing.misses,
        "late": late_json(timing),
        "late_ms_max": 1e3 * timing.lateness_max,
        "real_time_factor": timing.real_time_factor,
        "relaxed": state.counts.relaxed,
        "failed": state.counts.failed,
    }


def _plan_json(snapshot: Snapshot) -> dict[str, Any]:
    """The plan of a snapshot; empty but for the support polygon once the robot has fallen."""
    plan = snapshot.plan
    return {
        "times": [] if plan is None else plan.times.tolist(),
        "com": [] if plan is None else plan.com.tolist(),
        "cop": [] if plan is None else plan.cop.tolist(),
        "footholds": [
            {
                "x": float(foot.position[0]),
                "y": float(foot.position[1]),
                "yaw": foot.yaw,
                "side": foot.side.value,
                "region": region.tolist(),
            }
            for foot, region in ([] if plan is None else zip(plan.footholds, plan.foothold_regions, strict=True))
        ],
        "support_polygon": snapshot.stance.polygon.tolist(),
    }


def _finite(values: Iterable[float]) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values]
