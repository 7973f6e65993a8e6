"""Turns the newest messages into lines for a terminal, for ``slipctl watch`` and the demo.

Knows no clock, socket or terminal: messages in, text out. What is not known shows as "–", never as 0.
"""

from __future__ import annotations

import math
from datetime import datetime
from typing import Any

from slipd_client.messages import GRIPPER_TOPIC, HEALTH, STATUS_TOPIC

UNKNOWN = "\N{EN DASH}"
BAR_CELLS = 20
NAME_CELLS = 10
SILENT_AFTER_S = 2.0
"""Twice the period of ``status``: a daemon that has not even sent this tells nothing of now."""

LEVEL_COLOURS = {
    "no_contact": "2",
    "stable": "32",
    "caution": "33",
    "warning": "1;31",
    "slipping": "1;97;41",
    "unknown": "1;35",
}
HEALTH_COLOURS = ("32", "33", "1;31", "1;35")

Span = tuple[str, str]
"""Text, and the parameters of its ANSI colour ("" for none)."""


class View:
    """Keeps the newest message of each topic and draws them."""

    def __init__(self) -> None:
        self._newest: dict[str, dict[str, Any]] = {}

    def update(self, topic: str, body: dict[str, Any]) -> None:
        """Take a message in; ``body`` is kept, not copied."""
        self._newest[topic] = body

    def render(self, width: int, colour: bool, silent_s: float = 0.0) -> list[str]:
        """Draw everything.

        Args:
            width: Columns of the terminal; longer lines are cut.
            colour: Whether to add ANSI colours.
            silent_s: For how long nothing has been heard; beyond ``SILENT_AFTER_S`` no level is shown.

        Returns:
            One string a line, without line ends.
        """
        silent = silent_s > SILENT_AFTER_S
        lines = [self._header(silent_s if silent else 0.0)]
        for finger, body in self._fingers():
            lines += _finger_lines(finger, body, silent)
        if gripper := self._newest.get(GRIPPER_TOPIC) or self._status("gripper"):
            lines.append(_gripper_line(gripper))
        lines += [_stream_line(name, _map(stream)) for name, stream in self._status("streams").items()]
        return [_paint(line, width, colour) for line in lines]

    def summary(self) -> str:
        """Every finger in one line, for a log: level, utilisation and normal force."""
        parts = [
            f"{_text(finger)} {_text(body.get('level'))} λ {_utilisation(body)} {_value(body, 'normal_n', 'N', 2)}"
            for finger, body in self._fingers()
        ]
        return f"{self._clock_time()}  {'  |  '.join(parts) or 'no verdict yet'}"

    def _fingers(self) -> list[tuple[str, dict[str, Any]]]:
        """Each finger with its newest verdict, or with the little that ``status`` tells of it."""
        verdicts = {finger: _map(state) for finger, state in self._status("fingers").items()}
        for topic, body in self._newest.items():
            kind, _, finger = topic.partition(".")
            if kind == "slip":
                verdicts[finger] = body
        return sorted(verdicts.items())

    def _status(self, key: str) -> dict[str, Any]:
        return _map(self._newest.get(STATUS_TOPIC, {}).get(key))

    def _header(self, silent_s: float) -> list[Span]:
        if silent_s:
            return [(f"nothing heard for {silent_s:.1f} s: what follows is old", "1;31")]
        status = self._newest.get(STATUS_TOPIC, {})
        lease = _either(self._status("lease").get("held"), "held", "free")
        facts = f"up {_value(status, 'uptime_s', 's', 0)}  config {_text(status.get('config_id'))}  lease {lease}"
        return [(f"slipd {_text(status.get('version'))}", "1"), (f"  {facts}", "")]

    def _clock_time(self) -> str:
        newest = max((_number(body.get("timestamp")) or 0.0 for body in self._newest.values()), default=0.0)
        return clock_time(newest)


def change_line(body: dict[str, Any]) -> str:
    """One line for a message of topic ``warning``: a finger's level has changed."""
    reasons = _reasons(body)
    change = f"{_text(body.get('previous'))} → {_text(body.get('level'))}"
    return f"{clock_time(_number(body.get('timestamp')) or 0.0)}  {_text(body.get('finger'))} {change}" + (
        f"  ({reasons})" if reasons else ""
    )


def clock_time(timestamp: float) -> str:
    """Local time of day with milliseconds; "–" for 0, which stands for no time, and for times out of range."""
    if not timestamp:
        return UNKNOWN
    try:
        return datetime.fromtimestamp(timestamp).astimezone().strftime("%H:%M:%S.%f")[:-3]
    except (ValueError, OverflowError, OSError):
        return UNKNOWN


