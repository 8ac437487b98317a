"""Which figure shows what: Fig. 1 to 9 of the paper for each robot, and the report beside them."""

from collections.abc import Callable
from pathlib import Path

from app.figures import drawing, measures
from app.figures.claims import claims
from app.figures.report import write_report
from app.figures.solve_time import SolveTimes, solve_times
from app.figures.walks import Walks, simulate

TITLES = {
    "speed_only": "QP (17): speed only",
    "speed_and_jerk": "QP (19), γ = 0: speed and jerk",
    "full": "QP (19): speed, jerk and CoP",
    "mean_velocity": "QP (31): mean speed over two steps",
}
NAMES = {"hrp2": "HRP-2", "talos": "Talos"}


def make_figures(
    out: Path,
    robots: tuple[str, ...],
    formats: tuple[str, ...],
    control_period: float,
    tell: Callable[[str], None] = lambda _: None,
) -> None:
    """Simulate, draw and measure.

    Args:
        out: folder for a folder of figures of each robot and for report.md.
        robots: names of those whose sample motion ships.
        formats: endings of the figures' files: svg, pdf, png.
        control_period: of the sample motions [s].
        tell: is told what has been done.

    Raises:
        WalkError: if the period does not fit the gait's grid.
        OSError: if the folder cannot be written to.
    """
    out.mkdir(parents=True, exist_ok=True)
    walked: list[tuple[Walks, SolveTimes]] = []
    for robot in robots:
        walks = simulate(robot, control_period)
        tell(f"{robot}: walked {len(walks.by_scheme)} sample motions and {2 * len(walks.variations)} variations")
        walked.append((walks, solve_times(robot)))
        folder = out / robot
        folder.mkdir(exist_ok=True)
        draw_figures(folder, walks, formats)
        tell(f"{robot}: drawn into {folder}")
    write_report(out / "report.md", [(NAMES[w.robot.name], w, claims(w, times)) for w, times in walked])
    tell(f"claims and measurements written to {out / 'report.md'}")


def draw_figures(folder: Path, walks: Walks, formats: tuple[str, ...]) -> None:
    """All figures of one robot."""
    name, by_scheme = NAMES[walks.robot.name], walks.by_scheme
    previewing_two_steps = [by_scheme[scheme] for scheme in ("speed_only", "speed_and_jerk", "full")]
    forward = drawing.speed_limits(previewing_two_steps, "x")
    lateral = drawing.speed_limits([by_scheme["full"], by_scheme["mean_velocity"]], "y")  # to be compared by eye

    for number, scheme in ((1, "speed_only"), (3, "speed_and_jerk"), (5, "full")):
        above, over_time = (f"Fig. {n} · {name} · {TITLES[scheme]}" for n in (number, number + 1))
        drawing.draw_from_above(folder / f"fig{number}", formats, above, by_scheme[scheme])
        drawing.draw_speed(folder / f"fig{number + 1}", formats, over_time, by_scheme[scheme], "x", forward)
    title = f"Fig. 7, red curve · {name} · reaction to a step of the reference"
    drawing.draw_reaction(folder / "fig7", formats, title, by_scheme["full"])
    for number, scheme in ((8, "full"), (9, "mean_velocity")):
        title, walk = f"Fig. {number} · {name} · {TITLES[scheme]}", by_scheme[scheme]
        means = measures.mean_over_horizon(walk, "com_vy")
        drawing.draw_speed(folder / f"fig{number}", formats, title, walk, "y", lateral, means)
    title = f"A push that calls for a step · {name} · {TITLES['full']}"
    drawing.draw_from_above(folder / "hard-push", formats, title, walks.hard_push)
    if walks.filtered is not None:
        title = f"{name} · from the model's CoP to the true one"
        drawing.draw_true_cop(folder / "true-cop", formats, title, by_scheme["full"], walks.filtered)
