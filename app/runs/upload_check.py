"""Check of a recording from anywhere: whoever draws it finds numbers where it looks for some."""

from collections.abc import Iterable, Mapping

import numpy as np

from app.formats import unit
from walkcore import Robot
from walkcore.errors import InvalidValueError
from walkcore.motion.body_model import load_model
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status
from walkcore.values import FARTHEST, MAX_TICK, Vector

LARGEST = 1e9  # of any number that is no length
UNIT_TOLERANCE = 1e-3  # of a quaternion's length
PERIOD_TOLERANCE = 1e-6  # [s] between a tick's time and what its number tells


def _named(*groups: tuple[str, str]) -> tuple[str, ...]:
    """The columns `name_x name_y` of ("name", "x y")."""
    return tuple(f"{name}_{part}" for name, parts in groups for part in parts.split())


FEET = (("left", "x y z yaw"), ("right", "x y z yaw"))
FINITE = (
    *("tick", "t", "phase", "support_side", "samples_on_support", "status"),
    *("steps_to_stand", "step_duration", "next_step_duration"),
    *_named(("com", "x y z vx vy ax ay"), ("jerk", "x y"), ("cop", "x y"), ("reference", "vx vy yaw_rate")),
    *_named(("support", "x y yaw"), *FEET, ("push", "x y"), ("com_offset", "x y")),
)
"""Columns that have a number at every tick."""
TOGETHER = (_named(("true_cop", "x y")), _named(("foothold", "x y yaw")), _named(("foothold2", "x y yaw")))
"""Columns whose numbers are missing together; each has to be there."""
MEASURED = (
    *("left_force", "right_force"),
    *_named(("dcm_error", "x y"), ("measured_com", "x y z vx vy")),
    *_named(("measured_left", "x y z yaw"), ("measured_right", "x y z yaw")),
)
"""Columns of contact physics that have a number at every tick."""
MEASURED_TOGETHER = (_named(("ground_cop", "x y")), _named(("commanded_cop", "x y")))
TWIN = ("twin_status", *_named(*((f"twin_{name}", parts) for name, parts in (*FEET, ("com", "x y"), ("cop", "x y")))))
CODES = {
    "phase": [phase.value for phase in Phase],
    "status": [status.value for status in Status],
    "support_side": [0, 1],
}


def checked_columns(columns: Mapping[str, Vector], robot: Robot) -> dict[str, Vector]:
    """The columns that a recording of a robot has; others are left out.

    Args:
        columns: each of shape (ticks,), all of one length.
        robot: that walked.

    Raises:
        InvalidValueError: naming the first column that is missing or has a value that it cannot have.
    """
    nq = 0 if robot.body is None else load_model(robot.body).nq
    _check_there(columns, (*FINITE, "time_to_touchdown", *_flat(TOGETHER), *_joints("q", nq)))
    _check_finite(columns, (*FINITE, *_joints("q", nq)))
    known = (*FINITE, "time_to_touchdown", *_flat(TOGETHER), "foothold3_yaw", "foothold4_yaw", *_joints("q", nq))
    together = TOGETHER
    _check_quaternion(columns, "q", nq)
    if "q_commanded_0" in columns and nq:
        measured = (*MEASURED, *_joints("q_commanded", nq))
        _check_there(columns, (*measured, *_flat(MEASURED_TOGETHER)))
        _check_finite(columns, measured)
        _check_quaternion(columns, "q_commanded", nq)
        known, together = (*known, *measured, *_flat(MEASURED_TOGETHER)), (*together, *MEASURED_TOGETHER)
    if "twin_q_0" in columns and nq:
        twin = (*TWIN, *_joints("twin_q", nq))
        _check_there(columns, twin)
        _check_quaternion(columns, "twin_q", nq)
        _check_codes(columns, "twin_status", CODES["status"])
        known, together = (*known, *twin), (*together, twin)
    for names in together:
        _check_missing_together(columns, names)
    for name, codes in CODES.items():
        _check_codes(columns, name, codes)
    found = {name: values for name, values in columns.items() if name in known}
    for name, values in found.items():
        _check_magnitude(name, values)
    _check_ticks(columns)
    return found


