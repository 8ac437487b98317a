"""Numbers read off a recording of the sample motion, and nothing but the recording."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from walkcore import Recording
from walkcore.pattern_generator import Status
from walkcore.regions import mirrored, polygon
from walkcore.values import Vector

Mask = NDArray[np.bool_]

TIME_TOLERANCE = 1e-6  # [s], far below any tick
USUAL_COP_ERROR = 0.02  # [m], of the model's CoP, says the paper


@dataclass(frozen=True, slots=True)
class Moments:
    """When the sample motion changes [s]."""

    start: float
    """Forward."""
    push: float
    sideways: float
    forward: float
    """Again."""
    stop: float


def moments(recording: Recording) -> Moments:
    """Read from the references and the push of the recording."""
    t, vx, vy = recording["t"], recording["reference_vx"], recording["reference_vy"]
    start, sideways = t[vx > 0.0][0], t[vy != 0.0][0]
    forward = t[(vx > 0.0) & (t > sideways)][0]
    stop = t[(vx == 0.0) & (t > forward)][0]
    return Moments(float(start), float(t[recording["push_y"] != 0.0][0]), *map(float, (sideways, forward, stop)))


def during(recording: Recording, start: float, end: float) -> Mask:
    """Mask of the ticks in [start, end) [s]."""
    t = recording["t"]
    return (t > start - TIME_TOLERANCE) & (t < end - TIME_TOLERANCE)


def cycle(recording: Recording) -> float:
    """Duration of a whole gait cycle, two steps [s]."""
    return 2.0 * float(recording.parameters["step_duration"])


def steady(recording: Recording, start: float, end: float) -> Mask:
    """Mask of the last whole gait cycles before `end` that begin after `start` and a first transient step [s]."""
    first_step = cycle(recording) / 2
    nb_cycles = int((end - start - first_step + TIME_TOLERANCE) // cycle(recording))
    return during(recording, end - nb_cycles * cycle(recording), end)


def margins_at_samples(recording: Recording) -> Vector:
    """From the CoP to the nearest edge of the sole that carries it, at the samples of the gait's grid [m]: (28).

    A sample at a touchdown belongs to the foot that carried the robot until then (section 4).
    """
    p = recording.parameters
    on_grid = recording["tick"] % round(p["sampling_period"] / p["control_period"]) == 0
    after_single_support = np.concatenate([[False], recording["phase"][:-1] == 2])
    ticks = np.flatnonzero(on_grid & after_single_support)
    return _margins(recording, ticks, recording["support_side"][ticks - 1])


def margins_in_single_support(recording: Recording) -> Vector:
    """The same distance at every tick of a single support, between the samples too [m]."""
    ticks = np.flatnonzero(recording["phase"] == 2)
    return _margins(recording, ticks, recording["support_side"][ticks])


def _margins(recording: Recording, ticks: NDArray[np.intp], side: Vector) -> Vector:
    cop = np.column_stack([recording["cop_x"], recording["cop_y"]])[ticks]
    sole = np.array(recording.parameters["sole"]["polygon"])
    margins = np.empty(len(ticks))
    for number, (foot, outline) in enumerate((("left", sole), ("right", mirrored(sole)))):
        x, y, yaw = (recording[f"{foot}_{name}"][ticks] for name in ("x", "y", "yaw"))
        dx, dy, c, s = cop[:, 0] - x, cop[:, 1] - y, np.cos(yaw), np.sin(yaw)
        local = np.column_stack([c * dx + s * dy, c * dy - s * dx])
        ground = polygon(outline)
        along = local @ ground.normals.T
        room = np.minimum(ground.upper - along, along - ground.lower).min(axis=1)
        margins[side == number] = room[side == number]
    return margins


def time_to_reach(recording: Recording, start: float, fraction: float) -> float:
    """From `start` until the forward speed is that fraction of its reference [s]; NaN if it never is."""
    later = recording["t"] > start - TIME_TOLERANCE
    reached = later & (recording["com_vx"] >= fraction * recording["reference_vx"]) & (recording["reference_vx"] > 0.0)
    return float(recording["t"][reached][0]) - start if reached.any() else np.nan


def highest_speed(recording: Recording, start: float, end: float) -> float:
    """Forward, in [start, end) [m/s]."""
    return float(recording["com_vx"][during(recording, start, end)].max())


def speed_ripple(recording: Recording) -> float:
    """Root mean square of the forward speed's error in the steady walk forward at the end [m/s]."""
    when = moments(recording)
    mask = during(recording, when.stop - 2 * cycle(recording), when.stop)
    return _rms((recording["com_vx"] - recording["reference_vx"])[mask])


def forward_jitter(recording: Recording) -> float:
    """Root mean square of the forward speed in the steady walk sideways, where it should be zero [m/s]."""
    return _rms(recording["com_vx"][steady(recording, *_lateral_moments(recording))])


def cop_path(recording: Recording) -> float:
    """Length of the path of the CoP over the length of that of the CoM, both in the steady walk sideways."""
    mask = steady(recording, *_lateral_moments(recording))
    cop, com = (np.sum(np.hypot(*(np.diff(recording[f"{point}_{a}"][mask]) for a in "xy"))) for point in ("cop", "com"))
    return float(cop / com)


