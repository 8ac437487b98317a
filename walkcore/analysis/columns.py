"""The columns of a walk, fresh or read from a file, from which metrics are computed."""

from collections.abc import Container, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from walkcore.mpc.lipm import Pendulum
from walkcore.mpc.plan import Status
from walkcore.values import Matrix, Vector

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class BodyUse:
    """Errors and efforts of the whole body, tick by tick; NaN where it has fallen."""

    joints: tuple[str, ...]
    """Names, in Pinocchio's order."""
    torque: Matrix
    """Torques over the effort limits, shape (ticks, joints)."""
    speed: Matrix
    """Joint speeds over the velocity limits, from each tick to the next, shape (ticks - 1, joints)."""
    com_error: Vector
    """Distance from the requested CoM of the body to the reached one [m], shape (ticks,)."""
    sole_error: Vector
    """The same of the sole that is further off [m], shape (ticks,)."""


class Walk(Protocol):
    """Anything that has the columns of a recording."""

    @property
    def parameters(self) -> Mapping[str, Any]:
        """All that the QP used, at the first tick."""
        ...

    @property
    def reason(self) -> str:
        """Reason of the fall; empty if there was none."""
        ...

    @property
    def body_use(self) -> BodyUse | None:
        """None for a robot without a body."""
        ...

    @property
    def columns(self) -> Container[str]:
        """Names of the columns."""
        ...

    def __getitem__(self, column: str) -> Vector:
        """One column, shape (ticks,)."""
        ...


def has_column(walk: Walk, name: str) -> bool:
    """Whether a walk has a column that not every walk has."""
    return name in walk.columns


def pendulum(walk: Walk) -> Pendulum:
    """The model that the CoM of a walk follows."""
    return Pendulum(float(walk.parameters["com_height"]), float(walk.parameters["gravity"]))


def points(walk: Walk, name: str) -> Matrix:
    """The columns `name`_x and `name`_y side by side, shape (ticks, 2)."""
    return np.column_stack([walk[f"{name}_x"], walk[f"{name}_y"]])


def cop_error(walk: Walk) -> Matrix:
    """True less model CoP [m], shape (ticks, 2); NaN where there is no true one."""
    return points(walk, "true_cop") - points(walk, "cop")


def ticks_relaxed(walk: Walk) -> int:
    """Number of ticks at which another plan took the place of the paper's, which had no solution or led to a fall."""
    return int(np.sum(walk["status"] == Status.RELAXED))


def heading(walk: Walk) -> Vector:
    """Mean yaw of the feet [rad], shape (ticks,)."""
    return (walk["left_yaw"] + walk["right_yaw"]) / 2


def heading_velocity(walk: Walk) -> Matrix:
    """Velocity of the CoM in the robot's heading frame [m/s], shape (ticks, 2)."""
    v = np.column_stack([walk["com_vx"], walk["com_vy"]])
    c, s = np.cos(heading(walk)), np.sin(heading(walk))
    return np.column_stack([c * v[:, 0] + s * v[:, 1], c * v[:, 1] - s * v[:, 0]])


def nb_ticks_of(walk: Walk, duration: float) -> int:
    """Number of ticks that a duration takes.

    Args:
        walk: gives the control period.
        duration: [s].
    """
    return round(duration / float(walk.parameters["control_period"]))


def nb_rows_up(walk: Walk) -> int:
    """Rows before a fall, all if there is none."""
    fallen = np.flatnonzero(walk["status"] == Status.FALLEN)
    return int(fallen[0]) if len(fallen) else len(walk["status"])


def touchdowns(walk: Walk) -> NDArray[np.intp]:
    """Rows at which a foot has come to the ground."""
    landed = [(walk[f"{foot}_z"][1:] == 0.0) & (walk[f"{foot}_z"][:-1] > 0.0) for foot in ("left", "right")]
    return np.flatnonzero(landed[0] | landed[1]) + 1


def push_rows(walk: Walk) -> list[tuple[int, int]]:
    """First row of each push, and the row after its last: a push may last several ticks."""
    given = np.concatenate([[False], (walk["push_x"] != 0.0) | (walk["push_y"] != 0.0), [False]])
    edges = np.flatnonzero(np.diff(given.astype(int)))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]


def nb_ticks_of_step(walk: Walk, row: int) -> int:
    """Ticks of the step under way at a row: a walk may change the duration of its steps."""
    begun, durations = _steps(walk)
    return nb_ticks_of(walk, float(durations[np.searchsorted(begun, row, side="right") - 1]))


def timing_changes(walk: Walk) -> NDArray[np.intp]:
    """Rows at which a step begins that takes another time than the one before."""
    begun, durations = _steps(walk)
    return begun[1:][~np.isclose(np.diff(durations), 0.0)]


def _steps(walk: Walk) -> tuple[NDArray[np.intp], Vector]:
    """First row of each step, the first of which is said to begin at row 0, and their durations [s]."""
    left = walk["time_to_touchdown"]
    begun = np.flatnonzero(np.diff(left) > 0.0) + 1
    return np.append(0, begun), np.append(float(walk.parameters["step_duration"]), left[begun])


def reference_changes(walk: Walk) -> NDArray[np.intp]:
    """Rows at which the reference is not that of the row before."""
    reference = np.column_stack([walk[f"reference_{name}"] for name in ("vx", "vy", "yaw_rate")])
    return np.flatnonzero(np.any(np.diff(reference, axis=0) != 0.0, axis=1)) + 1
