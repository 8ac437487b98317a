"""The paper's claims, each beside what was measured, and why it differs where it does."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from app.figures import measures
from app.figures.walks import AS_SHIPPED, SPREAD, SPREAD_HEAVY, TOUCH, SolveTimes, Walks
from walkcore import Recording
from walkcore.analysis.columns import cop_error, ticks_relaxed
from walkcore.analysis.push_recovery import PushRecovery

LABELS = {"speed_only": "(17)", "speed_and_jerk": "(19), γ = 0", "full": "(19)", "mean_velocity": "(31)"}
FASTER = 0.6  # of the time that another scheme takes: "nearly twice as fast"
SAME = 0.05  # relative difference below which a number is the paper's
MARGIN = 0.03  # [m]
MARGIN_TOLERANCE = 1e-6  # [m]
SOLVE_TIME = 1e-3  # [s]


@dataclass(frozen=True, slots=True)
class Claim:
    """One row of the report."""

    what: str
    paper: str
    measured: str
    is_met: bool
    why: str
    """Explanation of a difference."""


def claims(walks: Walks, times: SolveTimes) -> list[Claim]:
    """All claims of section 6 that a robot's walks can be held to."""
    found = [
        *_margins(walks),
        *_solve_times(times),
        _reaction(walks),
        _tracking(walks),
        _smoothness(walks),
        _cop_under_feet(walks),
        _overshoot(walks),
        _lateral_speed(walks),
        _lateral_mean_velocity(walks),
        _sway(walks),
        _sensitivity(walks),
        *_pushes(walks),
    ]
    if walks.filtered is not None:
        found += [_true_cop("plain", walks.by_scheme["full"]), _true_cop("with the dynamic filter", walks.filtered)]
    return found


def _margins(walks: Walks) -> Iterator[Claim]:
    for scheme, walk in walks.by_scheme.items():
        margin = float(measures.margins_at_samples(walk).min())
        between = float(measures.margins_in_single_support(walk).min())
        nb_relaxed = ticks_relaxed(walk)
        yield Claim(
            f"CoP inside the sole, least at the samples, {LABELS[scheme]}",
            "3 cm",
            f"{100 * margin:.2f} cm ({100 * between:.2f} between the samples; margin given up at {nb_relaxed} ticks)",
            margin > MARGIN - MARGIN_TOLERANCE,
            f"at {nb_relaxed} ticks the scheme's own QP had no solution or led to a fall, and the margin, which is"
            f" there for that, was given up down to {100 * margin:.2f} cm",
        )


def _solve_times(times: SolveTimes) -> Iterator[Claim]:
    (median, p95, most), longer = np.percentile(times.full, (50, 95, 100)), float(np.median(times.mean_velocity))
    yield Claim(
        "Assembling and solving (19), median",
        "< 1 ms",
        f"{1e3 * median:.2f} ms (p95 {1e3 * p95:.2f}, max {1e3 * most:.2f})",
        median < SOLVE_TIME,
        "it is measured on this machine with whatever else it was doing, and in Python: the geometry of the supports,"
        " the check that the plan can be caught, and the solver's cold start count too",
    )
    yield Claim(
        "The same for (31), four steps ahead",
        "“much longer”",
        f"{1e3 * longer:.2f} ms, {longer / median:.1f} times as long",
        longer > median,
        "the fixed costs of a QP outweigh its size",
    )


def _reaction(walks: Walks) -> Claim:
    walk = walks.by_scheme["full"]
    start = measures.moments(walk).start
    reach, nearly, half = (measures.time_to_reach(walk, start, fraction) for fraction in (1.0, 0.9, 0.5))
    half_by_11 = measures.time_to_reach(walks.analytic, start, 0.5)
    step = float(walk.parameters["step_duration"])
    return Claim(
        "Reaction to a step of the reference (Fig. 7): until 0.3 m/s is reached",
        "within about a step, nearly twice as fast as [11]",
        f"{reach:.3f} s ({nearly:.3f} to 90 %), a step lasts {step:g} s; to half of it {half:.3f} s, by [11]"
        f" {half_by_11:.3f} s",
        reach <= step and half < FASTER * half_by_11,
        "the first foothold can be no further ahead than its region reaches",
    )


