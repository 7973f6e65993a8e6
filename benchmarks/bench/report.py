"""The report of a benchmark as Markdown: each part with its own head, so that one can be measured again alone."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from bench.tables import Table

_TITLE = "# Measurements\n"
_PART = re.compile(r"^<!-- part: (\w+) -->$", re.MULTILINE)


class Report:
    """A report file; its other parts stay as they are.

    Args:
        path: The file; it may not exist yet.
        order: All parts, in the order of the file.

    Raises:
        ValueError: The file exists and has a part of another name.
    """

    def __init__(self, path: Path, order: Sequence[str]) -> None:
        self._path, self._order = path, order
        _, *found = _PART.split(path.read_text(encoding="utf-8") if path.exists() else "")
        self._parts = dict(zip(found[::2], (text.strip() for text in found[1::2]), strict=True))
        if unknown := set(self._parts) - set(order):
            raise ValueError(f"{path} has the parts {', '.join(sorted(unknown))}, which this program does not measure")

    def put(self, part: str, measured: str, tables: Sequence[Table]) -> None:
        """Write a part, in place of its older measurement.

        Args:
            part: Its name.
            measured: Commit, machine and date of the measurement.
            tables: Its tables.
        """
        texts = [table.markdown().strip() for table in tables]
        self._parts[part] = "\n\n".join((f"{measured}.", *texts))
        parts = [f"\n<!-- part: {name} -->\n\n{self._parts[name]}\n" for name in self._order if name in self._parts]
        self._path.write_text(_TITLE + "".join(parts), encoding="utf-8")
