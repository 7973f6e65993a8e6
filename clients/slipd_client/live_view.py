"""Draws the newest messages, and what needs a repair, as lines: for ``slipctl watch``, ``slipctl status`` and the demo.

Knows no clock, socket or terminal: messages in, text out. Every value is of its field's kind, or None, as a subscriber
checks; one that is not known is shown as "–", never as 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from slipd_client.messages import GRIPPER_TOPIC, HEALTH, STATUS_TOPIC, Health
from slipd_client.messages.names import DAEMON_LATE
from slipd_client.repairs import DOCUMENT, repairs
from slipd_client.terminal import UNKNOWN, Line, Sheet, Terminal, clock_time, paint, plain

SILENT_AFTER_S = 2.0
"""Twice the period of ``status``: after so long without it, what was shown last is out of date."""

BAR_CELLS = 20
NAME_CELLS = 10

LEVEL_COLOURS = {
    "no_contact": "2",
    "stable": "32",
    "caution": "33",
    "warning": "1;31",
    "slipping": "1;97;41",
    "unknown": "1;35",
}
HEALTH_COLOURS = ("32", "33", "1;31", "1;35")
SEVERITY_COLOURS = {"error": HEALTH_COLOURS[Health.ERROR], "warning": HEALTH_COLOURS[Health.WARN]}

_QUANTITIES = (
    ("normal", "normal_n", "N", 2),
    ("tangential", "tangential_n", "N", 2),
    ("spin", "spin_nm", "N·m", 4),
    ("needs", "grip_needed_n", "N", 1),
)

FORMS: tuple[tuple[str, ...], ...] = ((), ("streams",), ("streams", "forces"))
"""What is left out, from the longest form to the shortest: rates and counters of the streams, then the forces of the
fingers. The first that fits is drawn."""


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
        """Draw everything, or as much as the terminal has room for, and return the lines.

        Args:
            terminal: What to draw for.
            silent_s: Time since the last message; beyond ``SILENT_AFTER_S`` no level is shown.
        """
        silent_s = silent_s if silent_s > SILENT_AFTER_S else 0.0
        size = f"{terminal.columns} x {terminal.lines}"
        for left_out in FORMS:
            lines = self._lines(terminal.columns, silent_s, left_out)
            if left_out:
                lines.append([(f"left out in {size}: {', '.join(left_out)}", "2")])
            if len(lines) <= terminal.lines:
                break
        else:
            note = f"{len(lines) - terminal.lines + 1} more lines do not fit in {size}"
            lines = [*lines[: max(terminal.lines - 1, 0)], [(note, "2")]][: terminal.lines]
        return [paint(line, terminal.columns, colour=terminal.colour) for line in lines]

    def summary(self) -> str:
        """Return every finger in one line, for a log: level, utilisation and normal force."""
        parts = [
            f"{plain(finger)} {_level(body)} {' '.join(_margin(body).split())}"
            f" {_quantity(body, 'normal_n', 'N' if _in_newtons(body) else '', 2)}"
            for finger, body in self._fingers()
        ]
        newest = max((body.get("timestamp") or 0.0 for body in self._newest.values()), default=0.0)
        return f"{clock_time(newest)}  {'  |  '.join(parts) or 'no verdict yet'}"

    def _lines(self, columns: int, silent_s: float, left_out: tuple[str, ...]) -> list[Line]:
        sheet, status = Sheet(columns), self._newest.get(STATUS_TOPIC, {})
        if silent_s:
            text = f"no message for {silent_s:.1f} s: the following is out of date"
            sheet.paragraph(text, SEVERITY_COLOURS["error"])
        else:
            _add_header(sheet, status)
        for finger, body in self._fingers():
            _add_finger(sheet, finger, body, silent=silent_s > 0.0, forces="forces" not in left_out)
        if gripper := self._newest.get(GRIPPER_TOPIC) or status.get("gripper"):
            _add_gripper(sheet, gripper)
        for key, what in (("run_recording", "of the whole run  "), ("recording", "")):
            _add_recording(sheet, status.get(key) or {}, what)
        if status:
            _add_repairs(sheet, status)
        if "streams" not in left_out:
            for name, stream in (status.get("streams") or {}).items():
                _add_stream(sheet, name, stream)
        return sheet.lines

    def _fingers(self) -> list[tuple[str, dict[str, Any]]]:
        """Return each finger with its newest verdict, or else with its entry in ``status``."""
        verdicts = {topic[5:]: body for topic, body in self._newest.items() if topic.startswith("slip.")}
        return sorted(((self._newest.get(STATUS_TOPIC, {}).get("fingers") or {}) | verdicts).items())


def change_line(body: dict[str, Any]) -> str:
    """Return one line for a message of topic ``warning``: the level of a finger has changed."""
    reasons = change_reasons(body)
    change = f"{plain(body.get('previous'))} → {plain(body.get('level'))}"
    line = f"{clock_time(body.get('timestamp') or 0.0)}  {plain(body.get('finger'))} {change}"
    return f"{line}  ({reasons})" if reasons else line


def change_reasons(body: dict[str, Any]) -> str:
    """Return why the level of a message of topic ``warning`` has changed; "" for no reasons."""
    return "; ".join(filter(None, (_reasons(body), _evidence(body))))


def _level(body: dict[str, Any]) -> str:
    """Return the level of a finger; "unknown" with its reasons, since without them it says nothing."""
    level = plain(body.get("level"))
    return f"{level} ({_reasons(body)})" if level == "unknown" and _reasons(body) else level


def _add_header(sheet: Sheet, status: dict[str, Any]) -> None:
    facts = [f"up {_quantity(status, 'uptime_s', 's', 0)}"]
    if "config_id" in status:  # the reply to a request has none
        facts.append(f"config {plain(status['config_id'])}")
    facts.append(f"lease {_either((status.get('lease') or {}).get('held'), 'held', 'free')}")
    facts += [f"object {plain(named)}"] if (named := status.get("object_name")) else []
    sheet.facts([(f"slipd {plain(status.get('version'))}", "1")], [(fact, "") for fact in facts])


def _add_finger(sheet: Sheet, finger: str, body: dict[str, Any], *, silent: bool, forces: bool) -> None:
    """Add one finger; ``body`` is its verdict, or its entry in ``status``, which holds no quantities."""
    level = "unknown" if silent else plain(body.get("level"))
    colour = LEVEL_COLOURS.get(level, "")
    why = "stale" if silent else "  ".join(filter(None, (_reasons(body), _evidence(body))))
    head: Line = [(f"{plain(finger):<{NAME_CELLS}}", "1"), (f"{level.upper():<11}", colour)]
    if "tare_busy" in body:
        head.append((f"tare {_quantity(body, 'tare_id', '', 0)}", ""))
        facts = [(_friction(body), "")]
    else:
        head.append((_margin(body), ""))
        facts = [(text, code) for text, code in ((_bar(body), colour), (_bounds(body), "")) if text]
        facts += [(text, "") for text in _facts(body) if text and forces]
    sheet.facts(head, facts, NAME_CELLS)
    sheet.paragraph(why, colour, NAME_CELLS)


def _facts(body: dict[str, Any]) -> Iterator[str]:
    unit_known = _in_newtons(body)
    facts = [
        f"{word} {_quantity(body, key, unit if unit_known else '', digits)}" for word, key, unit, digits in _QUANTITIES
    ]
    yield from (*facts[:3], _friction(body), *facts[3:])
    for key, name in (("centroid_m", "centroid"), ("pole_m", "pole")):
        if (point := body.get(key)) is not None:
            yield f"{name} {1000.0 * point[0]:.1f}, {1000.0 * point[1]:.1f} mm"


def _add_gripper(sheet: Sheet, body: dict[str, Any]) -> None:
    """Add the gripper, from a message ``gripper`` or its entry in ``status``."""
    head = [(f"{'gripper':<{NAME_CELLS}}", "1"), (f"width {_scaled(body.get('width_m'), 'mm', 1)}", "")]
    facts = (
        f"force {_quantity(body, 'force_command_n', 'N', 1)} of at most {_quantity(body, 'force_limit_n', 'N', 1)}",
        _either(body.get("moving"), "moving", "at rest"),
        f"object {plain(body.get('object'))}",
    )
    sheet.facts(head, [(fact, "") for fact in facts], NAME_CELLS)
    faults = [f"fault {plain(fault)}"] if (fault := body.get("fault")) else []
    faults += ["does not repeat the command"] if body.get("echo_ok") is False else []
    sheet.remark("  ".join(faults), SEVERITY_COLOURS["error"], NAME_CELLS)


def _add_recording(sheet: Sheet, recording: dict[str, Any], what: str) -> None:
    """Add a recording in progress."""
    if not recording.get("running"):
        return
    sheet.facts([("recording", "1")])
    sheet.remark(f"{what}{plain(recording.get('path') or recording.get('name'))}", "", NAME_CELLS)
    if recording.get("lost"):
        sheet.remark(f"{_quantity(recording, 'lost', '', 0)} entries lost", "33", NAME_CELLS)


def _add_repairs(sheet: Sheet, status: dict[str, Any]) -> None:
    """Add what needs a repair, each with the command that mends it or shows what to mend."""
    found = repairs(status)
    if not found:
        sheet.paragraph("nothing to repair", "")
        return
    sheet.paragraph(f"{len(found)} to repair, each explained in {DOCUMENT} (slipd docs health)", "1")
    for repair in found:
        colour = SEVERITY_COLOURS[repair.severity]
        sheet.facts([(f"{repair.severity:<{NAME_CELLS}}", colour), (f"{repair.id}  {plain(repair.about)}:", "")])
        sheet.remark(plain(repair.problem), colour, NAME_CELLS)
        sheet.paragraph(plain(repair.command), "", NAME_CELLS)


def _add_stream(sheet: Sheet, name: str, stream: dict[str, Any]) -> None:
    """Add one stream with its health, rate, age and counters; what needs a repair is named above."""
    health = stream["health"]
    rates = f"{_quantity(stream, 'rate_hz', 'Hz', 0)} of {_quantity(stream, 'expected_hz', 'Hz', 0)}"
    facts = [f"age {_scaled(stream.get('age_s'), 'ms', 0)}"]
    facts += [f"{word} {_quantity(stream, word, '', 0)}" for word in ("bad", "lost", "reconnects")]
    head = [(f"{plain(name):<20}", ""), (f"{HEALTH[health]:<7}", HEALTH_COLOURS[health]), (rates, "")]
    sheet.facts(head, [(fact, "") for fact in facts], NAME_CELLS)
    if (message := stream.get("message")) and (health == Health.OK or message.startswith(DAEMON_LATE)):
        sheet.remark(plain(message), "", NAME_CELLS)


def _in_newtons(body: dict[str, Any]) -> bool:
    """Return whether forces are in newtons, as they are if an older daemon does not send ``force_unit``."""
    return bool(body.get("force_unit", "N") == "N")


def _utilisation(body: dict[str, Any]) -> str:
    """Return the utilisation, or one of its bounds."""
    for field, sign in (("utilisation", ""), ("utilisation_upper", "≤"), ("utilisation_lower", "≥")):
        if (value := body.get(field)) is not None:
            return f"{sign}{value:.2f}"
    return UNKNOWN


def _bounds(body: dict[str, Any]) -> str:
    """Return both bounds of the utilisation where they differ visibly, else ""."""
    lower, upper = body.get("utilisation_lower"), body.get("utilisation_upper")
    if lower is None or upper is None or f"{lower:.2f}" == f"{upper:.2f}":
        return ""
    return f"{lower:.2f} to {upper:.2f}"


def _relative_alone(body: dict[str, Any]) -> bool:
    return _utilisation(body) == UNKNOWN and body.get("relative_utilisation") is not None


def _margin(body: dict[str, Any]) -> str:
    """Return the utilisation λ; where it is not known, the relative utilisation λr if that is."""
    if _relative_alone(body):
        return f"λr{_quantity(body, 'relative_utilisation', '', 2):>5}"
    return f"λ {_utilisation(body):>5}"


def _friction(body: dict[str, Any]) -> str:
    """Return the coefficient of friction and its source; where it is not known, what the load requires and required."""
    source = body.get("mu_source")
    known = f"mu {_quantity(body, 'mu', '', 2)}" + (f" {plain(source)}" if source else "")
    if body.get("mu") is not None or body.get("required_friction") is None:
        return known
    required, carried = (_quantity(body, field, "", 2) for field in ("required_friction", "carried_friction"))
    return f"{known}  requires {required} of {carried} carried"


def _bar(body: dict[str, Any]) -> str:
    """Draw full blocks up to the utilisation, shaded ones up to its upper bound, or to the relative one where alone."""
    upper, sure = (
        round(min(max(body.get(field) or 0.0, 0.0), 1.0) * BAR_CELLS)
        for field in ("relative_utilisation" if _relative_alone(body) else "utilisation_upper", "utilisation")
    )
    return ("█" * sure + "▒" * (upper - sure)).ljust(BAR_CELLS, "·")


def _reasons(body: dict[str, Any]) -> str:
    return ", ".join(map(plain, body.get("reasons") or ()))


def _evidence(body: dict[str, Any]) -> str:
    """Return what shows that the object moves, in words; "" without evidence."""
    evidence = ", ".join(map(plain, body.get("evidence") or ()))
    return f"moves by {evidence}" if evidence else ""


def _quantity(body: Mapping[str, Any], field: str, unit: str, digits: int) -> str:
    """Return a number, or the length of a vector, with its unit."""
    value = body.get(field)
    if value is None:
        return UNKNOWN
    magnitude = math.hypot(*value) if isinstance(value, list) else value
    return f"{round(magnitude, digits) + 0.0:.{digits}f} {unit}".rstrip()  # + 0.0: no "-0.0"


def _scaled(value: float | None, unit: str, digits: int) -> str:
    return UNKNOWN if value is None else f"{1000 * value:.{digits}f} {unit}"


def _either(value: bool | None, yes: str, no: str) -> str:
    return UNKNOWN if value is None else yes if value else no
