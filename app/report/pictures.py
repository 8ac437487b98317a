"""The figures of a report: from above, velocities, margins and centres of pressure over time."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from app.drawing import palette
from app.drawing.axes import SPEED_HEIGHT, SPIKES, WIDTH, draw_feet, extent, figure, ink, legend, sole_key
from app.formats import StoredRun
from walkcore.analysis.columns import cop_error, heading_velocity, points, push_rows, reference_changes
from walkcore.analysis.margins import dcm, support_margins
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Side
from walkcore.values import Vector

HIGHEST = 7.0  # [in] of the view from above
PUSH_LENGTH = 0.015  # [m per N s] of an arrow
SVG = ("svg",)
SERIES = (palette.COM, palette.REFERENCE, palette.SUPPORT, palette.TRUE_COP, palette.PUSH)
"""Colours of several runs, in the order in which they are named."""


def draw_above(path: Path, run: StoredRun) -> None:
    """Draw footsteps, CoM, CoP, true CoP, and the places where the reference changed."""
    low_x, high_x, low_y, high_y = extent(run)
    height = min(1.05 + (WIDTH - 0.7) * (high_y - low_y) / (high_x - low_x), HIGHEST)
    with figure(path, SVG, height) as axes:
        for side in Side:
            draw_feet(axes, run, side)
        if np.isfinite(run["true_cop_x"]).any():
            axes.plot(
                *points(run, "true_cop").T, color=ink(palette.TRUE_COP), linewidth=0.5, label="true CoP", alpha=0.7
            )
        axes.plot(*points(run, "cop").T, color=ink(palette.COP), linewidth=0.8, label="CoP")
        axes.plot(*points(run, "com").T, color=ink(palette.COM), linewidth=1.5, label="CoM")
        for k in reference_changes(run):
            place = (run["com_x"][k], run["com_y"][k])
            axes.plot(*place, "o", color=ink(palette.REFERENCE), markersize=3, markeredgecolor="white", zorder=5)
        _draw_pushes(axes, run)
        axes.set(xlim=(low_x, high_x), ylim=(low_y, high_y), aspect="equal", xlabel="x [m]", ylabel="y [m]")
        axes.set_title("From above", pad=22)
        legend(axes, [*(sole_key(side) for side in Side), *_named(axes)])


def draw_pair(path: Path, run: StoredRun) -> None:
    """Draw the CoM and the contact CoP of the robot in physics, and the CoM of its ideal twin, from above."""
    low_x, high_x, low_y, high_y = extent(run)
    height = min(1.05 + (WIDTH - 0.7) * (high_y - low_y) / (high_x - low_x), HIGHEST)
    series = (
        ("ground_cop", palette.GROUND_COP, 0.6, "contact CoP"),
        ("measured_com", palette.COM, 1.5, "CoM of the robot"),
        ("twin_com", palette.LEFT_FOOT, 1.5, "CoM of the twin"),
    )
    with figure(path, SVG, height) as axes:
        for side in Side:
            draw_feet(axes, run, side)
        for name, colour, width, label in series:
            axes.plot(*points(run, name).T, color=ink(colour), linewidth=width, label=label)
        _draw_pushes(axes, run)
        axes.set(xlim=(low_x, high_x), ylim=(low_y, high_y), aspect="equal", xlabel="x [m]", ylabel="y [m]")
        axes.set_title("Robot and ideal twin from above", pad=22)
        legend(axes, _named(axes))


def draw_distance(path: Path, run: StoredRun) -> None:
    """Draw the distance between the CoMs of the robot in physics and of its ideal twin."""
    with figure(path, SVG, SPEED_HEIGHT) as axes:
        distance = np.hypot(*(points(run, "measured_com") - points(run, "twin_com")).T)
        axes.plot(run["t"], 100 * distance, color=ink(palette.COM), label="from CoM to CoM")
        _finish(axes, [run], "From the robot to its ideal twin", "[cm]")


def _draw_pushes(axes: Axes, run: StoredRun) -> None:
    for first, end in push_rows(run):
        push = points(run, "push")[first:end].sum(axis=0)
        tip = points(run, "com")[first]
        arrow = {"arrowstyle": "-|>", "color": ink(palette.PUSH), "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", tip, xytext=tip - PUSH_LENGTH * push, arrowprops=arrow)


def draw_velocity(path: Path, runs: Sequence[StoredRun], names: Sequence[str], axis: int) -> None:
    """Draw the speed of the CoM along the heading (axis 0) or to its left (axis 1), and its reference."""
    with figure(path, SVG, SPEED_HEIGHT) as axes:
        reference = f"reference_v{'xy'[axis]}"
        for number, run in enumerate(runs):
            blue, style = ink(palette.REFERENCE), {"drawstyle": "steps-post", "linewidth": 1.0}
            label = "reference" if number == 0 else "_"
            axes.plot(run["t"], run[reference], color=blue, label=label, alpha=0.8, **style)
        _draw_series(axes, runs, names, lambda run: heading_velocity(run)[:, axis])
        title = ("Forward speed", "Lateral speed")[axis]
        _finish(axes, runs, f"{title}, in the robot's heading frame", "[m/s]")


def draw_margins(path: Path, runs: Sequence[StoredRun], names: Sequence[str]) -> None:
    """Draw the distance from the CoP to the edge of the support polygon."""
    with figure(path, SVG, SPEED_HEIGHT) as axes:
        axes.axhline(0.0, color="#555555", linewidth=0.8)
        kept = runs[0].parameters["cop_margin"]
        axes.axhline(100 * kept, color="#999999", linewidth=0.8, linestyle=(0, (3, 2)), label="margin of the QP")
        _draw_series(axes, runs, names, lambda run: 100 * support_margins(run, points(run, "cop")))
        for run in runs:
            relaxed = run["t"][run["status"] == Status.RELAXED]
            axes.plot(relaxed, np.zeros(len(relaxed)), "|", color=ink(palette.PUSH), markersize=6)
        _finish(axes, runs, "CoP inside the support polygon (a tick below: relaxed)", "[cm]")


def draw_capturability(path: Path, runs: Sequence[StoredRun], names: Sequence[str]) -> None:
    """Draw the distance from the DCM to the edge of the support polygon: below zero the robot has to step."""
    with figure(path, SVG, SPEED_HEIGHT) as axes:
        axes.axhline(0.0, color="#555555", linewidth=0.8)
        _draw_series(axes, runs, names, lambda run: 100 * support_margins(run, dcm(run)))
        _finish(axes, runs, "DCM inside the support polygon (below zero: must step)", "[cm]")


def draw_cop_error(path: Path, runs: Sequence[StoredRun], names: Sequence[str]) -> None:
    """Draw the distance from the model's CoP to the true one."""
    with figure(path, SVG, SPEED_HEIGHT) as axes:
        errors = [100 * np.hypot(*cop_error(run).T) for run in runs]
        for run, name, error, colour in zip(runs, names, errors, _colours(runs, palette.TRUE_COP), strict=True):
            axes.plot(run["t"], error, color=colour, linewidth=0.9, label=name)
        finite = np.concatenate(errors)
        finite = finite[np.isfinite(finite)]
        axes.set_ylim(0.0, SPIKES * float(np.percentile(finite, 99)))
        _finish(axes, runs, "From the model's CoP to the true one (spikes of single ticks are cut off)", "[cm]")