def _finger_lines(finger: str, body: dict[str, Any], silent: bool) -> list[list[Span]]:
    level = "unknown" if silent else _text(body.get("level"))
    colour = LEVEL_COLOURS.get(level, "")
    quantities = (
        ("normal", "normal_n", "N", 2),
        ("tangential", "tangential_n", "N", 2),
        ("spin", "spin_nm", "N·m", 4),
        ("mu", "mu", "", 2),
        ("needs", "grip_needed_n", "N", 1),
    )
    facts = "  ".join(f"{word} {_value(body, field, unit, digits)}" for word, field, unit, digits in quantities)
    named: list[Span] = [(f"{_text(finger):<{NAME_CELLS}}", "1"), (f"{level.upper():<11}", colour)]
    first: list[Span] = [
        *named,
        (f"λ {_utilisation(body):>5} ", ""),
        (_bar(body), colour),
        (f"  {facts}", ""),
    ]
    if "tare_busy" in body:  # what ``status`` tells of a finger holds no quantities
        first = [*named, (f"tare {_value(body, 'tare_id', '', 0)}", "")]
    reasons = "stale" if silent else _reasons(body)
    return [first, [(" " * NAME_CELLS + reasons, colour)]] if reasons else [first]


def _gripper_line(body: dict[str, Any]) -> list[Span]:
    width_m = _number(body.get("width_m"))
    width = UNKNOWN if width_m is None else f"{width_m * 1000:.1f} mm"
    force = f"{_value(body, 'force_command_n', 'N', 1)} of at most {_value(body, 'force_limit_n', 'N', 1)}"
    moving = _either(body.get("moving"), "moving", "at rest")
    line: list[Span] = [
        (f"{'gripper':<{NAME_CELLS}}", "1"),
        (f"width {width}  force {force}  {moving}  object {_text(body.get('object'))}", ""),
    ]
    if fault := body.get("fault"):
        line.append((f"  fault {_text(fault)}", "1;31"))
    if latched := body.get("latched_fault"):
        line.append((f"  latched: {_text(latched)}", "1;31"))
    if body.get("echo_ok") is False:
        line.append(("  does not echo the command", "1;31"))
    return line


def _stream_line(name: str, stream: dict[str, Any]) -> list[Span]:
    code = stream.get("health")
    health, colour = UNKNOWN, ""
    if isinstance(code, int) and 0 <= code < len(HEALTH):
        health, colour = HEALTH[code], HEALTH_COLOURS[code]
    rate = f"{_value(stream, 'rate_hz', 'Hz', 0)} of {_value(stream, 'expected_hz', 'Hz', 0)}"
    age_s = _number(stream.get("age_s"))
    age = UNKNOWN if age_s is None else f"{age_s * 1000:.0f} ms"
    counts = "  ".join(f"{word} {_value(stream, word, '', 0)}" for word in ("bad", "lost", "reconnects"))
    message = stream.get("message")
    return [
        (f"{_text(name):<20}", ""),
        (f"{health:<6}", colour),
        (f"{rate}  age {age}  {counts}", ""),
        (f"  {_text(message)}" if message else "", colour),
    ]


def _utilisation(body: dict[str, Any]) -> str:
    """The utilisation, or what bounds it."""
    for field, sign in (("utilisation", ""), ("utilisation_upper", "≤"), ("utilisation_lower", "≥")):
        value = _number(body.get(field))
        if value is not None:
            return f"{sign}{value:.2f}"
    return UNKNOWN


def _bar(body: dict[str, Any]) -> str:
    """Full blocks up to the utilisation, shaded up to its upper bound; empty where neither is known."""
    upper = _cells(body.get("utilisation_upper"))
    sure = _cells(body.get("utilisation"))
    return ("█" * sure + "▒" * (upper - sure)).ljust(BAR_CELLS, "·")


def _cells(value: Any) -> int:
    number = _number(value)
    return 0 if number is None else round(min(max(number, 0.0), 1.0) * BAR_CELLS)


def _reasons(body: dict[str, Any]) -> str:
    reasons = body.get("reasons")
    return ", ".join(_text(reason) for reason in reasons) if isinstance(reasons, list) else ""


def _value(body: dict[str, Any], field: str, unit: str, digits: int) -> str:
    number = _magnitude(body.get(field))
    return UNKNOWN if number is None else f"{number:.{digits}f} {unit}".rstrip()


def _number(value: Any) -> float | None:
    return value if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def _magnitude(value: Any) -> float | None:
    """A number, or the length of a vector of them."""
    if not isinstance(value, list):
        return _number(value)
    numbers = [number for number in map(_number, value) if number is not None]
    return math.hypot(*numbers) if numbers and len(numbers) == len(value) else None


def _either(value: Any, yes: str, no: str) -> str:
    return yes if value is True else no if value is False else UNKNOWN


def _map(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _text(value: Any) -> str:
    """A string of the daemon, without anything that would move the terminal's cursor."""
    if not isinstance(value, str):
        return UNKNOWN
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in value) or UNKNOWN


def _paint(line: list[Span], width: int, colour: bool) -> str:
    """Join the spans, cut to ``width`` visible columns."""
    painted = ""
    for text, code in line:
        shown = text[:width]
        width -= len(shown)
        painted += f"\x1b[{code}m{shown}\x1b[0m" if colour and code and shown else shown
    return painted.rstrip() if not colour else painted
