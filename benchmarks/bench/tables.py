"""A table of a report, as text for a terminal and as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

Cell = str | int | float


@dataclass
class Table:
    """A heading, a table under it, and what is to be said of it.

    Attributes:
        title: Heading.
        head: Names of the columns.
        rows: Text as it is; floats with three digits that tell something.
        notes: Sentences below.
    """

    title: str
    head: Sequence[str]
    rows: list[Sequence[Cell]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def text(self) -> str:
        """For a terminal."""
        lines = [tuple(self.head), *(tuple(map(_shown, row)) for row in self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        table = ["  ".join(_padded(cell, width, n) for n, (cell, width) in enumerate(zip(line, widths, strict=True)))
                 for line in lines]  # fmt: skip
        table.insert(1, "  ".join("-" * width for width in widths))
        return "\n".join(["", f"== {self.title}", "", *(line.rstrip() for line in table), "", *self.notes])

    def markdown(self) -> str:
        """For a file."""
        ruler = ["---", *["---:"] * (len(self.head) - 1)]
        lines = [self.head, ruler, *(tuple(map(_shown, row)) for row in self.rows)]
        table = ["| " + " | ".join(line) + " |" for line in lines]
        notes = [f"- {note}" for note in self.notes]
        return "\n".join(["", f"## {self.title}", "", *table, "", *notes])


def _padded(cell: str, width: int, column: int) -> str:
    return cell.ljust(width) if column == 0 else cell.rjust(width)


def _shown(cell: Cell) -> str:
    if isinstance(cell, str):
        return cell
    if isinstance(cell, int):
        return f"{cell:d}"
    return f"{cell:.0f}" if abs(cell) >= 100 else f"{cell:.1f}" if abs(cell) >= 10 else f"{cell:.2f}"
