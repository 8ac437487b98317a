"""A bench as text."""

from collections.abc import Iterable, Sequence

from app.bench.bench import Bench
from app.bench.durations import Durations


def table(bench: Bench) -> str:
    """For a terminal."""
    return "\n\n".join([_stages(bench), _solvers(bench), _paces(bench)]) + "\n"


def _stages(bench: Bench) -> str:
    rows = [(stage, *_numbers(duration)) for stage, duration in bench.stages.items()]
    rows += [("whole tick", *_numbers(bench.tick))]
    rows += [
        ("assemble + solve *", *_numbers(bench.assemble_and_solve)),
        ("the solver itself *", *_numbers(bench.solver_itself)),
        ("around the solver *", *_numbers(bench.around_solver)),
    ]
    note = "* of the point mass, the check where the solution leads included"
    return _columns(("stage [us]", "median", "p99", "max"), rows) + f"\n{note}"


def _solvers(bench: Bench) -> str:
    head = ("solver [us]", "median", "p99", "max", "ratio", "foothold error p95 [mm]", "max [mm]")
    rows = [
        (name, *_numbers(r.duration), f"{r.ratio:.2f}", f"{r.foothold_error_p95:.4f}", f"{r.foothold_error_max:.4f}")
        for name, r in bench.solvers.items()
    ]
    return _columns(head, rows)


def _paces(bench: Bench) -> str:
    rows = [
        ("with the body" if p.has_body else "point mass", f"{1e3 * p.control_period:g}", f"{p.real_time_factor:.1f}")
        for p in bench.paces
    ]
    return _columns((bench.scenario, "period [ms]", "times real time"), rows)


def _numbers(duration: Durations) -> tuple[str, ...]:
    return tuple(f"{value:.0f}" for value in (duration.median, duration.p99, duration.max))


def _columns(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, *rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join([line[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(line[1:], widths[1:], strict=True))])
        for line in lines
    )
