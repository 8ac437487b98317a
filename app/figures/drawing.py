"""The two kinds of figure of the paper, the walk from above and a speed over time, in its colours."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from app import palette
from app.figures import measures
from walkcore import Recording
from walkcore.gait import Footstep, Side
from walkcore.regions import sole_vertices
from walkcore.values import Vector
from walkcore.walk import Walk, cop_error

WIDTH = 7.4  # [in]
SPEED_HEIGHT = 2.6  # [in]
PUSH_LENGTH = 0.22  # [m], of the arrow, whatever the push
SPIKES = 1.35  # times the 99th percentile: what is above is written, not drawn
SPIKE_GAP = 0.7  # [s] between spikes that are written one by one; of nearer ones the highest
GREYS = {Side.LEFT: palette.LEFT_FOOT, Side.RIGHT: palette.RIGHT_FOOT}
STYLE: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "sans-serif"],
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.edgecolor": "#555555",
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.4,
    "lines.linewidth": 1.3,
    "lines.solid_capstyle": "round",
    "lines.solid_joinstyle": "round",
    "path.simplify_threshold": 0.2,
    "svg.fonttype": "none",  # text stays text: small files, and words that can be searched
    "svg.hashsalt": "walk",  # the same walk gives the same bytes
    "pdf.fonttype": 42,
}
NO_DATE: Mapping[str, Mapping[str, None]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}


def ink(colour: palette.Colour) -> str:
    """A colour of the palette as matplotlib takes it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


@contextmanager
def figure(path: Path, formats: tuple[str, ...], height: float) -> Iterator[Axes]:
    """The axes of a new figure, which is written beside `path` in each of the formats.

    Args:
        path: of the figure, without its ending.
        formats: endings: svg, pdf, png.
        height: [in].
    """
    with matplotlib.rc_context(STYLE):
        sheet = Figure(figsize=(WIDTH, height), layout="constrained")
        yield sheet.add_subplot()
        for ending in formats:
            sheet.savefig(path.with_suffix(f".{ending}"), metadata=dict(NO_DATE[ending]), dpi=150)


def draw_from_above(path: Path, formats: tuple[str, ...], title: str, recording: Recording) -> None:
    """Footsteps and ankle paths grey, CoP black, CoM red; the push magenta."""
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


def extent(recording: Walk) -> tuple[float, float, float, float]:
    """Of all footsteps, with room around."""
    reach = np.abs(np.array(recording.parameters["sole"]["polygon"])).max() + 0.05
    x, y = (np.concatenate([recording[f"{foot}_{a}"] for foot in ("left", "right")]) for a in "xy")
    return x.min() - reach, x.max() + reach, y.min() - reach, y.max() + reach


def draw_feet(axes: Axes, recording: Walk, side: Side) -> None:
    """Each place where a foot has stood, and the path of its ankle from one to the next."""
    foot, grey = side.name.lower(), ink(GREYS[side])
    x, y, z, yaw = (recording[f"{foot}_{name}"] for name in ("x", "y", "z", "yaw"))
    sole = np.array(recording.parameters["sole"]["polygon"])
    has_landed = np.concatenate([[True], (z[1:] == 0.0) & (z[:-1] > 0.0)])
    for k in np.flatnonzero(has_landed):
        outline = sole_vertices(sole, Footstep(side, np.array([x[k], y[k]]), float(yaw[k])))
        axes.add_patch(Polygon(outline, facecolor=f"{grey}1c", edgecolor=f"{grey}b0", linewidth=0.7))
    axes.plot(x, y, color=grey, linewidth=0.6, alpha=0.6)


def sole_key(side: Side) -> Polygon:
    """What a foot looks like, for a legend."""
    grey = ink(GREYS[side])
    name = f"{side.name.lower()} footsteps and ankle path"
    return Polygon(np.zeros((1, 2)), facecolor=f"{grey}1c", edgecolor=f"{grey}b0", label=name)


def _mark_moments(axes: Axes, recording: Recording) -> None:
    """Where the CoM was when the reference changed, and the push."""
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
    """Speed of the CoM red, its reference blue; means of it grey.

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


def draw_reaction(path: Path, formats: tuple[str, ...], title: str, recording: Recording) -> None:
    """Forward speed around the step of its reference, up to the push: the red curve of Fig. 7."""
    when = measures.moments(recording)
    with figure(path, formats, SPEED_HEIGHT) as axes:
        _draw_speed(axes, recording, "x")
        axes.set(xlim=(0.0, when.push), xlabel="time [s]")
        shown = measures.during(recording, 0.0, when.push)
        low, high = speed_limits([recording], "x", shown)
        axes.set_ylim(low, high)
        axes.set_title(title, pad=22)
        legend(axes, list(axes.get_lines()))


def draw_true_cop(path: Path, formats: tuple[str, ...], title: str, plain: Recording, filtered: Recording) -> None:
    """How far the true CoP is from the model's, without and with the filter, and what the paper says it usually is."""
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
    """How high a curve goes where it leaves the axes at the top."""
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


def legend(axes: Axes, handles: Sequence[Artist]) -> None:
    """In one line between title and axes."""
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(-0.01, 0.985), ncols=len(handles), borderaxespad=0.2)
