"""Format the values of a message for the live view; an unknown value is "–", never 0."""

from __future__ import annotations

import math
from datetime import datetime
from typing import Any

UNKNOWN = "\N{EN DASH}"
BAR_CELLS = 20


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
        value = number(body.get(field))
        if value is not None:
            return f"{sign}{value:.2f}"
    return UNKNOWN


def bounds(body: dict[str, Any]) -> str:
    """Return both bounds of the utilisation where they differ visibly, else ""."""
    lower, upper = number(body.get("utilisation_lower")), number(body.get("utilisation_upper"))
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
    return utilisation(body) == UNKNOWN and number(body.get("relative_utilisation")) is not None


def friction(body: dict[str, Any]) -> str:
    """Return the coefficient of friction and its source; where it is not known, what the load requires and required."""
    source = body.get("mu_source")
    known = f"mu {quantity(body, 'mu', '', 2)}" + (f" {plain(source)}" if source else "")
    if number(body.get("mu")) is not None or number(body.get("required_friction")) is None:
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


def _cells(value: Any) -> int:
    share = number(value)
    return 0 if share is None else round(min(max(share, 0.0), 1.0) * BAR_CELLS)


def reasons_of(body: dict[str, Any]) -> str:
    """Return the reasons of a level, the most important first."""
    reasons = body.get("reasons")
    return ", ".join(plain(reason) for reason in reasons) if isinstance(reasons, list) else ""


def evidence_of(body: dict[str, Any]) -> str:
    """Return what shows that the object moves, in words; "" without evidence."""
    evidence = body.get("evidence")
    return f"moves by {', '.join(map(plain, evidence))}" if isinstance(evidence, list) and evidence else ""


def quantity(body: dict[str, Any], field: str, unit: str, digits: int) -> str:
    """Return a number, or the length of a vector, with its unit."""
    magnitude = _magnitude(body.get(field))
    return UNKNOWN if magnitude is None else f"{magnitude:.{digits}f} {unit}".rstrip()


def place(body: dict[str, Any], field: str, name: str) -> str:
    """Return a point of the pad in millimetres after its name; "" if it is not known."""
    point = body.get(field)
    numbers = [number(each) for each in point] if isinstance(point, list) else []
    if len(numbers) != 2 or numbers[0] is None or numbers[1] is None:
        return ""
    x_mm, y_mm = (f"{1000.0 * each:.1f}" for each in numbers if each is not None)
    return f"{name} {x_mm}, {y_mm} mm"


def number(value: Any) -> float | None:
    """Return the value if it is a number, else None."""
    return value if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def _magnitude(value: Any) -> float | None:
    """Return a number, or the length of a vector."""
    if not isinstance(value, list):
        return number(value)
    numbers = [each for each in map(number, value) if each is not None]
    return math.hypot(*numbers) if numbers and len(numbers) == len(value) else None


def either(value: Any, yes: str, no: str) -> str:
    """Return one of two words for a boolean."""
    return yes if value is True else no if value is False else UNKNOWN


def as_map(value: Any) -> dict[str, Any]:
    """Return the value if it is a map, else an empty one."""
    return value if isinstance(value, dict) else {}


def plain(value: Any) -> str:
    """Return a string from the daemon without control characters, which would move the cursor."""
    if not isinstance(value, str):
        return UNKNOWN
    if value and value.isprintable():
        return value
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in value) or UNKNOWN
