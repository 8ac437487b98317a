"""What a foothold study leaves behind: the lines of a robot file, a table of all placements, the picture."""

import csv
from collections.abc import Sequence
from pathlib import Path

from app.footholds.picture import draw
from app.footholds.study import Study
from walkcore.footholds.step_feasibility import Feasibility
from walkcore.footholds.study import common_vertices
from walkcore.values import Matrix


def summary(found: Study) -> str:
    """The lines of a robot file, with where they come from as comments."""
    lines = [
        f"# {found.command}",
        f"# {len(found.outcomes)} placements: {_counts(found.outcomes)}",
        f"# {len(found.steps)} steps between any two new placements inside of the polygons: {_counts(found.steps)}",
        "foothold_regions:   # m, of the left foot in the right foot's frame, by its yaw against it (rad, toes out)",
    ]
    for region in found.regions:
        lines += [
            f"  - yaw: [{region.lowest_yaw:g}, {region.highest_yaw:g}]",
            f"    region: {_corners(region.vertices)}",
        ]
    lines.append(f"# safe at all these yaws: {_corners(common_vertices(found.regions))}")
    return "\n".join(lines) + "\n"


def write(found: Study, folder: Path) -> None:
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
