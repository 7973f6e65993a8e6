"""Lines of coloured text for a terminal of some width: packed, wrapped, and spelled in ASCII where need be."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

Span = tuple[str, str]
"""Text, and the parameters of its ANSI colour ("" for none)."""

Line = list[Span]

GAP = 2
"""Columns between two facts of a line."""

ASCII = str.maketrans(
    {
        "λ": "load",
        "μ": "mu",
        "\N{EN DASH}": "-",
        "\N{MINUS SIGN}": "-",
        "…": "...",
        "·": ".",
        "≤": "<=",
        "≥": ">=",
        "→": "->",
        "°": " deg",
        "█": "#",
        "▒": "=",
    }
)
"""Spelling of the view's own characters; any other becomes "?"."""


def spelled(text: str, *, ascii_only: bool) -> str:
    """Return a text as this terminal can show it."""
    return text.translate(ASCII).encode("ascii", "replace").decode() if ascii_only else text


class Sheet:
    """Lines that grow from above to below, each at most ``width`` columns.

    Args:
        width: Columns.
        ascii_only: The terminal shows ASCII only.

    Attributes:
        width: Columns.
        ascii_only: The terminal shows ASCII only.
        lines: The lines so far.
    """

    def __init__(self, width: int, *, ascii_only: bool) -> None:
        self.width = width
        self.ascii_only = ascii_only
        self.lines: list[Line] = []

    def narrower(self, columns: int) -> Sheet:
        """Return an empty sheet with ``columns`` fewer."""
        return Sheet(self.width - columns, ascii_only=self.ascii_only)

    def facts(self, head: Iterable[Span], facts: Iterable[Span] = (), indent: int = 0) -> None:
        """Add the head and as many facts as fit beside it; the others follow on lines of their own, indented.

        Only a head or a fact that is longer than a line is cut.
        """
        line = self._spelled(head)
        used, empty = _columns(line), not line
        for text, colour in self._spelled(facts):
            if not empty and used + GAP + len(text) > self.width:
                self.lines.append(line)
                line, used, empty = [(" " * indent, "")], indent, True
            gap = 0 if empty else GAP
            line += [(" " * gap, ""), (text, colour)]
            used, empty = used + gap + len(text), False
        self.lines.append(line)

    def remark(self, text: str, colour: str, indent: int = 0) -> None:
        """Add a text that is never cut: after the last line where it fits there, else on lines of its own."""
        shown = spelled(text, ascii_only=self.ascii_only)
        if shown and self.lines and _columns(self.lines[-1]) + GAP + len(shown) <= self.width:
            self.lines[-1] += [(" " * GAP, ""), (shown, colour)]
        else:
            self.paragraph(text, colour, indent)

    def paragraph(self, text: str, colour: str, indent: int = 0) -> None:
        """Add a text that is never cut, on lines of its own; "" adds none."""
        text = spelled(text, ascii_only=self.ascii_only)
        blank = " " * min(indent, self.width // 4)
        if len(blank) + len(text) <= self.width:
            self.lines += [[(blank, ""), (text, colour)]] if text else []
            return
        wrapped = textwrap.wrap(text, max(self.width - len(blank), 1))
        self.lines += [[(blank, ""), (line, colour)] for line in wrapped]

    def beside(self, picture: Sequence[Line], columns: int, text: Sheet) -> None:
        """Add a picture with a text to the right of it.

        Args:
            picture: Its lines, of equal width.
            columns: Their width.
            text: A sheet narrower by ``columns`` and the gap.
        """
        for row in range(max(len(picture), len(text.lines))):
            left = picture[row] if row < len(picture) else [(" " * columns, "")]
            right = [(" " * GAP, ""), *text.lines[row]] if row < len(text.lines) else []
            self.lines.append([*left, *right])

    def _spelled(self, spans: Iterable[Span]) -> Line:
        return [(spelled(text, ascii_only=self.ascii_only), colour) for text, colour in spans]


def paint(line: Line, width: int, *, colour: bool) -> str:
    """Join the spans of a line, cut to ``width`` visible columns, without blanks at its end."""
    painted = ""
    for text, code in line:
        shown = text[:width]
        width -= len(shown)
        painted += f"\x1b[{code}m{shown}\x1b[0m" if colour and code and shown else shown
    return painted.rstrip(" ")


def _columns(line: Line) -> int:
    return sum(len(text) for text, _ in line)