def control_period(columns: Mapping[str, Vector], period: float | None = None) -> float:
    """Time from one tick to the next [s], by the columns `tick` and `t`.

    Args:
        columns: of a recording.
        period: that run.json tells; None where there is no run.json.

    Raises:
        InvalidValueError: if the time does not go on in equal steps, or in others.
    """
    tick, t = columns["tick"], columns["t"]
    if period is None:
        if len(tick) < 2:
            raise InvalidValueError(
                "rows", len(tick), "must be at least 2, to tell the control period without run.json"
            )
        period = round(float((t[-1] - t[0]) / (tick[-1] - tick[0])), 9)
    late = np.flatnonzero(~(np.abs(t - tick * period) < PERIOD_TOLERANCE))
    if len(late):
        k = late[0]
        raise InvalidValueError(f"t[{k}]", float(t[k]), f"must be tick times {period:g} s, {tick[k] * period:g}")
    return period


def _flat(groups: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
    return tuple(name for group in groups for name in group)


def _joints(name: str, nq: int) -> tuple[str, ...]:
    return tuple(f"{name}_{i}" for i in range(nq))


def _check_there(columns: Mapping[str, Vector], names: Iterable[str]) -> None:
    missing = [name for name in names if name not in columns]
    if missing:
        shown = ", ".join(missing[:8]) + (f" and {len(missing) - 8} more" if len(missing) > 8 else "")
        raise InvalidValueError("columns", len(columns), f"must be those of a recording; there is no {shown}")


def _refuse_first(name: str, values: Vector, is_wrong: np.ndarray, limit: str) -> None:
    rows = np.flatnonzero(is_wrong)
    if len(rows):
        raise InvalidValueError(f"{name}[{rows[0]}]", float(values[rows[0]]), limit)


def _check_finite(columns: Mapping[str, Vector], names: Iterable[str]) -> None:
    for name in names:
        _refuse_first(name, columns[name], ~np.isfinite(columns[name]), "must be finite")


def _check_missing_together(columns: Mapping[str, Vector], names: tuple[str, ...]) -> None:
    first = np.isnan(columns[names[0]])
    for name in names[1:]:
        differs = np.isnan(columns[name]) != first
        _refuse_first(name, columns[name], differs, f"must be nan exactly where {names[0]} is")


def _check_codes(columns: Mapping[str, Vector], name: str, codes: list[int]) -> None:
    values = columns[name]
    is_wrong = ~(np.isin(values, codes) | (np.isnan(values) & name.startswith("twin")))
    _refuse_first(name, values, is_wrong, f"must be one of {', '.join(map(str, codes))}")


def _check_quaternion(columns: Mapping[str, Vector], name: str, nq: int) -> None:
    if not nq:
        return
    length = np.sqrt(sum(columns[f"{name}_{i}"] ** 2 for i in range(3, 7)))
    is_wrong = ~(np.abs(length - 1.0) < UNIT_TOLERANCE) & ~np.isnan(length)
    _refuse_first(f"{name}_3..6", np.asarray(length), is_wrong, "must be a quaternion of length 1")


def _check_magnitude(name: str, values: Vector) -> None:
    largest = FARTHEST if unit(name) == "m" else float(MAX_TICK) if name in ("tick", "t") else LARGEST
    is_wrong = ~np.isnan(values) & ~(np.abs(values) <= largest)
    _refuse_first(name, values, is_wrong, f"must be within ±{largest:g}")


def _check_ticks(columns: Mapping[str, Vector]) -> None:
    tick = columns["tick"]
    _refuse_first("tick", tick, (tick < 0) | (tick != np.round(tick)), f"must be whole, from 0 to {MAX_TICK}")
    _refuse_first("tick", tick, np.diff(tick, prepend=tick[0] - 1.0) != 1.0, "must be one more than in the row before")
    for name in ("samples_on_support", "steps_to_stand"):
        _refuse_first(name, columns[name], columns[name] != np.round(columns[name]), "must be a whole number")
