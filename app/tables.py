"""Rows of text as a table, the first one its head: for a terminal, and in Markdown."""

from collections.abc import Callable, Sequence

Rows = Sequence[Sequence[str]]


def text_table(rows: Rows, align: Callable[[str, int], str] = str.ljust) -> str:
    """Rows as lines, with the columns below each other.

    Args:
        rows: of the table.
        align: pads a cell to a width, in all columns but the first.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ([row[0].ljust(widths[0]), *map(align, row[1:], widths[1:])] for row in rows)
    return "\n".join("  ".join(line).rstrip() for line in lines)


def markdown_table(rows: Rows) -> str:
    """Rows as a table of Markdown, whose cells are what they are: nothing is escaped."""
    head, *body = rows
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *body))
