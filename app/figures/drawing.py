"""The two kinds of figure of the paper, the walk from above and a speed over time, in its colours."""

from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from numpy.typing import NDArray

from app.drawing import palette
from app.drawing.axes import SPEED_HEIGHT, SPIKES, WIDTH, draw_feet, extent, figure, ink, legend, sole_key
from app.figures import measures
from walkcore import Recording
from walkcore.analysis.columns import cop_error
from walkcore.mpc.stance import Side
from walkcore.values import Vector

PUSH_LENGTH = 0.22  # [m], of the arrow, whatever the push
SPIKE_GAP = 0.7  # [s] between spikes that are written one by one; of nearer ones the highest


def draw_from_above(path: Path, formats: tuple[str, ...], title: str, recording: Recording) -> None:
    """Draw footsteps and ankle paths grey, CoP black, CoM red, and the push magenta."""
    x_low, x_high, y_low, y_high = extent(recording)
    height = 1.05 + (WIDTH - 0.7) * (y_high - y_low) / (x_high - x_low)
    with figure(path, formats, height) as axes:
        for side in Side:
            draw_feet(axes, recording, side)
        cop = axes.plot(recording["cop_x"], recording["cop_y"], color=ink(palette.COP), linewidth=0.8, label="CoP")
        com = axes.plot(recording["com_x"], recording["com_y"], color=ink(palette.COM), linewidth=1.5, label="CoM")
        _mark_moments(axes, recording)
        axes.set(xlim=(x_low, x_high), ylim=(y_low, y_high), aspect="equal", xlabel="x [m]", ylabel="y [m]")
        axes.set_title(title, pad=22)
        legend(axes, [*(sole_key(side) for side in Side), *cop, *com])


