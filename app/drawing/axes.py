"""Axes, colours and marks that figures and reports share, so that they look alike."""

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

from app.drawing import palette
from walkcore.analysis.columns import Walk
from walkcore.mpc.stance import Footstep, Side, sole_vertices

WIDTH = 7.4  # [in]
SPEED_HEIGHT = 2.6  # [in]
SPIKES = 1.35  # times the 99th percentile: what is above is written, not drawn
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


def extent(recording: Walk) -> tuple[float, float, float, float]:
    """Extent of all footsteps with room around: least and largest x, least and largest y [m]."""
    reach = np.abs(np.array(recording.parameters["sole"]["polygon"])).max() + 0.05
    x, y = (np.concatenate([recording[f"{foot}_{a}"] for foot in ("left", "right")]) for a in "xy")
    return x.min() - reach, x.max() + reach, y.min() - reach, y.max() + reach


def draw_feet(axes: Axes, recording: Walk, side: Side) -> None:
    """Draw each place where a foot has stood, and the path of its ankle from one to the next."""
    foot, grey = side.name.lower(), ink(GREYS[side])
    x, y, z, yaw = (recording[f"{foot}_{name}"] for name in ("x", "y", "z", "yaw"))
    sole = np.array(recording.parameters["sole"]["polygon"])
    has_landed = np.concatenate([[True], (z[1:] == 0.0) & (z[:-1] > 0.0)])
    for k in np.flatnonzero(has_landed):
        outline = sole_vertices(sole, Footstep(side, np.array([x[k], y[k]]), float(yaw[k])))
        axes.add_patch(Polygon(outline, facecolor=f"{grey}1c", edgecolor=f"{grey}b0", linewidth=0.7))
    axes.plot(x, y, color=grey, linewidth=0.6, alpha=0.6)


def sole_key(side: Side) -> Polygon:
    """Sample of a footstep, for a legend."""
    grey = ink(GREYS[side])
    name = f"{side.name.lower()} footsteps and ankle path"
    return Polygon(np.zeros((1, 2)), facecolor=f"{grey}1c", edgecolor=f"{grey}b0", label=name)


def legend(axes: Axes, handles: Sequence[Artist]) -> None:
    """Draw a legend in one line between title and axes."""
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(-0.01, 0.985), ncols=len(handles), borderaxespad=0.2)
