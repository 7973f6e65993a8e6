"""Parts of the live view: values as text, and lines of gripper, recordings and streams; unknown is "–", never 0.

Every value is of its field's kind, or None: a subscriber refuses a message with any other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import datetime
from typing import Any

from slipd_client.messages import HEALTH, Health
from slipd_client.terminal import Sheet

UNKNOWN = "\N{EN DASH}"
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
FAULT_COLOUR = HEALTH_COLOURS[Health.ERROR]


def clock_time(timestamp: float) -> str:
    """Return the local time of day with milliseconds; "–" for 0, which is no time, and for times out of range."""
    if not timestamp:
        return UNKNOWN
    try:
        return datetime.fromtimestamp(timestamp).astimezone().strftime("%H:%M:%S.%f")[:-3]
    except (ValueError, OverflowError, OSError):
        return UNKNOWN


def in_newtons(body: dict[str, Any]) -> bool:
    """Return whether forces are in newtons, as they are if an older daemon does not send ``force_unit``."""
    return bool(body.get("force_unit", "N") == "N")


def utilisation(body: dict[str, Any]) -> str:
    """Return the utilisation, or one of its bounds."""
    for field, sign in (("utilisation", ""), ("utilisation_upper", "≤"), ("utilisation_lower", "≥")):
        if (value := body.get(field)) is not None:
            return f"{sign}{value:.2f}"
    return UNKNOWN


def bounds(body: dict[str, Any]) -> str:
    """Return both bounds of the utilisation where they differ visibly, else ""."""
    lower, upper = body.get("utilisation_lower"), body.get("utilisation_upper")
    if lower is None or upper is None or f"{lower:.2f}" == f"{upper:.2f}":
        return ""
    return f"{lower:.2f} to {upper:.2f}"


def margin(body: dict[str, Any]) -> str:
    """Return the utilisation λ; where it is not known, the relative utilisation λr if that is."""
    if relative_alone(body):
        return f"λr{quantity(body, 'relative_utilisation', '', 2):>5}"
    return f"λ {utilisation(body):>5}"


def relative_alone(body: dict[str, Any]) -> bool:
    """Return whether only the relative utilisation is known."""
    return utilisation(body) == UNKNOWN and body.get("relative_utilisation") is not None


def friction(body: dict[str, Any]) -> str:
    """Return the coefficient of friction and its source; where it is not known, what the load requires and required."""
    source = body.get("mu_source")
    known = f"mu {quantity(body, 'mu', '', 2)}" + (f" {plain(source)}" if source else "")
    if body.get("mu") is not None or body.get("required_friction") is None:
        return known
    required, carried = (quantity(body, field, "", 2) for field in ("required_friction", "carried_friction"))
    return f"{known}  requires {required} of {carried} carried"


def bar(body: dict[str, Any]) -> str:
    """Draw full blocks up to the utilisation, shaded ones up to its upper bound; empty if neither is known.

    Where only the relative utilisation is known, the shaded blocks reach up to that.
    """
    upper = _cells(body.get("relative_utilisation" if relative_alone(body) else "utilisation_upper"))
    sure = _cells(body.get("utilisation"))
    return ("█" * sure + "▒" * (upper - sure)).ljust(BAR_CELLS, "·")


def _cells(share: float | None) -> int:
    return round(min(max(share or 0.0, 0.0), 1.0) * BAR_CELLS)


def reasons_of(body: dict[str, Any]) -> str:
    """Return the reasons of a level, the most important first."""
    return ", ".join(map(plain, body.get("reasons") or ()))


def evidence_of(body: dict[str, Any]) -> str:
    """Return what shows that the object moves, in words; "" without evidence."""
    evidence = ", ".join(map(plain, body.get("evidence") or ()))
    return f"moves by {evidence}" if evidence else ""


def quantity(body: dict[str, Any], field: str, unit: str, digits: int) -> str:
    """Return a number, or the length of a vector, with its unit."""
    value = body.get(field)
    if value is None:
        return UNKNOWN
    magnitude = math.hypot(*value) if isinstance(value, list) else value
    return f"{round(magnitude, digits) + 0.0:.{digits}f} {unit}".rstrip()  # + 0.0: no "-0.0"


def place(body: dict[str, Any], field: str, name: str) -> str:
    """Return a point of the pad in millimetres after its name; "" if it is not known."""
    if (point := body.get(field)) is None:
        return ""
    return f"{name} {1000.0 * point[0]:.1f}, {1000.0 * point[1]:.1f} mm"


def either(value: bool | None, yes: str, no: str) -> str:
    """Return one of two words for a boolean."""
    return UNKNOWN if value is None else yes if value else no


def plain(text: str | None) -> str:
    """Return a string from the daemon without control characters, which would move the cursor."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text or "") or UNKNOWN