def _tracking(walks: Walks) -> Claim:
    error = measures.speed_ripple(walks.by_scheme["full"])
    reference = float(walks.by_scheme["full"]["reference_vx"].max())
    return Claim(
        "Forward speed by (19), once steady: rms error",
        "converges “nearly perfectly”",
        f"{100 * error:.2f} cm/s of {reference:g} m/s",
        error < SAME * reference,
        "the CoP cannot go far enough under the feet",
    )


def _smoothness(walks: Walks) -> Claim:
    rough, smooth = walks.by_scheme["speed_only"], walks.by_scheme["speed_and_jerk"]
    jitters = [1e3 * measures.forward_jitter(walk) for walk in (rough, smooth)]
    paths = [measures.cop_path(walk) for walk in (rough, smooth)]
    return Claim(
        "Steady lateral walk by (17) and by (19), γ = 0: rms forward speed; path of the CoP over that of the CoM",
        "“messy”, the speed oscillates; the jerk term smoothens both",
        f"{jitters[0]:.2f} and {jitters[1]:.2f} mm/s; {paths[0]:.1f} and {paths[1]:.1f}",
        jitters[1] < (1.0 - SAME) * jitters[0] and paths[1] < (1.0 - SAME) * paths[0],
        "(17) leaves much undecided, and an interior-point solver takes the middle of what is left",
    )


def _cop_under_feet(walks: Walks) -> Claim:
    ahead = [100 * measures.cop_ahead_of_foot(walks.by_scheme[scheme]) for scheme in ("speed_and_jerk", "full")]
    return Claim(
        "CoP in steady lateral walk, ahead of the foot's middle: γ = 0, γ = 1e-6",
        "at the front of the feet, then centred",
        f"{ahead[0]:.2f} cm, {ahead[1]:.2f} cm",
        ahead[0] > 1.0 and abs(ahead[1]) < 1.0,
        "with γ = 0 the objective does not say where along the foot the CoP is: an active-set solver, as the paper's,"
        " ends at an edge of the equally good choices, the interior-point solver here in their middle, which is what"
        " γ asks for",
    )


def _overshoot(walks: Walks) -> Claim:
    full = walks.by_scheme["full"]
    landing = np.flatnonzero(np.diff(full["support_side"]) != 0)[0]  # the last tick before the first touchdown
    behind = 100 * float((full["com_x"] - full["cop_x"])[landing])
    over: list[float] = []
    for scheme in ("speed_and_jerk", "full"):
        walk = walks.by_scheme[scheme]
        when = measures.moments(walk)
        over.append(measures.highest_speed(walk, when.forward, when.stop) - float(walk["reference_vx"].max()))
    return Claim(
        "Overshoot of the forward speed after the lateral walk: γ = 0, γ = 1e-6",
        "a delay and an overshoot, then fixed",
        f"{100 * over[0]:.1f} cm/s, {100 * over[1]:.1f} cm/s",
        over[1] < (1.0 - SAME) * over[0],
        "without γ the CoP is already centred here (row above), so γ has nothing to fix; what both have is there after"
        f" each start: before its first touchdown the CoM is {behind:.1f} cm ahead of a CoP that has reached the front"
        " of the sole, so it speeds up until the other foot lands",
    )


def _lateral_speed(walks: Walks) -> Claim:
    walk, varied = walks.by_scheme["full"], walks.variations
    reference, speed = abs(measures.lateral_reference(walk)), abs(measures.lateral_speed(walk))
    shipped, spread, touch = (abs(measures.lateral_speed(varied[v].full)) for v in (AS_SHIPPED, SPREAD, TOUCH))
    return Claim(
        "Mean lateral speed by (19), of the reference",
        "about 2/3",
        f"{speed:.3f} of {reference:g} m/s: {speed / reference:.2f}",
        abs(speed / reference - 2 / 3) < SAME,
        f"how near the feet may come decides, which the paper does not tell: at its period ({shipped:.3f} m/s) a region"
        f" that reaches further out gives {spread:.3f} m/s, one in which the soles may touch {touch:.3f}",
    )


