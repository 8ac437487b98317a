"""The robot and the ideal one beside it: what became of the same commands in physics and in the model, in words."""

import numpy as np

from walkcore.analysis.columns import Walk, has_column, nb_rows_up, points, touchdowns
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Side
from walkcore.snapshot import Snapshot
from walkcore.values import Vector

SAME_MOMENT = 0.05  # [s]: less is told as 0.0 s


def twin_difference(walk: Walk) -> str:
    """One sentence on the difference between a walk in physics and its ideal twin.

    Args:
        walk: with the columns of a plant and of a twin; without them the sentence is empty.
    """
    if not has_column(walk, "twin_status"):
        return ""
    fallen_twin = np.flatnonzero(walk["twin_status"] == Status.FALLEN)
    end, end_of_twin = nb_rows_up(walk), int(fallen_twin[0]) if len(fallen_twin) else len(walk["status"])
    period, nb_rows = float(walk.parameters["control_period"]), len(walk["status"])
    distances = np.hypot(*(points(walk, "measured_com") - points(walk, "twin_com")).T)
    distance = distances[np.isfinite(distances)][-1]  # a twin may come and go
    steps = twin_steps(walk)
    return _in_words(
        None if end == nb_rows else end * period,
        None if end_of_twin == nb_rows else end_of_twin * period,
        steps[-1][1] - steps[-1][2] if steps else None,
        f"{100 * distance:.0f} cm from each other at the end",
    )


class TwinMonitor:
    """Follows a robot and its ideal twin tick by tick, and tells their difference as `twin_difference` does."""

    def __init__(self) -> None:
        """Begin before the first tick."""
        self.difference = ""
        """One sentence; empty without a twin."""
        self._before: Snapshot | None = None
        self._fell_at: float | None = None
        self._twin_fell_at: float | None = None
        self._longer: float | None = None

    def update(self, snapshot: Snapshot) -> None:
        """Add the snapshot of a tick."""
        before, self._before = self._before, snapshot
        twin, plant = snapshot.twin, snapshot.plant
        if twin is None or plant is None:
            self.difference, self._fell_at, self._twin_fell_at, self._longer = "", None, None, None
            return
        has_fallen, has_twin_fallen = snapshot.status is Status.FALLEN, twin.status is Status.FALLEN
        if not has_fallen and not has_twin_fallen:
            for side in Side:
                if before is not None and before.feet[side].height > 0.0 == snapshot.feet[side].height:
                    step = [plant.measured.soles[s].position[:2] for s in (side, side.other)]
                    twin_step = [twin.feet[s].position for s in (side, side.other)]
                    self._longer = _length(*step) - _length(*twin_step)
        if has_fallen and self._fell_at is None:
            self._fell_at = snapshot.t
        if has_twin_fallen and self._twin_fell_at is None:
            self._twin_fell_at = snapshot.t
        distance = _length(plant.measured.com[:2], twin.com.position)
        distance_now = f"{100 * distance:.0f} cm from each other"
        self.difference = _in_words(self._fell_at, self._twin_fell_at, self._longer, distance_now)


def _in_words(fell_at: float | None, twin_fell_at: float | None, longer: float | None, distance: str) -> str:
    """The difference as one sentence.

    Args:
        fell_at: time at which the robot fell [s]; None while it is up.
        twin_fell_at: time at which the twin fell [s]; None while it is up.
        longer: by how much the last step of the robot was longer than the twin's [m]; None before the first one.
        distance: of both, in words.
    """
    if fell_at is not None and twin_fell_at is not None:
        if abs(fell_at - twin_fell_at) < SAME_MOMENT:
            return "both fell, at the same moment"
        which = "later" if fell_at >= twin_fell_at else "earlier"
        return f"both fell, the robot {abs(fell_at - twin_fell_at):.1f} s {which} than the model"
    if twin_fell_at is not None:
        return "the model lost its balance; the robot went on"
    if fell_at is None:
        return f"both are up, {distance}"
    foot = "its feet where the model's were"
    if longer is not None:
        foot = f"its last step {100 * abs(longer):.0f} cm {'longer' if longer >= 0 else 'shorter'} than the model's"
    return f"the model went on; the robot fell, {foot}"


def _length(one: Vector, other: Vector) -> float:
    return float(np.hypot(*(one - other)))


def twin_steps(walk: Walk) -> list[tuple[int, float, float]]:
    """The steps while both were up: row of each touchdown, length of the robot's step and of the twin's [m].

    Args:
        walk: with the columns of a plant and of a twin.
    """
    is_down = (walk["status"] == Status.FALLEN) | (walk["twin_status"] == Status.FALLEN)
    end = int(np.argmax(is_down)) if np.any(is_down) else len(is_down)
    steps: list[tuple[int, float, float]] = []
    for k in touchdowns(walk):
        if k >= end or np.isnan(walk["twin_com_x"][k]):  # a twin may come and go
            continue
        moved, stood = ("left", "right") if walk["left_z"][k - 1] > 0.0 else ("right", "left")
        step, twin_step = (
            (points(walk, f"{prefix}{moved}") - points(walk, f"{prefix}{stood}"))[k]
            for prefix in ("measured_", "twin_")
        )
        steps.append((int(k), float(np.hypot(*step)), float(np.hypot(*twin_step))))
    return steps
