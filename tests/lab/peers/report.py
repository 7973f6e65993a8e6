"""The page of the comparisons."""

from __future__ import annotations

from collections.abc import Sequence

from peers.comparison import Comparison

from slipd.devices import DEVICES


def render(comparisons: Sequence[Comparison], measured_on: str) -> str:
    """Return the comparisons as a Markdown page."""
    rows = [
        f"| `{found.device}` | {found.peer} | {found.direction} | {_cell(found.agrees)} | {_cell(found.differs)} "
        f"| {_cell(found.open)} |"
        for found in comparisons
    ]
    compared = {found.device for found in comparisons}
    without = ", ".join(f"`{name}`" for name in sorted(DEVICES) if name not in compared and "external" not in name)
    return "\n".join(
        (
            "# Devices beside independent implementations",
            "",
            f"`make peers`. {measured_on}.",
            "",
            "Each row is a program that others wrote, from a package index, on a real pseudo-terminal or socket.",
            "",
            "| device | compared with | direction | agrees | differs | cannot be compared |",
            "| --- | --- | --- | --- | --- | --- |",
            *rows,
            "",
            f"No package exists for {without}. Their tests hold known bytes, each with its source"
            " ([evidence](../devices.md)).",
            "",
        )
    )


def _cell(entries: Sequence[str]) -> str:
    return "; ".join(entries).replace("|", "\\|") or "none"