def _mark_moments(axes: Axes, recording: Recording) -> None:
    """Mark the places of the CoM when the reference changed, and the push."""
    when = measures.moments(recording)
    for t in (when.sideways, when.forward, when.stop):
        k = _tick(recording, t)
        at = (recording["com_x"][k], recording["com_y"][k])
        axes.plot(*at, "o", color=ink(palette.REFERENCE), markersize=4, markeredgecolor="white", zorder=5)
        axes.annotate(
            f"{t:g} s",
            at,
            xytext=(5, 5),
            textcoords="offset points",
            color=ink(palette.REFERENCE),
            fontsize=8,
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8},
        )
    k = _tick(recording, when.push)
    push = np.array([recording["push_x"][k], recording["push_y"][k]])
    tip = np.array([recording["com_x"][k], recording["com_y"][k]])
    (x, y), (dx, dy) = tip, PUSH_LENGTH * push / np.linalg.norm(push)
    magenta = ink(palette.PUSH)
    arrow = {"arrowstyle": "-|>", "color": magenta, "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (x, y), xytext=(x - dx, y - dy), arrowprops=arrow)
    axes.annotate(
        f"push, {when.push:g} s", (x - dx, y - dy), (4, -1), textcoords="offset points", color=magenta, fontsize=8
    )


def _tick(recording: Recording, t: float) -> int:
    return round(t / float(recording.parameters["control_period"]))


def draw_speed(
    path: Path,
    formats: tuple[str, ...],
    title: str,
    recording: Recording,
    axis: str,
    limits: tuple[float, float],
    means: Vector | None = None,
) -> None:
    """Draw the speed of the CoM red, its reference blue, and means of it grey.

    Args:
        path: of the figure, without its ending.
        formats: endings: svg, pdf, png.
        title: above the axes.
        recording: of the sample motion.
        axis: "x", forward, or "y", lateral.
        limits: of the ordinate [m/s].
        means: over prediction horizons [m/s], shape (ticks,).
    """
    t = recording["t"]
    with figure(path, formats, SPEED_HEIGHT) as axes:
        _draw_speed(axes, recording, axis)
        if means is not None:
            axes.plot(t, means, color="#8a8d92", linewidth=2.4, label="mean over a prediction horizon", zorder=2.5)
        axes.set(xlim=(0.0, t[-1]), ylim=limits, xlabel="time [s]")
        axes.set_xticks(np.arange(0.0, t[-1] + 1.0, 2.0))
        _mark_push(axes, recording)
        axes.set_title(title, pad=22)
        legend(axes, [line for line in axes.get_lines() if not str(line.get_label()).startswith("_")])


def draw_reaction(path: Path, formats: tuple[str, ...], title: str, recording: Recording, analytic: Recording) -> None:
    """Draw the forward speed around the step of its reference, up to the push, red, and that by [11] black: Fig. 7.

    Args:
        path: of the figure, without its ending.
        formats: endings: svg, pdf, png.
        title: above the axes.
        recording: of the sample motion.
        analytic: of the same by the method of [11].
    """
    when = measures.moments(recording)
    with figure(path, formats, SPEED_HEIGHT) as axes:
        black = {"color": "#16121e", "linewidth": 1.1, "label": "CoM, by the method of [11]", "zorder": 2.4}
        axes.plot(analytic["t"], analytic["com_vx"], **black)  # pyright: ignore[reportArgumentType]  # of any type
        _draw_speed(axes, recording, "x")
        axes.set(xlim=(0.0, when.push), xlabel="time [s]")
        shown = measures.during(recording, 0.0, when.push)
        low, high = speed_limits([recording, analytic], "x", shown)
        axes.set_ylim(low, high)
        axes.set_title(title, pad=22)
        legend(axes, list(axes.get_lines()))


def draw_true_cop(path: Path, formats: tuple[str, ...], title: str, plain: Recording, filtered: Recording) -> None:
    """Draw how far the true CoP is from the model's, without and with the filter, and usually is in the paper."""
    with figure(path, formats, SPEED_HEIGHT) as axes:
        usual = axes.axhspan(0.0, 100 * measures.USUAL_COP_ERROR, color="#eeeeee", zorder=0, label="“usually” (paper)")
        distances = [100 * np.hypot(*cop_error(recording).T) for recording in (plain, filtered)]
        names, colours = ("plain", "with the dynamic filter"), (f"{ink(palette.TRUE_COP)}70", ink(palette.TRUE_COP))
        curves: list[Artist] = []
        for distance, name, colour in zip(distances, names, colours, strict=True):
            curves += axes.plot(plain["t"], distance, color=colour, linewidth=0.9, label=name)
        top = SPIKES * float(np.nanpercentile(distances[0], 99))
        axes.set(xlim=(0.0, plain["t"][-1]), ylim=(0.0, top), xlabel="time [s]", ylabel="distance [cm]")
        _mark_spikes(axes, plain["t"], np.fmax(*distances), top)
        axes.set_xticks(np.arange(0.0, plain["t"][-1] + 1.0, 2.0))
        axes.set_title(title, pad=22)
        legend(axes, [*curves, usual])


def _mark_spikes(axes: Axes, t: Vector, values: Vector, top: float) -> None:
    """Write the height of a curve where it leaves the axes at the top."""
    above = np.flatnonzero(values > top)
    for spike in np.split(above, np.flatnonzero(np.diff(t[above]) > SPIKE_GAP) + 1):
        if len(spike):
            k = spike[np.argmax(values[spike])]
            axes.text(float(t[k]) + 0.08, top, f"↑ {values[k]:.0f}", color=ink(palette.TRUE_COP), fontsize=8, va="top")


def _draw_speed(axes: Axes, recording: Recording, axis: str) -> None:
    name = {"x": "forward speed", "y": "lateral speed"}[axis]
    t, reference = recording["t"], recording[f"reference_v{axis}"]
    axes.plot(t, recording[f"com_v{axis}"], color=ink(palette.COM), label="CoM")
    blue = ink(palette.REFERENCE)
    axes.plot(t, reference, color=blue, drawstyle="steps-post", label="reference", linewidth=1.1)
    axes.set_ylabel(f"{name} [m/s]")


def _mark_push(axes: Axes, recording: Recording) -> None:
    when = measures.moments(recording)
    axes.axvline(when.push, color=ink(palette.PUSH), linewidth=0.9, linestyle=(0, (3, 2)), zorder=1.5)
    place = axes.get_xaxis_transform()
    axes.text(when.push + 0.12, 0.97, "push", transform=place, color=ink(palette.PUSH), fontsize=8, va="top")


def speed_limits(
    recordings: list[Recording], axis: str, shown: NDArray[np.bool_] | slice = slice(None)
) -> tuple[float, float]:
    """Limits of an ordinate that shows a speed and its reference in all the recordings [m/s]."""
    names = (f"com_v{axis}", f"reference_v{axis}")
    values = np.concatenate([recording[name][shown] for recording in recordings for name in names])
    room = 0.06 * float(np.ptp(values))
    return float(values.min()) - room, float(values.max()) + room