def _rms(values: Vector) -> float:
    return float(np.sqrt(np.mean(values**2)))


def cop_ahead_of_foot(recording: Recording) -> float:
    """Mean distance of the CoP before the origin of the support foot in steady lateral walk, single support [m]."""
    mask = steady(recording, *_lateral_moments(recording)) & (recording["phase"] == 2)
    return float(np.mean((recording["cop_x"] - recording["support_x"])[mask]))


def lateral_speed(recording: Recording) -> float:
    """Mean over the whole gait cycles of the steady lateral walk [m/s]."""
    when = _lateral_moments(recording)
    return float(recording["com_vy"][steady(recording, *when)].mean())


def lateral_sway(recording: Recording) -> float:
    """Highest less lowest lateral speed in the steady lateral walk [m/s]."""
    when = _lateral_moments(recording)
    return float(np.ptp(recording["com_vy"][steady(recording, *when)]))


def lateral_reference(recording: Recording) -> float:
    """Lateral speed that was asked [m/s]."""
    return float(recording["reference_vy"][recording["reference_vy"] != 0.0][0])


def _lateral_moments(recording: Recording) -> tuple[float, float]:
    asked = recording["t"][recording["reference_vy"] != 0.0]
    return float(asked[0]), float(asked[-1]) + float(recording.parameters["control_period"])


def lateral_bound(recording: Recording) -> float:
    """Highest mean lateral speed that any placement allows [m/s].

    One step out as far as the foothold region reaches, the next one back by its least: two
    successive steps move the feet by the difference.
    """
    y = np.array(recording.parameters["foothold_region"])[:, 1]
    return float(y.max() - y.min()) / cycle(recording)


def mean_over_horizon(recording: Recording, name: str) -> Vector:
    """Mean of a speed over a prediction horizon around each tick [m/s]; NaN where the recording does not hold one."""
    p = recording.parameters
    half = round(p["horizon_samples"] * p["sampling_period"] / p["control_period"] / 2)
    total = np.concatenate([[0.0], np.cumsum(recording[name])])
    means = np.full(len(recording.rows), np.nan)
    means[half:-half] = (total[2 * half : -1] - total[: -2 * half - 1]) / (2 * half)
    return means


@dataclass(frozen=True, slots=True)
class Recovery:
    """From the push on."""

    duration: float
    """Until the velocity is that of the same walk without the push for a whole gait cycle [s]; NaN if it never is."""
    nb_steps: int
    """Touchdowns until then."""
    drift: float
    """To the left of the walk without the push, once recovered [m]."""
    free_touchdown: float
    """When the foot on the side to which the push goes lands for the first time [s]."""
    free_step: float
    """How far to the left of the walk without the push it lands [m]."""


def recovery(recording: Recording, without_push: Recording, bound: float) -> Recovery:
    """How the robot gets over the push.

    Args:
        recording: of the sample motion.
        without_push: of the same without the push, so that the sway of the gait does not count.
        bound: on the difference of their velocities [m/s].
    """
    when, period = moments(recording), float(recording.parameters["control_period"])
    push, per_cycle = round(when.push / period), round(cycle(recording) / period)
    end = len(recording.rows)
    strayed = np.hypot(*(recording[name] - without_push[name] for name in ("com_vx", "com_vy"))) > bound
    calm_from = push + 1
    while calm_from <= end - per_cycle and strayed[calm_from : calm_from + per_cycle].any():
        calm_from += 1
    has_recovered = calm_from <= end - per_cycle

    touchdowns = np.flatnonzero(np.diff(recording["support_side"]) != 0) + 1
    to_the_right = recording["push_y"][push] < 0.0
    free = next(k for k in touchdowns if k > push and recording["support_side"][k] == float(to_the_right))
    beside = {name: recording[name] - without_push[name] for name in ("com_y", "support_y")}
    return Recovery(
        duration=(calm_from - push) * period if has_recovered else np.nan,
        nb_steps=int(np.sum((touchdowns > push) & (touchdowns <= calm_from))),
        drift=float(beside["com_y"][min(calm_from, end - 1)]),
        free_touchdown=float(recording["t"][free]),
        free_step=float(beside["support_y"][free]),
    )


def velocity_of_push(recording: Recording) -> float:
    """What the push adds to the velocity of the CoM [m/s]."""
    return float(np.abs(recording["push_y"]).max() / recording.parameters["mass"])


def ticks_relaxed(recording: Recording) -> int:
    """At which the margin was given up, because the QP had no solution or its plan led to a fall."""
    return int(np.sum(recording["status"] == Status.RELAXED))


def true_cop_error(recording: Recording, axis: str) -> Vector:
    """True less model CoP along "x" or "y" [m], shape (ticks,); NaN where there is no true one."""
    return recording[f"true_cop_{axis}"] - recording[f"cop_{axis}"]


def true_cop_distance(recording: Recording) -> Vector:
    """From the model's CoP to the true one [m], shape (ticks,); NaN where there is no true one."""
    return np.hypot(true_cop_error(recording, "x"), true_cop_error(recording, "y"))
