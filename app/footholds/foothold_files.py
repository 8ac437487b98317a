"""Files of a foothold study: lines of a robot file, a table of all placements, and their picture."""

import csv
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from app.drawing.palette import LEFT_FOOT, RIGHT_FOOT, SUPPORT, Colour
from app.footholds.foothold_study import FootholdStudy
from walkcore import Robot
from walkcore.footholds.safe_polygon import area
from walkcore.footholds.step_feasibility import Feasibility
from walkcore.footholds.study import HIGHEST, LOWEST, common_vertices
from walkcore.mpc.stance import Footstep, Side, sole_vertices
from walkcore.robot import FootholdRegion
from walkcore.values import Matrix

# Distinguished by shape as well as by colour.
MARKERS: dict[Feasibility, tuple[str, str]] = {
    Feasibility.SAFE: (".", "#2ba455"),
    Feasibility.REACH: ("x", "#1f6fb4"),
    Feasibility.JOINT_LIMIT: ("+", "#8c564b"),
    Feasibility.COLLISION: ("_", "#d62424"),
    Feasibility.JOINT_SPEED: ("|", "#8e5bb8"),
}
NB_COLUMNS = 3
FRONT_AND_SIDE = 0.13  # [m] that a sole may stick out over the placements


def summary(found: FootholdStudy) -> str:
    """Lines of a robot file with the regions, and comments on their origin."""
    lines = [
        f"# {found.command}",
        f"# {len(found.outcomes)} placements: {_counts(found.outcomes)}",
        f"# {len(found.steps)} steps between any two new placements inside of the polygons: {_counts(found.steps)}",
        f"# {len(found.short_steps)} steps of {found.shortest_step_duration:g} s between those of them that the foot"
        f" can reach: {_counts(found.short_steps)}",
        "foothold_regions:   # m, of the left foot in the right foot's frame, by its yaw against it (rad, toes out)",
    ]
    for region in found.regions:
        lines += [
            f"  - yaw: [{region.lowest_yaw:g}, {region.highest_yaw:g}]",
            f"    region: {_corners(region.vertices)}",
        ]
    lines.append(f"# safe at all these yaws: {_corners(common_vertices(found.regions))}")
    return "\n".join(lines) + "\n"


def write(found: FootholdStudy, folder: Path) -> None:
    """Write footholds.yaml (the lines of a robot file), footholds.csv (all placements) and footholds.svg."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "footholds.yaml").write_text(summary(found), encoding="utf-8")
    with (folder / "footholds.csv").open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["x", "y", "yaw", "outcome"])
        for placement, outcome in zip(found.placements, found.outcomes, strict=True):
            rows.writerow([*(f"{value:.6f}" for value in placement), outcome.name.lower()])
    draw(found, folder / "footholds.svg")


def _corners(vertices: Matrix) -> str:
    return "[" + ", ".join(f"[{x:.4f}, {y:.4f}]" for x, y in vertices) + "]"


def _counts(outcomes: Sequence[Feasibility]) -> str:
    return ", ".join(f"{outcomes.count(outcome)} {outcome.label}" for outcome in Feasibility)


def draw(found: FootholdStudy, file: Path) -> None:
    """Draw one panel for each band of yaw; the same study gives the same file."""
    nb_rows = len(found.regions) // NB_COLUMNS + 1  # the last panel is the legend's
    with mpl.rc_context({"svg.hashsalt": "walk", "svg.fonttype": "none", "font.size": 8}):
        figure = Figure(figsize=(3.3 * NB_COLUMNS, 4.6 * nb_rows), layout="constrained")
        panels = figure.subplots(nb_rows, NB_COLUMNS).ravel()
        for panel, region in zip(panels, found.regions, strict=False):
            _draw_soles(panel, found.robot, region)
            _draw_placements(panel, found, region)
        for panel in panels[len(found.regions) :]:
            panel.set_axis_off()
        handles, labels = panels[0].get_legend_handles_labels()
        panels[-1].legend(handles, labels, loc="center", frameon=False, markerscale=1.6, fontsize=10)
        figure.suptitle(
            f"{len(found.outcomes)} footholds of {found.robot.title}, with the CoM at {found.com_height:g} m"
        )
        figure.savefig(file, metadata={"Date": None} if file.suffix == ".svg" else None, dpi=200)


def _draw_placements(panel: Axes, found: FootholdStudy, region: FootholdRegion) -> None:
    """Placements of a band by their outcomes, and its polygon; seen from above, the robot facing up."""
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
    """Draw the right sole, which stands, and a left one beside it with a yaw of the band."""
    yaw = (region.lowest_yaw + region.highest_yaw) / 2
    feet = (
        (Footstep(Side.RIGHT, np.zeros(2), 0.0), RIGHT_FOOT),
        (Footstep(Side.LEFT, np.mean(region.vertices, axis=0), yaw), LEFT_FOOT),
    )
    for foot, colour in feet:
        outline = sole_vertices(robot.sole, foot)[:, ::-1]
        panel.add_patch(Polygon(outline, facecolor=_hex(colour), alpha=0.25, edgecolor=_hex(colour), zorder=1))


def _hex(colour: Colour) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