def add_gripper(sheet: Sheet, body: dict[str, Any]) -> None:
    """Add the gripper, from a message ``gripper`` or its entry in ``status``."""
    head = [(f"{'gripper':<{NAME_CELLS}}", "1"), (f"width {_scaled(body.get('width_m'), 'mm', 1)}", "")]
    facts = (
        f"force {quantity(body, 'force_command_n', 'N', 1)} of at most {quantity(body, 'force_limit_n', 'N', 1)}",
        either(body.get("moving"), "moving", "at rest"),
        f"object {plain(body.get('object'))}",
    )
    sheet.facts(head, [(fact, "") for fact in facts], NAME_CELLS)
    faults = [f"fault {plain(fault)}"] if (fault := body.get("fault")) else []
    faults += [f"latched: {plain(latched)}"] if (latched := body.get("latched_fault")) else []
    faults += ["does not repeat the command"] if body.get("echo_ok") is False else []
    sheet.remark("  ".join(faults), FAULT_COLOUR, NAME_CELLS)


def add_recording(sheet: Sheet, recording: dict[str, Any], what: str) -> None:
    """Add a recording in progress, or one that ended by itself; one that was stopped on request is not shown."""
    failure = recording.get("failure")
    if recording.get("running") is not True and not failure:
        return
    limited = recording.get("state") == "limited"
    word, colour = ("OK", "32") if not failure else ("ENDED", "33") if limited else ("FAILED", FAULT_COLOUR)
    sheet.facts([(f"{'recording':<20}", "1"), (f"{word:<7}", colour)])
    if failure:  # it contains the path
        sheet.remark(plain(failure), colour, NAME_CELLS)
        return
    sheet.remark(f"{what}{plain(recording.get('path') or recording.get('name'))}", "", NAME_CELLS)
    if recording.get("lost"):
        sheet.remark(f"{quantity(recording, 'lost', '', 0)} entries lost", "33", NAME_CELLS)


def add_incidents(sheet: Sheet, incidents: dict[str, Any]) -> None:
    """Add the incidents of this run, if they are kept: files saved and not, and entries missing from the memory."""
    if not incidents:
        return
    failure = incidents.get("failure")
    head = [(f"{'incidents':<20}", "1"), ("FAILED ", FAULT_COLOUR) if failure else ("OK     ", "32")]
    counts = (("saved", "saved"), ("not_saved", "not saved"))
    sheet.facts(head, [(f"{quantity(incidents, key, '', 0)} {word}", "") for key, word in counts], NAME_CELLS)
    sheet.remark(_said(failure or incidents.get("path")), FAULT_COLOUR if failure else "", NAME_CELLS)
    missing = [f"{quantity(incidents, key, '', 0)} entries {key}" for key in ("lost", "dropped") if incidents.get(key)]
    sheet.remark(", ".join(missing), "33", NAME_CELLS)


def add_stream(sheet: Sheet, name: str, stream: dict[str, Any]) -> None:
    """Add one stream with its health, rate, age and counters."""
    health, colour = _health(stream)
    rates = f"{quantity(stream, 'rate_hz', 'Hz', 0)} of {quantity(stream, 'expected_hz', 'Hz', 0)}"
    facts = [f"age {_scaled(stream.get('age_s'), 'ms', 0)}"]
    facts += [f"{word} {quantity(stream, word, '', 0)}" for word in ("bad", "lost", "reconnects")]
    head = [(f"{plain(name):<20}", ""), (f"{health:<7}", colour), (rates, "")]
    sheet.facts(head, [(fact, "") for fact in facts], NAME_CELLS)
    sheet.remark(_said(stream.get("message")), colour, NAME_CELLS)


def add_faults(sheet: Sheet, streams: Mapping[str, dict[str, Any]]) -> int:
    """Add the streams with a fault or a hint, those with the same one together; return how many have none."""
    alike: dict[tuple[str, str, str], list[str]] = {}
    well = 0
    for name, stream in streams.items():
        message = stream.get("message")
        if stream.get("health") == Health.OK and not message:
            well += 1
        else:
            alike.setdefault((*_health(stream), _said(message)), []).append(plain(name))
    for (health, colour, message), names in alike.items():
        sheet.facts([(f"{health:<{NAME_CELLS}}", colour), (", ".join(names), "")])
        sheet.remark(message, colour, NAME_CELLS)
    return well


def _scaled(value: float | None, unit: str, digits: int) -> str:
    """Return a quantity in m or s in a thousandth of that."""
    return UNKNOWN if value is None else f"{1000 * value:.{digits}f} {unit}"


def _health(stream: Mapping[str, Any]) -> tuple[str, str]:
    return HEALTH[stream["health"]], HEALTH_COLOURS[stream["health"]]


def _said(text: str | None) -> str:
    return plain(text) if text else ""
