"""Figures of a sweep: roses by direction, a map of direction and phase, and a curve over the speed."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from app.drawing import palette
from app.drawing.axes import NO_DATE, SPEED_HEIGHT, STYLE, figure, ink
from app.sweeps.summary import COMPONENTS, WalkCells
from walkcore.values import Vector

ROSE, MAP_SIZE = 4.6, (7.4, 3.6)  # [in]
COLOURS = "viridis"  # even steps look even, in grey and to the colour-blind as well
LINES = ("#1454c8", "#d62424", "#26a650", "#f77e0a", "#7a40e8", "#8c564b", "#16121e")


def draw_figures(folder: Path, walks: Sequence[WalkCells], bounds: Sequence[Vector] = ()) -> list[str]:
    """Draw all figures of a sweep, and return the names of their files.

    Args:
        folder: for the files.
        walks: of the sweep.
        bounds: for each walk, by direction, the impulse that no controller of the class survives in the worst phase
            [N s]; none where they were not computed.
    """
    names: list[str] = []
    for walk in walks:
        names += [f"rose-{walk.number}.svg", f"map-{walk.number}.svg"]
        draw_rose(folder / names[-2], walk, bounds[walk.number] if len(bounds) else None)
        draw_map(folder / names[-1], walk)
    for group in _by_motion(walks):
        if len(group) > 1:
            names.append(f"roses-{group[0].number}.svg")
            draw_roses(folder / names[-1], group, bounds[group[0].number] if len(bounds) else None)
    if any(len(curve) > 1 for curve in _curves(walks).values()):
        names.append("speed.svg")
        draw_speeds(folder / names[-1], walks)
    return names


def draw_rose(file: Path, walk: WalkCells, bound: Vector | None = None) -> None:
    """Draw the worst, the median and the best phase by direction, the robot facing up."""
    directions, magenta = _directions(walk), ink(palette.PUSH)
    with matplotlib.rc_context(STYLE):
        sheet, axes = _rose()
        worst, median, best = (_closed(total(walk.largest, axis=1)) for total in (np.min, np.median, np.max))
        axes.fill_between(directions, worst, best, color=magenta, alpha=0.14, linewidth=0)
        axes.plot(directions, best, color=magenta, linewidth=0.7, label="best phase")
        axes.plot(directions, median, color=magenta, linewidth=1.6, label="median")
        axes.plot(directions, worst, color="#16121e", linewidth=1.3, label="worst phase")
        if bound is not None:
            _draw_bound(axes, directions, bound)
        _finish_rose(axes, walk.name, walk.max_impulse, bound)
        sheet.savefig(file, metadata=dict(NO_DATE["svg"]))


def draw_roses(file: Path, walks: Sequence[WalkCells], bound: Vector | None = None) -> None:
    """Draw the worst phase and the median by direction of walks that differ in their parameters only.

    Args:
        file: to be written.
        walks: of one robot and one reference.
        bound: as of `draw_rose`.
    """
    with matplotlib.rc_context(STYLE):
        sheet, axes = _rose()
        for walk, colour in zip(walks, LINES * len(walks), strict=False):
            label, directions = ", ".join(_name_parts(walk)[1]) or "default", _directions(walk)
            worst, median = (_closed(total(walk.largest, axis=1)) for total in (np.min, np.median))
            axes.plot(directions, worst, color=colour, linewidth=1.5, label=f"{label}, worst phase")
            axes.plot(directions, median, color=colour, linewidth=0.8, alpha=0.75, label=f"{label}, median")
        if bound is not None:
            _draw_bound(axes, _directions(walks[0]), bound)
        _finish_rose(axes, ", ".join(_name_parts(walks[0])[0]), walks[0].max_impulse, bound)
        sheet.savefig(file, metadata=dict(NO_DATE["svg"]))


def _rose() -> tuple[Figure, Axes]:
    sheet = Figure(figsize=(ROSE, ROSE + 0.3), layout="constrained")
    return sheet, sheet.add_subplot(projection="polar")


def _directions(walk: WalkCells) -> Vector:
    """The directions of a walk's cells, the first one again at the end [rad]."""
    return np.linspace(0.0, 2 * np.pi, walk.largest.shape[0] + 1)


def _closed(values: Vector) -> Vector:
    return np.append(values, values[0])


def _draw_bound(axes: Axes, directions: Vector, bound: Vector) -> None:
    label = "bound in the worst phase"
    axes.plot(directions, _closed(bound), "--", color="#7a7d82", linewidth=1.1, label=label)