def _lateral_mean_velocity(walks: Walks) -> Claim:
    walk, varied = walks.by_scheme["mean_velocity"], walks.variations
    reference, speed = abs(measures.lateral_reference(walk)), abs(measures.lateral_speed(walk))
    spread, heavy = (abs(measures.lateral_speed(varied[v].mean_velocity)) for v in (SPREAD, SPREAD_HEAVY))
    bound, wider = measures.lateral_bound(walk), measures.lateral_bound(varied[SPREAD].full)
    return Claim(
        "Mean lateral speed by (31)",
        "“corresponds to the reference speed”",
        f"{speed:.3f} of {reference:g} m/s: {speed / reference:.2f}; placement allows {bound:.3f}",
        abs(speed / reference - 1.0) < SAME,
        f"two steps move the feet by what the foothold region is wide, {bound:.3f} m/s at most; with a region that"
        f" allows {wider:.3f} it is {spread:.3f} m/s, and {heavy:.3f} where the jerk counts for less",
    )


def _sway(walks: Walks) -> Claim:
    sways = [measures.lateral_sway(walks.by_scheme[scheme]) for scheme in ("full", "mean_velocity")]
    return Claim(
        "Lateral sway of the speed, peak to peak: (19), (31)",
        "stronger by (31)",
        f"{sways[0]:.2f} m/s, {sways[1]:.2f} m/s",
        sways[1] > sways[0],
        "the foothold region leaves no room for it",
    )


def _sensitivity(walks: Walks) -> Claim:
    two, four = (ticks_relaxed(walks.by_scheme[scheme]) for scheme in ("full", "mean_velocity"))
    return Claim(
        "Ticks at which the same push takes some of the margin: (19), (31)",
        "(31) may be more sensitive to perturbations",
        f"{two}, {four}",
        four > two,
        "the push is too small to tell",
    )


def _pushes(walks: Walks) -> Iterator[Claim]:
    for name, walk in (("of the sample motion", walks.by_scheme["full"]), ("that calls for a step", walks.hard_push)):
        found = measures.push_effect(walk, walks.without_push)
        when = measures.moments(walk)
        step = round((found.free_touchdown - when.start) / float(walk.parameters["step_duration"]))
        yield Claim(
            f"A push to the left {name}, {measures.velocity_of_push(walk):.2f} m/s",
            "the left foot moves to the left at the end of step 4, until then the robot drifts to the left",
            f"left foot lands {abs(100 * found.free_step):.1f} cm further left at the end of step {step};"
            f" {_recovered(found.recovery)}, {100 * found.drift:.1f} cm beside the walk without the push; margin given"
            f" up at {ticks_relaxed(walk)} ticks",
            found.free_step > MARGIN and found.recovery.time is not None,
            "the paper does not tell how strong its push is; this one the CoP takes within the sole by itself, and the"
            " feet land where they would have"
            if found.free_step < MARGIN
            else f"the robot fell: {walk.reason}",
        )


def _recovered(recovery: PushRecovery) -> str:
    if recovery.time is None:
        return "the walk does not repeat itself again"
    return f"the walk repeats itself after {recovery.time:.2f} s, steps: {recovery.steps}"


def _true_cop(name: str, walk: Recording) -> Claim:
    error = cop_error(walk)
    distance = np.hypot(*error.T)
    median, p95, most = 100 * np.nanpercentile(distance, (50, 95, 100))
    along, across = 100 * np.nanpercentile(np.abs(error), 95, axis=0)
    share = np.nanmean(distance < measures.USUAL_COP_ERROR)
    worst = float(walk["t"][np.nanargmax(distance)])
    return Claim(
        f"From the model's CoP to the true one, (19), {name}",
        "usually less than 2 cm",
        f"median {median:.2f}, p95 {p95:.2f}, max {most:.1f} cm (at {worst:.2f} s); below 2 cm {100 * share:.0f} % of"
        " the time",
        p95 < 100 * measures.USUAL_COP_ERROR,
        f"the model (5)-(6) has no limbs: p95 is {along:.1f} cm along x, from legs that swing to and fro, and"
        f" {across:.1f} cm along y",
    )
