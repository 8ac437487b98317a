"""A report as Markdown with its figures beside it, and as one HTML page that holds everything."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from app.formats import StoredRun
from app.report import pictures, tables
from app.report.tables import Rows
from app.tables import markdown_table

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1d2126; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2 { line-height: 1.2; } h2 { margin-top: 2.2rem; }
.table { overflow-x: auto; } table { border-collapse: collapse; font-size: 14px; }
th, td { padding: .25rem .8rem .25rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid #e3e5e8; }
td { font-variant-numeric: tabular-nums; } svg { max-width: 100%; height: auto; }
.broken { color: #b3261e; font-weight: 600; }
"""


@dataclass(frozen=True, slots=True)
class Section:
    """A heading with a sentence, a table, figures, or all of them."""

    title: str
    rows: Rows
    figures: tuple[str, ...] = ()
    """Names of files, without their ending."""
    sentence: str = ""


def write_report(run: StoredRun, out: Path) -> tuple[Path, Path]:
    """Write report.md with its figures, and report.html.

    Returns:
        The two pages.
    """
    out.mkdir(parents=True, exist_ok=True)
    pictures.draw_above(out / "above", run)
    times = _draw_over_time(out, [run], [run.name])
    sections = [
        Section("What was run", tables.facts(run)),
        Section("Expectations", tables.expectation_rows(run)),
        *_twin_section(out, run),
        Section("Walk", [], ("above", *times)),
        Section("Metrics", tables.metric_rows(run)),
        Section("Steady walking", tables.steady_rows(run)),
        Section("Pushes", tables.push_rows(run)),
        Section("Joints: share of the limits of the URDF", tables.joint_rows(run)),
    ]
    return _write(out, "report", run.name, run.description, sections)


def _twin_section(out: Path, run: StoredRun) -> list[Section]:
    """The robot in physics and its ideal twin, where there is one."""
    rows, told = tables.twin_rows(run), str(run.metrics.get("twin_difference") or "")
    if len(rows) == 1:
        return []
    pictures.draw_pair(out / "pair", run)
    pictures.draw_distance(out / "distance", run)
    return [Section("Robot and ideal twin", rows, ("pair", "distance"), f"{told[:1].upper()}{told[1:]}.")]


def write_comparison(runs: Sequence[StoredRun], names: Sequence[str], out: Path) -> tuple[Path, Path]:
    """Write comparison.md with its figures, and comparison.html.

    Args:
        runs: two or more.
        names: of the runs, to tell them apart.
        out: folder, which is made if need be.

    Returns:
        The two pages.
    """
    out.mkdir(parents=True, exist_ok=True)
    pictures.draw_paths(out / "above", runs, names)
    times = _draw_over_time(out, runs, names)
    sections = [
        Section("Metrics", tables.comparison_rows(runs, names)),
        Section("Parameters that differ", tables.changed_parameters(runs, names)),
        Section("Walks", [], ("above", *times)),
    ]
    return _write(out, "comparison", " and ".join(names), "", sections)


def _draw_over_time(out: Path, runs: Sequence[StoredRun], names: Sequence[str]) -> list[str]:
    """Draw the figures over time that the runs have columns for, and return the names of their files."""
    pictures.draw_velocity(out / "forward", runs, names, axis=0)
    pictures.draw_velocity(out / "lateral", runs, names, axis=1)
    pictures.draw_margins(out / "cop-margin", runs, names)
    pictures.draw_capturability(out / "capturability", runs, names)
    drawn = ["forward", "lateral", "cop-margin", "capturability"]
    bodies = [(run, name) for run, name in zip(runs, names, strict=True) if np.isfinite(run["true_cop_x"]).any()]
    if bodies:
        pictures.draw_cop_error(out / "cop-error", [run for run, _ in bodies], [name for _, name in bodies])
        drawn.append("cop-error")
    return drawn


def _write(out: Path, name: str, title: str, text: str, sections: Sequence[Section]) -> tuple[Path, Path]:
    shown = [section for section in sections if len(section.rows) > 1 or section.figures]
    markdown, page = out / f"{name}.md", out / f"{name}.html"
    markdown.write_text(_markdown(title, text, shown), encoding="utf-8")
    page.write_text(_html(out, title, text, shown), encoding="utf-8")
    return markdown, page


def _markdown(title: str, text: str, sections: Sequence[Section]) -> str:
    parts = [f"# {_plain(title)}", _plain(text)]
    for section in sections:
        parts += [f"## {section.title}", _plain(section.sentence)]
        if section.rows:
            parts.append(markdown_table([[_plain(cell).replace("|", "\\|") for cell in row] for row in section.rows]))
        parts += [f"![{figure}]({figure}.svg)" for figure in section.figures]
    return "\n\n".join(part for part in parts if part) + "\n"


def _plain(text: str) -> str:
    """Text from outside as one line of Markdown that holds neither HTML nor links of its own."""
    plain = escape(" ".join(text.split()), quote=False).replace("\\", "\\\\")
    return plain.replace("`", "\\`").replace("](", "]\\(")


def _html(out: Path, title: str, text: str, sections: Sequence[Section]) -> str:
    parts = [f"<h1>{escape(title)}</h1>", f"<p>{escape(text)}</p>" if text else ""]
    for section in sections:
        parts.append(f"<h2>{escape(section.title)}</h2>")
        parts += [f"<p>{escape(section.sentence)}</p>"] if section.sentence else []
        if section.rows:
            parts.append(_html_table(section.rows))
        parts += [f"<figure>{embedded_figure(out / f'{figure}.svg', figure)}</figure>" for figure in section.figures]
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{escape(title)}</title>'
    body = "\n".join(parts)
    return f'<!doctype html>\n<html lang="en"><head>{head}<style>{STYLE}</style></head><body>\n{body}\n</body></html>\n'


def embedded_figure(path: Path, prefix: str) -> str:
    """A figure for a page: without its prologue, and with ids that no other figure has."""
    drawing = path.read_text(encoding="utf-8")
    drawing = drawing[drawing.index("<svg") :]
    return (
        drawing.replace(' id="', f' id="{prefix}-')
        .replace("url(#", f"url(#{prefix}-")
        .replace('href="#', f'href="#{prefix}-')
    )


def _html_table(rows: Rows) -> str:
    head, *body = rows
    lines = [f"<tr>{''.join(f'<th>{escape(cell)}</th>' for cell in head)}</tr>"] if any(head) else []
    for row in body:
        cells = (f'<td class="broken">{cell}</td>' if cell == "BROKEN" else f"<td>{escape(cell)}</td>" for cell in row)
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return f'<div class="table"><table>{"".join(lines)}</table></div>'