def _finish_rose(axes: Axes, title: str, highest: float, bound: Vector | None) -> None:
    axes.set_theta_zero_location("N")  # pyright: ignore[reportAttributeAccessIssue]  # polar axes have it
    axes.set_xticks(np.radians(np.arange(0, 360, 45)))
    axes.set_xticklabels(["ahead", "", "left", "", "back", "", "right", ""])
    axes.set_ylim(0.0, max(highest, 0.0 if bound is None else float(np.max(bound))) * 1.02)
    axes.set_title(f"{title}\nlargest push survived by its direction [N s]", pad=14)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.06), ncols=2)


def _name_parts(walk: WalkCells) -> tuple[list[str], list[str]]:
    """Robot and reference of a walk, and its parameters, from its name."""
    parts = walk.name.split(", ")
    return parts[:2], parts[2:]


def _by_motion(walks: Sequence[WalkCells]) -> list[list[WalkCells]]:
    """Walks that differ in their parameters only, none of which falls without a push."""
    groups: defaultdict[tuple[str, ...], list[WalkCells]] = defaultdict(list)
    for walk in walks:
        if not np.isnan(walk.largest).any():
            groups[tuple(_name_parts(walk)[0])].append(walk)
    return list(groups.values())


def draw_map(file: Path, walk: WalkCells) -> None:
    """Draw the largest impulse of each cell by direction and phase."""
    nb_directions, nb_phases = walk.largest.shape
    with matplotlib.rc_context({**STYLE, "axes.grid": False}):
        sheet = Figure(figsize=MAP_SIZE, layout="constrained")
        axes = sheet.add_subplot()
        half = 180.0 / nb_directions
        extent = (-half, 360.0 - half, 0.0, 1.0)
        image = axes.imshow(
            walk.largest.T,
            origin="lower",
            extent=extent,
            aspect="auto",
            cmap=COLOURS,
            vmin=0.0,
            vmax=walk.max_impulse,
            interpolation="nearest",
        )
        sheet.colorbar(
            image, ax=axes, label="largest push survived [N s]", extend="max" if walk.nb_capped else "neither"
        )
        axes.set_xticks([0, 90, 180, 270], ["ahead", "left", "back", "right"])
        axes.set(xlabel="direction that the push goes to", ylabel="phase of the step, left foot\non the ground")
        axes.set_title(walk.name)
        sheet.savefig(file, metadata=dict(NO_DATE["svg"]))


def draw_speeds(file: Path, walks: Sequence[WalkCells]) -> None:
    """Draw the median and the worst cell over the reference, a line for each robot and its parameters."""
    curves = {name: curve for name, curve in _curves(walks).items() if len(curve) > 1}
    with figure(file.with_suffix(""), ("svg",), SPEED_HEIGHT * 1.35) as axes:
        for (name, component), colour in zip(curves, LINES * len(curves), strict=False):
            speeds, worst, median = np.array(sorted(curves[name, component])).T
            axes.plot(speeds, median, "o-", color=colour, markersize=3.5, label=f"{name}, median")
            axes.plot(speeds, worst, "o--", color=colour, markersize=2.5, linewidth=0.9, label=f"{name}, worst")
        components = {component for _, component in curves}
        axis = (f"reference [{COMPONENTS[key].unit} {COMPONENTS[key].positive}]" for key in sorted(components))
        axes.set(xlabel=" or ".join(axis), ylim=(0.0, None))
        axes.set_ylabel("largest push survived [N s]")
        axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.2), ncols=2)


def _curves(walks: Sequence[WalkCells]) -> dict[tuple[str, str], list[tuple[float, float, float]]]:
    """Reference, worst and median impulse of the walks that differ in one component of their reference."""
    found: defaultdict[tuple[str, str], list[tuple[float, float, float]]] = defaultdict(list)
    for walk in walks:
        reference = walk.scenario.source["events"][0]["reference"]
        components = [key for key, value in reference.items() if value]
        if len(components) > 1 or np.isnan(walk.largest).any():
            continue
        (robot, _), parameters = _name_parts(walk)
        name = ", ".join([robot, *parameters])
        value = (float(np.min(walk.largest)), float(np.median(walk.largest)))
        for component in components or COMPONENTS:  # standing at zero belongs to the curve of every component
            found[name, component].append((float(reference.get(component, 0.0)), *value))
    return dict(found)
