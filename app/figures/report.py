"""report.md: for each robot the claims, and what decides the lateral speed."""

import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

from app.figures import measures
from app.figures.claims import Claim
from app.figures.walks import Walks

INTRODUCTION = """\
# The paper's claims, and what was measured

Made by `walk figures` together with the figures beside it: the sample motion of section 6 of Herdt et al. 2010,
simulated by each scheme. Every number is of this run; times are of this machine. Where a number is not the paper's,
the line below the table tells why.
"""


def write_report(path: Path, robots: Sequence[tuple[str, Walks, Sequence[Claim]]]) -> None:
    """Write the report.

    Args:
        path: of the file.
        robots: the name, the walks and the claims of each.
    """
    parts = [INTRODUCTION, _circumstances(robots[0][1])]
    for name, walks, claims in robots:
        parts += [f"## {name}\n", _table_of_claims(claims), _reasons(claims), _table_of_variations(walks)]
    path.write_text("\n".join(parts), encoding="utf-8")


def _circumstances(walks: Walks) -> str:
    p = walks.by_scheme["full"].parameters
    return (
        f"A tick lasts {1e3 * p['control_period']:g} ms, T is {p['sampling_period']:g} s, N is {p['horizon_samples']}"
        f" (32 for (31)). walk {version('walk')}, piqp {version('piqp')}, Python {platform.python_version()},"
        f" {platform.machine()}.\n"
    )


def _table_of_claims(claims: Sequence[Claim]) -> str:
    rows = [
        f"| {n} | {claim.what} | {claim.paper} | {claim.measured} | {'yes' if claim.is_met else 'no'} |"
        for n, claim in enumerate(claims, 1)
    ]
    return "\n".join(["| | what | paper | measured | as the paper |", "|---|---|---|---|---|", *rows, ""])


def _reasons(claims: Sequence[Claim]) -> str:
    reasons = [f"- {n}: {claim.why}." for n, claim in enumerate(claims, 1) if not claim.is_met]
    return "\n".join(["Where it differs:", "", *reasons, ""]) if reasons else ""


def _table_of_variations(walks: Walks) -> str:
    """Mean lateral speeds with other foothold regions and weights."""
    rows: list[str] = []
    for name, variation in walks.variations.items():
        y = 100 * np.array(variation.full.parameters["foothold_region"])[:, 1]
        speeds = [abs(measures.lateral_speed(walk)) for walk in (variation.full, variation.mean_velocity)]
        numbers = " | ".join(f"{speed:.3f}" for speed in (measures.lateral_bound(variation.full), *speeds))
        rows.append(f"| {name} | {y.min():.1f} to {y.max():.1f} | {numbers} |")
    asked = abs(measures.lateral_reference(walks.without_push))
    period = walks.variations[next(iter(walks.variations))].full.parameters["control_period"]
    return "\n".join(
        [
            f"What decides the mean lateral speed [m/s], of {asked:g} asked (a tick of {period:g} s, no push):",
            "",
            "| foothold region | feet apart [cm] | placement allows | by (19) | by (31) |",
            "|---|---|---|---|---|",
            *rows,
            "",
        ]
    )
