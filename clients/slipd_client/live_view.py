"""Draws the newest messages as lines for a terminal, for ``slipctl watch`` and the demo.

Knows no clock, socket or terminal: messages in, text out. An unknown value is shown as "–", never as 0.
"""

from __future__ import annotations

import textwrap
from typing import Any

from slipd_client.live_view_format import (
    UNKNOWN,
    as_map,
    bar,
    clock_time,
    either,
    evidence_of,
    friction,
    in_newtons,
    margin,
    number,
    plain,
    quantity,
    reasons_of,
)
from slipd_client.messages import GRIPPER_TOPIC, HEALTH, STATUS_TOPIC, Health

NAME_CELLS = 10
SILENT_AFTER_S = 2.0
"""Twice the period of ``status``: after so long without it, what was shown last is out of date."""

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

Line = list[Span]

UNCUT = 10_000
"""Columns and lines without a terminal: more than is ever drawn."""


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
        if topic == STATUS_TOPIC and isinstance(body.get("fingers"), dict):
            for gone in [known for known in self._newest if _finger_of(known) not in (None, *body["fingers"])]:
                del self._newest[gone]
            if body.get("gripper", "not stated") is None:
                self._newest.pop(GRIPPER_TOPIC, None)

    def render(self, width: int, colour: bool, silent_s: float = 0.0, height: int = UNCUT) -> list[str]:
        """Draw everything.

        Args:
            width: Columns of the terminal: facts are cut there, and reasons continue on the next line.
            colour: Whether to add ANSI colours.
            silent_s: Time since the last message; beyond ``SILENT_AFTER_S`` no level is shown.
            height: Lines of the terminal: streams without a fault are left out first.

        Returns:
            One string per line, without line ends.
        """
        silent = silent_s > SILENT_AFTER_S
        lines = [self._header(silent_s if silent else 0.0)]
        for finger, body in self._fingers():
            lines += _finger_lines(finger, body, silent, width)
        if gripper := self._newest.get(GRIPPER_TOPIC) or self._status("gripper"):
            lines += _gripper_lines(gripper, width)
        for key, what in (("run_recording", "of the whole run  "), ("recording", "")):
            lines += _recording_lines(self._status(key), what, width)
        lines += self._stream_lines(width, height - len(lines))
        return [_paint(line, width, colour) for line in lines[:height]]

    def summary(self) -> str:
        """Return every finger in one line, for a log: level, utilisation and normal force."""
        parts = [
            f"{plain(finger)} {plain(body.get('level'))} {' '.join(margin(body).split())}"
            f" {quantity(body, 'normal_n', 'N' if in_newtons(body) else '', 2)}"
            for finger, body in self._fingers()
        ]
        return f"{self._clock_time()}  {'  |  '.join(parts) or 'no verdict yet'}"

    def _stream_lines(self, width: int, height: int) -> list[Line]:
        """Draw every stream, or only those with a fault if there is no room for the others."""
        streams = {name: as_map(stream) for name, stream in self._status("streams").items()}
        drawn = {name: _stream_lines(name, stream, width) for name, stream in streams.items()}
        if sum(map(len, drawn.values())) <= height:
            return [line for lines in drawn.values() for line in lines]
        ill = [name for name, stream in streams.items() if stream.get("health") != Health.OK or stream.get("message")]
        note = f"{len(streams) - len(ill)} streams without a fault are not shown: the terminal is too small"
        return [line for name in ill for line in drawn[name]] + [[(note, "2")]]

    def _fingers(self) -> list[tuple[str, dict[str, Any]]]:
        """Return each finger with its newest verdict, or else with its entry in ``status``."""
        verdicts = {finger: as_map(state) for finger, state in self._status("fingers").items()}
        for topic, body in self._newest.items():
            kind, _, finger = topic.partition(".")
            if kind == "slip":
                verdicts[finger] = body
        return sorted(verdicts.items())

    def _status(self, key: str) -> dict[str, Any]:
        return as_map(self._newest.get(STATUS_TOPIC, {}).get(key))

    def _header(self, silent_s: float) -> Line:
        if silent_s:
            return [(f"no message for {silent_s:.1f} s: the following is out of date", "1;31")]
        status = self._newest.get(STATUS_TOPIC, {})
        lease = either(self._status("lease").get("held"), "held", "free")
        facts = f"up {quantity(status, 'uptime_s', 's', 0)}  config {plain(status.get('config_id'))}  lease {lease}"
        if named := status.get("object_name"):
            facts += f"  object {plain(named)}"
        return [(f"slipd {plain(status.get('version'))}", "1"), (f"  {facts}", "")]

    def _clock_time(self) -> str:
        newest = max((number(body.get("timestamp")) or 0.0 for body in self._newest.values()), default=0.0)
        return clock_time(newest)


def change_line(body: dict[str, Any]) -> str:
    """Return one line for a message of topic ``warning``: the level of a finger has changed."""
    reasons = "; ".join(part for part in (reasons_of(body), evidence_of(body)) if part)
    change = f"{plain(body.get('previous'))} → {plain(body.get('level'))}"
    return f"{clock_time(number(body.get('timestamp')) or 0.0)}  {plain(body.get('finger'))} {change}" + (
        f"  ({reasons})" if reasons else ""
    )