def _draw_series(
    axes: Axes, runs: Sequence[StoredRun], names: Sequence[str], read: Callable[[StoredRun], Vector]
) -> None:
    for run, name, colour in zip(runs, names, _colours(runs, palette.COM), strict=True):
        axes.plot(run["t"], read(run), color=colour, linewidth=1.1, label=name)


def _colours(runs: Sequence[StoredRun], alone: palette.Colour) -> list[str]:
    return [ink(alone)] if len(runs) == 1 else [ink(SERIES[i % len(SERIES)]) for i in range(len(runs))]


def _finish(axes: Axes, runs: Sequence[StoredRun], title: str, unit: str) -> None:
    """Add pushes as dashed lines, title, and one line of legend."""
    for run in runs:
        for first, _ in push_rows(run):
            axes.axvline(run["t"][first], color=ink(palette.PUSH), linewidth=0.9, linestyle=(0, (3, 2)), zorder=1.5)
    start, end = min(run["t"][0] for run in runs), max(run["t"][-1] for run in runs)
    axes.set(xlim=(start, end), xlabel="time [s]", ylabel=unit)
    axes.set_title(title, pad=22)
    legend(axes, _named(axes))


def _named(axes: Axes) -> list:
    return [line for line in axes.get_lines() if not str(line.get_label()).startswith("_")]


def draw_paths(path: Path, runs: Sequence[StoredRun], names: Sequence[str]) -> None:
    """Draw the CoMs of several runs from above."""
    extents = np.array([extent(run) for run in runs])
    low_x, high_x, low_y, high_y = extents[:, 0].min(), extents[:, 1].max(), extents[:, 2].min(), extents[:, 3].max()
    height = min(1.05 + (WIDTH - 0.7) * (high_y - low_y) / (high_x - low_x), HIGHEST)
    with figure(path, SVG, height) as axes:
        for run, name, colour in zip(runs, names, _colours(runs, palette.COM), strict=True):
            axes.plot(*points(run, "com").T, color=colour, linewidth=1.3, label=name)
        axes.set(xlim=(low_x, high_x), ylim=(low_y, high_y), aspect="equal", xlabel="x [m]", ylabel="y [m]")
        axes.set_title("CoM from above", pad=22)
        legend(axes, _named(axes))
