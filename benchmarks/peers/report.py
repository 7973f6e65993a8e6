"""The page of the comparisons."""

from __future__ import annotations

from collections.abc import Sequence

from peers.comparison import Comparison


def render(comparisons: Sequence[Comparison], measured_on: str) -> str:
    """Return the comparisons as a Markdown page."""
    rows = [
        f"| `{found.device}` | {found.peer} | {found.direction} | {_cell(found.agrees)} | {_cell(found.differs)} "
        f"| {_cell(found.open)} |"
        for found in comparisons
    ]
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
            "In the other direction, `tests/unit/devices/robotiq_2f/test_robotiq_peer.py` runs slipd's session against"
            " the Modbus server of pymodbus. No package exists for the other devices: their tests hold known bytes,"
            " whose source the docstring of the decoder names (`slipd devices`).",
            "",
        )
    )


def _cell(entries: Sequence[str]) -> str:
    return "; ".join(entries).replace("|", "\\|") or "none"