def _finger_of(topic: str) -> str | None:
    """Return the finger of a topic; None if it has none."""
    _, separator, finger = topic.partition(".")
    return finger if separator else None


def _finger_lines(finger: str, body: dict[str, Any], silent: bool, width: int) -> list[Line]:
    level = "unknown" if silent else plain(body.get("level"))
    colour = LEVEL_COLOURS.get(level, "")
    quantities = (
        ("normal", "normal_n", "N", 2),
        ("tangential", "tangential_n", "N", 2),
        ("spin", "spin_nm", "N·m", 4),
        ("needs", "grip_needed_n", "N", 1),
    )
    newtons = in_newtons(body)
    facts = [
        f"{word} {quantity(body, field, unit if newtons else '', digits)}" for word, field, unit, digits in quantities
    ]
    facts.insert(3, friction(body))
    named: Line = [(f"{plain(finger):<{NAME_CELLS}}", "1"), (f"{level.upper():<11}", colour)]
    first: Line = [
        *named,
        (f"{margin(body)} ", ""),
        (bar(body), colour),
        (f"  {'  '.join(facts)}", ""),
    ]
    if "tare_busy" in body:  # an entry of ``status`` holds no quantities
        first = [*named, (f"tare {quantity(body, 'tare_id', '', 0)}  {friction(body)}", "")]
    why = "stale" if silent else "  ".join(part for part in (reasons_of(body), evidence_of(body)) if part)
    return [first, *_wrapped(why, colour, width)]


def _gripper_lines(body: dict[str, Any], width: int) -> list[Line]:
    width_m = number(body.get("width_m"))
    between = UNKNOWN if width_m is None else f"{width_m * 1000:.1f} mm"
    force = f"{quantity(body, 'force_command_n', 'N', 1)} of at most {quantity(body, 'force_limit_n', 'N', 1)}"
    moving = either(body.get("moving"), "moving", "at rest")
    facts: Line = [
        (f"{'gripper':<{NAME_CELLS}}", "1"),
        (f"width {between}  force {force}  {moving}  object {plain(body.get('object'))}", ""),
    ]
    faults = [f"fault {plain(fault)}"] if (fault := body.get("fault")) else []
    if latched := body.get("latched_fault"):
        faults.append(f"latched: {plain(latched)}")
    if body.get("echo_ok") is False:
        faults.append("does not repeat the command")
    return _with_reason(facts, "  ".join(faults), "1;31", width)


def _recording_lines(recording: dict[str, Any], what: str, width: int) -> list[Line]:
    """Draw a recording in progress, or one that ended by itself; one that was stopped on request is not shown."""
    state = recording.get("state")
    failure = recording.get("failure")
    if recording.get("running") is not True and not failure:
        return []
    word, colour = ("OK", "32") if not failure else ("ENDED", "33") if state == "limited" else ("FAILED", "1;31")
    facts: Line = [(f"{'recording':<20}", "1"), (f"{word:<7}", colour)]
    if failure:  # it contains the path
        return _with_reason(facts, plain(failure), colour, width)
    facts.append((f"{what}{plain(recording.get('path') or recording.get('name'))}", ""))
    lost = f"{quantity(recording, 'lost', '', 0)} entries lost" if recording.get("lost") else ""
    return _with_reason(facts, lost, "33", width)


def _stream_lines(name: str, stream: dict[str, Any], width: int) -> list[Line]:
    code = stream.get("health")
    health, colour = UNKNOWN, ""
    if isinstance(code, int) and 0 <= code < len(HEALTH):
        health, colour = HEALTH[code], HEALTH_COLOURS[code]
    rate = f"{quantity(stream, 'rate_hz', 'Hz', 0)} of {quantity(stream, 'expected_hz', 'Hz', 0)}"
    age_s = number(stream.get("age_s"))
    age = UNKNOWN if age_s is None else f"{age_s * 1000:.0f} ms"
    counts = "  ".join(f"{word} {quantity(stream, word, '', 0)}" for word in ("bad", "lost", "reconnects"))
    message = stream.get("message")
    facts: Line = [
        (f"{plain(name):<20}", ""),
        (f"{health:<7}", colour),
        (f"{rate}  age {age}  {counts}", ""),
    ]
    return _with_reason(facts, plain(message) if message else "", colour, width)


def _with_reason(facts: Line, reason: str, colour: str, width: int) -> list[Line]:
    """Put the reason after the facts if both fit, else on lines of its own; never cut the reason."""
    if not reason:
        return [facts]
    if sum(len(text) for text, _ in facts) + 2 + len(reason) <= width:
        return [[*facts, ("  " + reason, colour)]]
    return [facts, *_wrapped(reason, colour, width)]


def _wrapped(reason: str, colour: str, width: int) -> list[Line]:
    indent = " " * min(NAME_CELLS, width // 4)
    lines = textwrap.wrap(reason, max(width, 1), initial_indent=indent, subsequent_indent=indent)
    return [[(line, colour)] for line in lines]


def _paint(line: Line, width: int, colour: bool) -> str:
    """Join the spans, cut to ``width`` visible columns."""
    painted = ""
    for text, code in line:
        shown = text[:width]
        width -= len(shown)
        painted += f"\x1b[{code}m{shown}\x1b[0m" if colour and code and shown else shown
    return painted.rstrip() if not colour else painted
