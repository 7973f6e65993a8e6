"""Draws the newest messages as lines for a terminal, for ``slipctl watch`` and the demo.

Knows no clock, socket or terminal: messages in, text out. An unknown value is shown as "–", never as 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from slipd_client.live_view_parts import (
    FAULT_COLOUR,
    LEVEL_COLOURS,
    NAME_CELLS,
    add_faults,
    add_gripper,
    add_incidents,
    add_recording,
    add_stream,
    bar,
    bounds,
    clock_time,
    either,
    evidence_of,
    friction,
    in_newtons,
    margin,
    place,
    plain,
    quantity,
    reasons_of,
)
from slipd_client.messages import GRIPPER_TOPIC, STATUS_TOPIC
from slipd_client.terminal import Line, Sheet, Terminal, paint

SILENT_AFTER_S = 2.0
"""Twice the period of ``status``: after so long without it, what was shown last is out of date."""

_QUANTITIES = (
    ("normal", "normal_n", "N", 2),
    ("tangential", "tangential_n", "N", 2),
    ("spin", "spin_nm", "N·m", 4),
    ("needs", "grip_needed_n", "N", 1),
)


FORMS = ((True, True), (False, True), (False, False))
"""From the longest to the shortest: whether every stream is drawn with rates and counters, else only those with a
fault, and whether forces of the fingers are, else only level, utilisation and reasons. The first that fits is drawn."""


class LiveView:
    """Keeps the newest message of each topic and draws them."""

    def __init__(self) -> None:
        self._newest: dict[str, dict[str, Any]] = {}

    def update(self, topic: str, body: dict[str, Any]) -> None:
        """Add a message; ``body`` is kept, not copied.

        A message of another run of the daemon replaces all earlier ones, and ``status`` lists the fingers that exist.
        """
        before = next(iter(self._newest.values()), body)
        if body.get("boot") != before.get("boot"):
            self._newest.clear()
        self._newest[topic] = body
        if topic == STATUS_TOPIC and body.get("fingers") is not None:
            exist = ("", *body["fingers"])
            self._newest = {each: kept for each, kept in self._newest.items() if each.partition(".")[2] in exist}
            if body.get("gripper", "not stated") is None:
                self._newest.pop(GRIPPER_TOPIC, None)

    def render(self, terminal: Terminal, silent_s: float = 0.0) -> list[str]:
        """Draw everything, or as much as the terminal has room for.

        Args:
            terminal: What to draw for.
            silent_s: Time since the last message; beyond ``SILENT_AFTER_S`` no level is shown.

        Returns:
            One string per line, without line ends.
        """
        silent_s = silent_s if silent_s > SILENT_AFTER_S else 0.0
        for streams, forces in FORMS:
            lines = self._lines(terminal, silent_s, all_streams=streams, forces=forces)
            if len(lines) <= terminal.lines:
                break
        else:
            note = f"{len(lines) - terminal.lines + 1} more lines do not fit in {_size(terminal)}"
            lines = [*lines[: max(terminal.lines - 1, 0)], [(note, "2")]][: terminal.lines]
        return [paint(line, terminal.columns, colour=terminal.colour) for line in lines]

    def summary(self) -> str:
        """Return every finger in one line, for a log: level, utilisation and normal force."""
        parts = [
            f"{plain(finger)} {_level(body)} {' '.join(margin(body).split())}"
            f" {quantity(body, 'normal_n', 'N' if in_newtons(body) else '', 2)}"
            for finger, body in self._fingers()
        ]
        newest = max((body.get("timestamp") or 0.0 for body in self._newest.values()), default=0.0)
        return f"{clock_time(newest)}  {'  |  '.join(parts) or 'no verdict yet'}"

    def _lines(self, terminal: Terminal, silent_s: float, *, all_streams: bool, forces: bool) -> list[Line]:
        sheet = Sheet(terminal.columns)
        if silent_s:
            sheet.paragraph(f"no message for {silent_s:.1f} s: the following is out of date", FAULT_COLOUR)
        else:
            _add_header(sheet, self._newest.get(STATUS_TOPIC, {}))
        left_out = [] if forces else ["forces"]
        for finger, body in self._fingers():
            _add_finger(sheet, finger, body, silent=silent_s > 0.0, forces=forces)
        if gripper := self._newest.get(GRIPPER_TOPIC) or self._status("gripper"):
            add_gripper(sheet, gripper)
        for key, what in (("run_recording", "of the whole run  "), ("recording", "")):
            add_recording(sheet, self._status(key), what)
        add_incidents(sheet, self._status("incidents"))
        streams = self._status("streams")
        if all_streams:
            for name, stream in streams.items():
                add_stream(sheet, name, stream)
        elif streams:
            well = add_faults(sheet, streams)
            left_out.append(f"{well} streams without a fault" if well else "rates and counters of the streams")
        if left_out:
            sheet.paragraph(f"left out in {_size(terminal)}: {', '.join(left_out)}", "2")
        return sheet.lines

    def _fingers(self) -> list[tuple[str, dict[str, Any]]]:
        """Return each finger with its newest verdict, or else with its entry in ``status``."""
        verdicts = {topic[5:]: body for topic, body in self._newest.items() if topic.startswith("slip.")}
        return sorted((self._status("fingers") | verdicts).items())

    def _status(self, key: str) -> dict[str, Any]:
        return self._newest.get(STATUS_TOPIC, {}).get(key) or {}


def change_line(body: dict[str, Any]) -> str:
    """Return one line for a message of topic ``warning``: the level of a finger has changed."""
    reasons = "; ".join(filter(None, (reasons_of(body), evidence_of(body))))
    change = f"{plain(body.get('previous'))} → {plain(body.get('level'))}"
    line = f"{clock_time(body.get('timestamp') or 0.0)}  {plain(body.get('finger'))} {change}"
    return f"{line}  ({reasons})" if reasons else line


def _level(body: dict[str, Any]) -> str:
    """Return the level of a finger; "unknown" with its reasons, since without them it says nothing."""
    level = plain(body.get("level"))
    return f"{level} ({reasons_of(body)})" if level == "unknown" and reasons_of(body) else level


def _size(terminal: Terminal) -> str:
    return f"{terminal.columns} x {terminal.lines}"


def _add_header(sheet: Sheet, status: dict[str, Any]) -> None:
    facts = [f"up {quantity(status, 'uptime_s', 's', 0)}"]
    if "config_id" in status:  # the reply to a request has none
        facts.append(f"config {plain(status['config_id'])}")
    facts.append(f"lease {either((status.get('lease') or {}).get('held'), 'held', 'free')}")
    facts += [f"object {plain(named)}"] if (named := status.get("object_name")) else []
    sheet.facts([(f"slipd {plain(status.get('version'))}", "1")], [(fact, "") for fact in facts])


def _add_finger(sheet: Sheet, finger: str, body: dict[str, Any], *, silent: bool, forces: bool) -> None:
    """Add one finger; ``body`` is its verdict, or its entry in ``status``, which holds no quantities."""
    level = "unknown" if silent else plain(body.get("level"))
    colour = LEVEL_COLOURS.get(level, "")
    why = "stale" if silent else "  ".join(filter(None, (reasons_of(body), evidence_of(body))))
    head: Line = [(f"{plain(finger):<{NAME_CELLS}}", "1"), (f"{level.upper():<11}", colour)]
    if "tare_busy" in body:
        head.append((f"tare {quantity(body, 'tare_id', '', 0)}", ""))
        facts = [(friction(body), "")]
    else:
        head.append((margin(body), ""))
        facts = [(text, code) for text, code in ((bar(body), colour), (bounds(body), "")) if text]
        facts += [(text, "") for text in _facts(body) if text and forces]
    sheet.facts(head, facts, NAME_CELLS)
    sheet.paragraph(why, colour, NAME_CELLS)


def _facts(body: dict[str, Any]) -> Iterator[str]:
    unit_known = in_newtons(body)
    facts = [
        f"{word} {quantity(body, key, unit if unit_known else '', digits)}" for word, key, unit, digits in _QUANTITIES
    ]
    yield from (*facts[:3], friction(body), *facts[3:])
    for key, name in (("centroid_m", "centroid"), ("pole_m", "pole")):
        yield place(body, key, name)
