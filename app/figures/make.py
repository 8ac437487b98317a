"""Figures 1 to 9 of the paper for each robot, pushes on all methods, and report.md beside them.

The report has the claims, what decides the lateral speed, and what each method survives.
"""

import platform
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

from app.figures import drawing, measures
from app.figures.claims import Claim, claims
from app.figures.methods import draw_methods, methods_sweep, table_of_methods, walk_methods
from app.figures.walks import Walks, sample_motion, sample_motions, simulate, solve_times
from app.tables import markdown_table

TITLES = {
    "speed_only": "QP (17): speed only",
    "speed_and_jerk": "QP (19), γ = 0: speed and jerk",
    "full": "QP (19): speed, jerk and CoP",
    "mean_velocity": "QP (31): mean speed over two steps",
}
INTRODUCTION = """\
# The paper's claims, and what was measured

Made by `walk figures` together with the figures beside it: the sample motion of section 6 of Herdt et al. 2010,
simulated by each scheme. Every number is of this run; times are of this machine. Where a number is not the paper's,
the line below the table tells why.
"""


def make_figures(
    out: Path,
    robots: tuple[str, ...],
    formats: tuple[str, ...],
    control_period: float,
    report: Callable[[str], None] = lambda _: None,
) -> None:
    """Simulate, draw and measure.

    Args:
        out: folder for a folder of figures of each robot and for report.md.
        robots: names of robots whose sample motion ships; all of them where none is named.
        formats: endings of the figures' files: svg, pdf, png.
        control_period: of the sample motions [s].
        report: called with a line about what has been done.

    Raises:
        WalkError: if the period does not fit the gait's grid, or a robot has no sample motion.
        OSError: if the folder cannot be written to.
    """
    names = robots or tuple(sample_motions())
    for robot in names:  # refused before anything is simulated
        sample_motion(robot, control_period)
    out.mkdir(parents=True, exist_ok=True)
    parts: list[str] = []
    for robot in names:
        walks = simulate(robot, control_period)
        report(f"{robot}: walked {len(walks.by_scheme)} sample motions and {2 * len(walks.variations)} variations")
        found = claims(walks, solve_times(robot))
        folder = out / robot
        folder.mkdir(exist_ok=True)
        draw_figures(folder, walks, formats)
        methods = walk_methods(out / f"{robot}-methods", methods_sweep(robot))
        title = f"All methods on the same pushes · {walks.robot.title}, in place"
        draw_methods(folder / "methods", formats, title, methods)
        report(f"{robot}: drawn into {folder}")
        parts += [] if parts else [INTRODUCTION, _circumstances(walks)]
        parts += [f"## {walks.robot.title}\n", _table_of_claims(found), _reasons(found)]
        parts += [_table_of_variations(walks), table_of_methods(methods)]
    (out / "report.md").write_text("\n".join(parts), encoding="utf-8")
    report(f"claims and measurements written to {out / 'report.md'}")


def draw_figures(folder: Path, walks: Walks, formats: tuple[str, ...]) -> None:
    """All figures of one robot."""
    name, by_scheme = walks.robot.title, walks.by_scheme
    previewing_two_steps = [by_scheme[scheme] for scheme in ("speed_only", "speed_and_jerk", "full")]
    forward = drawing.speed_limits(previewing_two_steps, "x")
    lateral = drawing.speed_limits([by_scheme["full"], by_scheme["mean_velocity"]], "y")  # to be compared by eye

    for number, scheme in ((1, "speed_only"), (3, "speed_and_jerk"), (5, "full")):
        above, over_time = (f"Fig. {n} · {name} · {TITLES[scheme]}" for n in (number, number + 1))
        drawing.draw_from_above(folder / f"fig{number}", formats, above, by_scheme[scheme])
        drawing.draw_speed(folder / f"fig{number + 1}", formats, over_time, by_scheme[scheme], "x", forward)
    title = f"Fig. 7 · {name} · reaction to a step of the reference"
    drawing.draw_reaction(folder / "fig7", formats, title, by_scheme["full"], walks.analytic)
    for number, scheme in ((8, "full"), (9, "mean_velocity")):
        title, walk = f"Fig. {number} · {name} · {TITLES[scheme]}", by_scheme[scheme]
        means = measures.mean_over_horizon(walk, "com_vy")
        drawing.draw_speed(folder / f"fig{number}", formats, title, walk, "y", lateral, means)
    title = f"A push that calls for a step · {name} · {TITLES['full']}"
    drawing.draw_from_above(folder / "hard-push", formats, title, walks.hard_push)
    if walks.filtered is not None:
        title = f"{name} · from the model's CoP to the true one"
        drawing.draw_true_cop(folder / "true-cop", formats, title, by_scheme["full"], walks.filtered)


def _circumstances(walks: Walks) -> str:
    p = walks.by_scheme["full"].parameters
    return (
        f"A tick lasts {1e3 * p['control_period']:g} ms, T is {p['sampling_period']:g} s, N is {p['horizon_samples']}"
        f" (32 for (31)). walk {version('walk')}, piqp {version('piqp')}, Python {platform.python_version()},"
        f" {platform.machine()}.\n"
    )


def _table_of_claims(claims: Sequence[Claim]) -> str:
    head = ["", "what", "paper", "measured", "as the paper"]
    rows = [[str(n), c.what, c.paper, c.measured, "yes" if c.is_met else "no"] for n, c in enumerate(claims, 1)]
    return markdown_table([head, *rows]) + "\n"


def _reasons(claims: Sequence[Claim]) -> str:
    reasons = [f"- {n}: {claim.why}." for n, claim in enumerate(claims, 1) if not claim.is_met]
    return "\n".join(["Where it differs:", "", *reasons, ""]) if reasons else ""


def _table_of_variations(walks: Walks) -> str:
    """Mean lateral speeds with other foothold regions and weights."""
    rows = [["foothold region", "feet apart [cm]", "placement allows", "by (19)", "by (31)"]]
    for name, variation in walks.variations.items():
        y = 100 * np.array(variation.full.parameters["foothold_region"])[:, 1]
        speeds = [abs(measures.lateral_speed(walk)) for walk in (variation.full, variation.mean_velocity)]
        numbers = [f"{speed:.3f}" for speed in (measures.lateral_bound(variation.full), *speeds)]
        rows.append([name, f"{y.min():.1f} to {y.max():.1f}", *numbers])
    reference = abs(measures.lateral_reference(walks.without_push))
    period = walks.variations[next(iter(walks.variations))].full.parameters["control_period"]
    title = f"What decides the mean lateral speed [m/s], reference {reference:g} (tick {period:g} s, no push):"
    return f"{title}\n\n{markdown_table(rows)}\n"
