"""Measures of a recording of the sample motion, from nothing but the recording."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from walkcore import Recording
from walkcore.analysis.columns import points, touchdowns
from walkcore.analysis.margins import support_margins
from walkcore.analysis.push_recovery import PushRecovery, push_recoveries
from walkcore.mpc.gait import Phase
from walkcore.mpc.regions import half_planes
from walkcore.mpc.stance import mirrored
from walkcore.values import Vector

Mask = NDArray[np.bool_]

TIME_TOLERANCE = 1e-6  # [s], far below any tick
USUAL_COP_ERROR = 0.02  # [m], of the model's CoP, says the paper


@dataclass(frozen=True, slots=True)
class Moments:
    """Times at which the sample motion changes [s]."""

    start: float
    """Start of the walk forward."""
    push: float
    sideways: float
    forward: float
    """Start of the second walk forward."""
    stop: float


def moments(recording: Recording) -> Moments:
    """The times at which references and push of the recording change."""
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
    """Distances of (28): from the CoP to the nearest edge of the sole under it, at the samples of the gait's grid [m].

    A sample at a touchdown belongs to the foot that carried the robot until then (section 4).
    """
    p = recording.parameters
    on_grid = recording["tick"] % round(p["sampling_period"] / p["control_period"]) == 0
    after_single_support = np.concatenate([[False], recording["phase"][:-1] == Phase.SINGLE_SUPPORT])
    ticks = np.flatnonzero(on_grid & after_single_support)
    support_sides = recording["support_side"][ticks - 1]
    cop = points(recording, "cop")[ticks]
    sole = np.array(p["sole"]["polygon"])
    margins = np.empty(len(ticks))
    for number, (foot, outline) in enumerate((("left", sole), ("right", mirrored(sole)))):
        x, y, yaw = (recording[f"{foot}_{name}"][ticks] for name in ("x", "y", "yaw"))
        dx, dy, c, s = cop[:, 0] - x, cop[:, 1] - y, np.cos(yaw), np.sin(yaw)
        local = np.column_stack([c * dx + s * dy, c * dy - s * dx])
        ground = half_planes(outline)
        along = local @ ground.normals.T
        distance = np.minimum(ground.upper - along, along - ground.lower).min(axis=1)
        margins[support_sides == number] = distance[support_sides == number]
    return margins


def margins_in_single_support(recording: Recording) -> Vector:
    """The same distance at every tick of a single support, between the samples too [m]."""
    margins = support_margins(recording, points(recording, "cop"))
    return margins[recording["phase"] == Phase.SINGLE_SUPPORT]


def time_to_reach(recording: Recording, start: float, fraction: float) -> float:
    """Time from `start` until the forward speed is that fraction of its reference [s]; NaN if it never is."""
    later = recording["t"] > start - TIME_TOLERANCE
    reached = later & (recording["com_vx"] >= fraction * recording["reference_vx"]) & (recording["reference_vx"] > 0.0)
    return float(recording["t"][reached][0]) - start if reached.any() else np.nan


def highest_speed(recording: Recording, start: float, end: float) -> float:
    """Highest forward speed in [start, end) [m/s]."""
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
    mask = steady(recording, *_lateral_moments(recording)) & (recording["phase"] == Phase.SINGLE_SUPPORT)
    return float(np.mean((recording["cop_x"] - recording["support_x"])[mask]))


def lateral_speed(recording: Recording) -> float:
    """Mean lateral speed over the whole gait cycles of the steady lateral walk [m/s]."""
    when = _lateral_moments(recording)
    return float(recording["com_vy"][steady(recording, *when)].mean())


def lateral_sway(recording: Recording) -> float:
    """Highest less lowest lateral speed in the steady lateral walk [m/s]."""
    when = _lateral_moments(recording)
    return float(np.ptp(recording["com_vy"][steady(recording, *when)]))


def lateral_reference(recording: Recording) -> float:
    """Reference of the lateral speed [m/s]."""
    return float(recording["reference_vy"][recording["reference_vy"] != 0.0][0])


def _lateral_moments(recording: Recording) -> tuple[float, float]:
    lateral = recording["t"][recording["reference_vy"] != 0.0]
    return float(lateral[0]), float(lateral[-1]) + float(recording.parameters["control_period"])


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
class PushEffect:
    """The effect of the push on the sample motion."""

    recovery: PushRecovery
    drift: float
    """Distance to the left of the walk without the push, once recovered, or at the end [m]."""
    free_touchdown: float
    """Time at which the foot on the side to which the push goes lands first [s]."""
    free_step: float
    """Distance to the left of the walk without the push at which it lands [m]."""


def push_effect(recording: Recording, without_push: Recording) -> PushEffect:
    """Compare the sample motion with the same without its push.

    Args:
        recording: of the sample motion.
        without_push: recording without the push, so that the sway of the gait does not count.
    """
    (found,) = push_recoveries(recording)
    period = float(recording.parameters["control_period"])
    push = round(found.t / period)
    recovered = -1 if found.time is None else push + round(found.time / period)
    to_the_right = found.impulse[1] < 0.0
    free = next(k for k in touchdowns(recording) if k > push and recording["support_side"][k] == float(to_the_right))
    beside = {name: recording[name] - without_push[name] for name in ("com_y", "support_y")}
    return PushEffect(
        recovery=found,
        drift=float(beside["com_y"][recovered]),
        free_touchdown=float(recording["t"][free]),
        free_step=float(beside["support_y"][free]),
    )


def velocity_of_push(recording: Recording) -> float:
    """Change of the CoM's velocity by the push [m/s]."""
    return float(np.abs(recording["push_y"]).max() / recording.parameters["mass"])
