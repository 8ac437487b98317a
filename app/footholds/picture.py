"""The picture of a foothold study: what was safe, what was not and why, and the polygons."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from app.drawing.palette import LEFT_FOOT, RIGHT_FOOT, SUPPORT, Colour
from app.footholds.study import Study
from walkcore import Robot, load_robot
from walkcore.footholds.safe_polygon import area
from walkcore.footholds.step_feasibility import Feasibility
from walkcore.footholds.study import HIGHEST, LOWEST
from walkcore.mpc.stance import Footstep, Side, sole_vertices
from walkcore.robot import FootholdRegion

# Told apart by shape as well as by colour.
MARKERS: dict[Feasibility, tuple[str, str]] = {
    Feasibility.SAFE: (".", "#2ba455"),
    Feasibility.REACH: ("x", "#1f6fb4"),
    Feasibility.JOINT_LIMIT: ("+", "#8c564b"),
    Feasibility.COLLISION: ("_", "#d62424"),
    Feasibility.JOINT_SPEED: ("|", "#8e5bb8"),
}
NB_COLUMNS = 3
FRONT_AND_SIDE = 0.13  # [m] that a sole may stick out over the placements


def draw(found: Study, file: Path) -> None:
    """Draw one panel for each band of yaw; the same study gives the same file."""
    robot = load_robot(found.robot)
    nb_rows = len(found.regions) // NB_COLUMNS + 1  # the last panel is the legend's
    with mpl.rc_context({"svg.hashsalt": "walk", "svg.fonttype": "none", "font.size": 8}):
        figure = Figure(figsize=(3.3 * NB_COLUMNS, 4.6 * nb_rows), layout="constrained")
        panels = figure.subplots(nb_rows, NB_COLUMNS).ravel()
        for panel, region in zip(panels, found.regions, strict=False):
            _draw_soles(panel, robot, region)
            _draw_placements(panel, found, region)
        for panel in panels[len(found.regions) :]:
            panel.set_axis_off()
        handles, labels = panels[0].get_legend_handles_labels()
        panels[-1].legend(handles, labels, loc="center", frameon=False, markerscale=1.6, fontsize=10)
        figure.suptitle(f"{len(found.outcomes)} footholds of {found.robot}, with the CoM at {found.com_height:g} m")
        figure.savefig(file, metadata={"Date": None} if file.suffix == ".svg" else None, dpi=200)


def _draw_placements(panel: Axes, found: Study, region: FootholdRegion) -> None:
    """The placements of a band by what came of them, and its polygon; seen from above, the robot facing up."""
    outcomes, yaw = np.asarray(found.outcomes), found.placements[:, 2]
    is_in_band = (region.lowest_yaw <= yaw) & (yaw <= region.highest_yaw)
    for outcome, (marker, colour) in MARKERS.items():
        x, y, _ = found.placements[is_in_band & (outcomes == outcome)].T
        total = int(np.count_nonzero(outcomes == outcome))
        panel.scatter(
            y,
            x,
            s=9,
            marker=marker,
            color=colour,
            linewidth=0.7,
            rasterized=True,
            label=f"{outcome.label}: {total}",
            zorder=2,
        )
    panel.add_patch(
        Polygon(region.vertices[:, ::-1], fill=False, edgecolor=_hex(SUPPORT), lw=1.8, label="polygon", zorder=3)
    )
    degrees = np.degrees([region.lowest_yaw, region.highest_yaw])
    panel.set_title(f"yaw {degrees[0]:.1f}° to {degrees[1]:.1f}° ({area(region.vertices) * 1e4:.0f} cm²)")
    panel.set(aspect="equal", xlabel="y, to the left [m]", ylabel="x, forward [m]")
    panel.set_xlim(HIGHEST[1] + FRONT_AND_SIDE, -FRONT_AND_SIDE)
    panel.set_ylim(LOWEST[0] - FRONT_AND_SIDE, HIGHEST[0] + FRONT_AND_SIDE)


def _draw_soles(panel: Axes, robot: Robot, region: FootholdRegion) -> None:
    """The right sole, which stands, and a left one beside it with a yaw of the band."""
    yaw = (region.lowest_yaw + region.highest_yaw) / 2
    feet = (
        (Footstep(Side.RIGHT, np.zeros(2), 0.0), RIGHT_FOOT),
        (Footstep(Side.LEFT, _middle(region), yaw), LEFT_FOOT),
    )
    for foot, colour in feet:
        outline = sole_vertices(robot.sole, foot)[:, ::-1]
        panel.add_patch(Polygon(outline, facecolor=_hex(colour), alpha=0.25, edgecolor=_hex(colour), zorder=1))


def _middle(region: FootholdRegion) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.mean(region.vertices, axis=0)


def _hex(colour: Colour) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
