"""The parts of the live view: lines for one finger, the gripper, a recording and a stream."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from slipd_client.live_view_format import (
    UNKNOWN,
    bar,
    bounds,
    either,
    evidence_of,
    friction,
    in_newtons,
    margin,
    number,
    place,
    plain,
    quantity,
    reasons_of,
)
from slipd_client.messages import HEALTH
from slipd_client.pad_picture import CENTROID, POLE, Mark, PadImage, pad_picture
from slipd_client.terminal import GAP, Line, Sheet, Span

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

_QUANTITIES = (
    ("normal", "normal_n", "N", 2),
    ("tangential", "tangential_n", "N", 2),
    ("spin", "spin_nm", "N·m", 4),
    ("needs", "grip_needed_n", "N", 1),
)


def add_finger(
    sheet: Sheet,
    finger: str,
    body: dict[str, Any],
    tactile: dict[str, Any],
    *,
    silent: bool,
    pad: tuple[PadImage, int] | None,
    brief: bool,
    colour: bool,
) -> None:
    """Add one finger.

    Args:
        sheet: Gets the lines.
        finger: Its name.
        body: Its verdict, or its entry in ``status``.
        tactile: The newest message about its pad; empty before the first.
        silent: The daemon is silent, so the level is not known.
        pad: Image of its pad and its scale, drawn beside the facts; None: no picture.
        brief: Without a picture, only level, utilisation and reasons.
        colour: Whether the picture may have colours.
    """
    level = "unknown" if silent else plain(body.get("level"))
    paint = LEVEL_COLOURS.get(level, "")
    why = "stale" if silent else "  ".join(part for part in (reasons_of(body), evidence_of(body)) if part)
    head: Line = [(f"{plain(finger):<{NAME_CELLS}}", "1"), (f"{level.upper():<11}", paint)]
    if "tare_busy" in body:  # an entry of ``status`` holds no quantities
        sheet.facts([*head, (f"tare {quantity(body, 'tare_id', '', 0)}", "")], [(friction(body), "")], NAME_CELLS)
        sheet.paragraph(why, paint, NAME_CELLS)
        return
    head.append((margin(body), ""))
    used = [(text, code) for text, code in ((bar(body), paint), (bounds(body), "")) if text]
    facts = [(text, "") for text in (*_facts(body, pad is not None), _no_image(tactile)) if text]
    if pad is None:
        sheet.facts(head, used if brief else [*used, *facts], NAME_CELLS)
        sheet.paragraph(why, paint, NAME_CELLS)
        return
    sheet.facts(head, used, NAME_CELLS)
    image, scale = pad
    marks = (Mark(CENTROID, body.get("centroid_m")), Mark(POLE, body.get("pole_m")))
    picture, columns = pad_picture(image, scale, marks, colour=colour, ascii_only=sheet.ascii_only)
    beside = sheet.narrower(columns + GAP)
    beside.paragraph(why, paint)
    beside.facts([], [*facts, (f"largest taxel {image.peak:.3g} {image.unit}".rstrip(), "")])
    sheet.beside(picture, columns, beside)


def _facts(body: dict[str, Any], marked: bool) -> Sequence[str]:
    unit_known = in_newtons(body)
    facts = [
        f"{word} {quantity(body, key, unit if unit_known else '', digits)}" for word, key, unit, digits in _QUANTITIES
    ]
    facts.insert(3, friction(body))
    signs = (f" {CENTROID}", f" {POLE}") if marked else ("", "")
    return [*facts, place(body, "centroid_m", f"centroid{signs[0]}"), place(body, "pole_m", f"pole{signs[1]}")]


def _no_image(tactile: dict[str, Any]) -> str:
    """Return why the image of a pad cannot be used; "" for a usable image, and for a finger without a pad."""
    reasons = tactile.get("image_reasons")
    if tactile.get("image_ok") is not False or not isinstance(reasons, list):
        return ""
    return f"no image: {', '.join(map(plain, reasons))}"


def add_gripper(sheet: Sheet, body: dict[str, Any]) -> None:
    """Add the gripper, from a message ``gripper`` or its entry in ``status``."""
    width_m = number(body.get("width_m"))
    facts = [
        f"width {UNKNOWN if width_m is None else f'{width_m * 1000:.1f} mm'}",
        f"force {quantity(body, 'force_command_n', 'N', 1)} of at most {quantity(body, 'force_limit_n', 'N', 1)}",
        either(body.get("moving"), "moving", "at rest"),
        f"object {plain(body.get('object'))}",
    ]
    faults = [f"fault {plain(fault)}"] if (fault := body.get("fault")) else []
    if latched := body.get("latched_fault"):
        faults.append(f"latched: {plain(latched)}")
    if body.get("echo_ok") is False:
        faults.append("does not repeat the command")
    head = [(f"{'gripper':<{NAME_CELLS}}", "1"), (facts[0], "")]
    sheet.facts(head, [(fact, "") for fact in facts[1:]], NAME_CELLS)
    sheet.remark("  ".join(faults), "1;31", NAME_CELLS)


def add_recording(sheet: Sheet, recording: dict[str, Any], what: str) -> None:
    """Add a recording in progress, or one that ended by itself; one that was stopped on request is not shown."""
    failure = recording.get("failure")
    if recording.get("running") is not True and not failure:
        return
    word, colour = (
        ("OK", "32") if not failure else ("ENDED", "33") if recording.get("state") == "limited" else ("FAILED", "1;31")
    )
    head = [(f"{'recording':<20}", "1"), (f"{word:<7}", colour)]
    sheet.facts(head)
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
    head = [(f"{'incidents':<20}", "1"), ("FAILED ", "1;31") if failure else ("OK     ", "32")]
    counts = (("saved", "saved"), ("not_saved", "not saved"))
    sheet.facts(head, [(f"{quantity(incidents, key, '', 0)} {word}", "") for key, word in counts], NAME_CELLS)
    if text := failure or incidents.get("path"):
        sheet.remark(plain(text), "1;31" if failure else "", NAME_CELLS)
    missing = [f"{quantity(incidents, key, '', 0)} entries {key}" for key in ("lost", "dropped") if incidents.get(key)]
    if missing:
        sheet.remark(", ".join(missing), "33", NAME_CELLS)


def add_stream(sheet: Sheet, name: str, stream: dict[str, Any]) -> None:
    """Add one stream with its health, rate, age and counters."""
    health, colour = _health(stream)
    age_s = number(stream.get("age_s"))
    facts = [
        f"{quantity(stream, 'rate_hz', 'Hz', 0)} of {quantity(stream, 'expected_hz', 'Hz', 0)}",
        f"age {UNKNOWN if age_s is None else f'{age_s * 1000:.0f} ms'}",
        *(f"{word} {quantity(stream, word, '', 0)}" for word in ("bad", "lost", "reconnects")),
    ]
    head = [(f"{plain(name):<20}", ""), (f"{health:<7}", colour), (facts[0], "")]
    sheet.facts(head, [(fact, "") for fact in facts[1:]], NAME_CELLS)
    message = stream.get("message")
    sheet.remark(plain(message) if message else "", colour, NAME_CELLS)


def add_faults_in_short(sheet: Sheet, streams: dict[str, dict[str, Any]]) -> None:
    """Add streams with a fault or a hint, those with the same one together, without rates and counters."""
    alike: dict[tuple[str, str, str], list[str]] = {}
    for name, stream in streams.items():
        message = stream.get("message")
        alike.setdefault((*_health(stream), plain(message) if message else ""), []).append(plain(name))
    for (health, colour, message), names in alike.items():
        sheet.facts([(f"{health:<{NAME_CELLS}}", colour), (", ".join(names), "")])
        sheet.remark(message, colour, NAME_CELLS)


def add_rates_in_short(sheet: Sheet, streams: dict[str, dict[str, Any]]) -> None:
    """Add streams without a fault, each with its rate only."""
    if streams:
        rates: list[Span] = [
            (f"{plain(name)} {quantity(each, 'rate_hz', 'Hz', 0)}", "") for name, each in streams.items()
        ]
        sheet.facts([(f"{'OK':<{NAME_CELLS}}", HEALTH_COLOURS[0]), rates[0]], rates[1:], NAME_CELLS)


def _health(stream: dict[str, Any]) -> tuple[str, str]:
    code = stream.get("health")
    if isinstance(code, int) and 0 <= code < len(HEALTH):
        return HEALTH[code], HEALTH_COLOURS[code]
    return UNKNOWN, ""
