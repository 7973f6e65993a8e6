"""Draws the newest messages as lines for a terminal, for ``slipctl watch`` and the demo.

Knows no clock, socket or terminal: messages in, text out. An unknown value is shown as "–", never as 0.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from slipd_client.live_view_format import (
    as_map,
    clock_time,
    either,
    evidence_of,
    in_newtons,
    margin,
    number,
    plain,
    quantity,
    reasons_of,
)
from slipd_client.live_view_lines import (
    add_faults_in_short,
    add_finger,
    add_gripper,
    add_incidents,
    add_rates_in_short,
    add_recording,
    add_stream,
)
from slipd_client.messages import GRIPPER_TOPIC, STATUS_TOPIC, Health
from slipd_client.pad_picture import PadImage, largest_scale, pad_image
from slipd_client.terminal import GAP, Line, Sheet, Terminal, paint, spelled

SILENT_AFTER_S = 2.0
"""Twice the period of ``status``: after so long without it, what was shown last is out of date."""

FACT_COLUMNS = 36
"""Least columns beside the picture of a pad, for the facts."""

PAD_LINES = 16
"""Most lines of the picture of a pad."""

OTHER_LINES = 6
"""Lines kept for the header, the gripper, the streams in short and a note; the rest is for the fingers."""

Pads = dict[str, tuple[PadImage, int] | None]
"""Finger → image of its pad, and its scale; None: it does not fit."""


StreamForms = list[tuple[Sheet, list[str]]]
"""Lines of the streams, each with what they leave out."""


class _Made(NamedTuple):
    """Lines of the streams, and what they were made of."""

    status: dict[str, Any] | None
    width: int
    ascii_only: bool
    forms: StreamForms


class LiveView:
    """Keeps the newest message of each topic and draws them."""

    def __init__(self) -> None:
        self._newest: dict[str, dict[str, Any]] = {}
        self._stream_forms: _Made | None = None

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

    def render(self, terminal: Terminal, silent_s: float = 0.0) -> list[str]:
        """Draw everything, or as much as the terminal has room for.

        Args:
            terminal: What to draw for.
            silent_s: Time since the last message; beyond ``SILENT_AFTER_S`` neither level nor pad is shown.

        Returns:
            One string per line, without line ends.
        """
        silent = silent_s > SILENT_AFTER_S
        pads = {} if silent else self._pads(terminal)
        smallest: Pads = {finger: pad and (pad[0], 1) for finger, pad in pads.items()}
        none: Pads = dict.fromkeys(pads)
        for form in (pads, smallest, none):
            lines = self._lines(terminal, silent_s, form)
            if len(lines) <= terminal.lines or not any(pads.values()):
                break
        if len(lines) > terminal.lines:
            lines = self._lines(terminal, silent_s, none, brief=True)
        if len(lines) > terminal.lines:
            note = f"{len(lines) - terminal.lines + 1} more lines do not fit in {_size(terminal)}"
            lines = [*lines[: terminal.lines - 1], [(note, "2")]]
        return [paint(line, terminal.columns, colour=terminal.colour) for line in lines[: terminal.lines]]

    def summary(self, *, ascii_only: bool = False) -> str:
        """Return every finger in one line, for a log: level, utilisation and normal force."""
        parts = [
            f"{plain(finger)} {plain(body.get('level'))} {' '.join(margin(body).split())}"
            f" {quantity(body, 'normal_n', 'N' if in_newtons(body) else '', 2)}"
            for finger, body in self._fingers()
        ]
        line = f"{self._clock_time()}  {'  |  '.join(parts) or 'no verdict yet'}"
        return spelled(line, ascii_only=ascii_only)

    def _pads(self, terminal: Terminal) -> Pads:
        """Return image and scale of each pad; None if it does not fit."""
        fingers = self._fingers()
        room = (terminal.lines - OTHER_LINES) // max(len(fingers), 1) - 1
        found: Pads = {}
        for finger, _ in fingers:
            image = pad_image(self._newest.get(f"tactile.{finger}", {}))
            if image is not None:
                scale = largest_scale(image, terminal.columns - GAP - FACT_COLUMNS, min(room, PAD_LINES))
                found[finger] = (image, scale) if scale > 0 else None
        return found

    def _lines(self, terminal: Terminal, silent_s: float, pads: Pads, *, brief: bool = False) -> list[Line]:
        """Return all lines, those of the streams in the longest form that fits; ``brief``: without forces."""
        silent = silent_s > SILENT_AFTER_S
        sheet = Sheet(terminal.columns, ascii_only=terminal.ascii_only)
        self._add_header(sheet, silent_s if silent else 0.0)
        for finger, body in self._fingers():
            add_finger(
                sheet,
                finger,
                body,
                {} if silent else self._newest.get(f"tactile.{finger}", {}),
                silent=silent,
                pad=pads.get(finger),
                brief=brief,
                colour=terminal.colour,
            )
        if gripper := self._newest.get(GRIPPER_TOPIC) or self._status("gripper"):
            add_gripper(sheet, gripper)
        for key, what in (("run_recording", "of the whole run  "), ("recording", "")):
            add_recording(sheet, self._status(key), what)
        add_incidents(sheet, self._status("incidents"))
        without = [f"pad of {plain(finger)}" for finger, pad in pads.items() if pad is None]
        without += ["forces"] if brief else []
        for streams, left_out in self._forms(sheet):
            note = sheet.narrower(0)
            if without or left_out:
                note.paragraph(f"left out in {_size(terminal)}: {', '.join([*without, *left_out])}", "2")
            lines = [*sheet.lines, *streams.lines, *note.lines]
            if len(lines) <= terminal.lines:
                break
        return lines

    def _forms(self, like: Sheet) -> StreamForms:
        """Return the lines of the streams, made once for each ``status``: the view is drawn several times as often."""
        made, status = self._stream_forms, self._newest.get(STATUS_TOPIC)
        if made is None or made.status is not status or made.width != like.width or made.ascii_only != like.ascii_only:
            made = self._stream_forms = _Made(status, like.width, like.ascii_only, self._new_forms(like))
        return made.forms

    def _new_forms(self, like: Sheet) -> StreamForms:
        """Return the lines of the streams, from the longest form to the shortest, each with what it leaves out."""
        streams = {name: as_map(stream) for name, stream in self._status("streams").items()}
        well = {
            name: each for name, each in streams.items() if each.get("health") == Health.OK and not each.get("message")
        }
        ill = {name: each for name, each in streams.items() if name not in well}
        whole, short, least = like.narrower(0), like.narrower(0), like.narrower(0)
        for name, stream in streams.items():
            add_stream(whole, name, stream)
        add_faults_in_short(short, ill)
        add_rates_in_short(short, well)
        add_faults_in_short(least, ill)
        faults = ["rates, age and counters of the streams"] if ill else []
        count = f"{len(well)} streams without a fault"
        if not well:
            return [(whole, []), (least, faults)]
        return [(whole, []), (short, ["age and counters of the streams"]), (least, [*faults, count])]

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

    def _add_header(self, sheet: Sheet, silent_s: float) -> None:
        if silent_s:
            sheet.paragraph(f"no message for {silent_s:.1f} s: the following is out of date", "1;31")
            return
        status = self._newest.get(STATUS_TOPIC, {})
        lease = either(self._status("lease").get("held"), "held", "free")
        facts = [f"up {quantity(status, 'uptime_s', 's', 0)}"]
        if "config_id" in status:  # the topic has it, and the reply to a request does not
            facts.append(f"config {plain(status['config_id'])}")
        facts.append(f"lease {lease}")
        if named := status.get("object_name"):
            facts.append(f"object {plain(named)}")
        sheet.facts([(f"slipd {plain(status.get('version'))}", "1")], [(fact, "") for fact in facts])

    def _clock_time(self) -> str:
        newest = max((number(body.get("timestamp")) or 0.0 for body in self._newest.values()), default=0.0)
        return clock_time(newest)


def change_line(body: dict[str, Any], *, ascii_only: bool = False) -> str:
    """Return one line for a message of topic ``warning``: the level of a finger has changed."""
    reasons = "; ".join(part for part in (reasons_of(body), evidence_of(body)) if part)
    change = f"{plain(body.get('previous'))} → {plain(body.get('level'))}"
    line = f"{clock_time(number(body.get('timestamp')) or 0.0)}  {plain(body.get('finger'))} {change}"
    return spelled(line + (f"  ({reasons})" if reasons else ""), ascii_only=ascii_only)


def _size(terminal: Terminal) -> str:
    return f"{terminal.columns} x {terminal.lines}"


def _finger_of(topic: str) -> str | None:
    """Return the finger of a topic; None if it has none."""
    _, separator, finger = topic.partition(".")
    return finger if separator else None
