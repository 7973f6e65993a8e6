"""The view in terminals of any size: what is made smaller or left out, and that no message breaks it."""

from __future__ import annotations

import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shown_rig import GRIPPER, PAD, RIG, SLIP, STATUS, STREAM, rig

from slipd_client.live_view import LiveView, change_line
from slipd_client.terminal import Terminal

LONG = "no such port: /dev/serial/by-id/usb-Bota_Systems_AG_SensONE_ABC123; tries again every second; is it plugged in?"


@given(st.integers(0, 120))
def test_no_line_is_wider_than_the_terminal_in_either_mode(width: int) -> None:
    view = LiveView()
    for topic, body in (("slip.left", SLIP), ("status", STATUS), ("gripper", GRIPPER)):
        view.update(topic, body)
    plain, coloured = view.render(Terminal(width)), view.render(Terminal(width, colour=True))
    stripped = [re.sub(r"\x1b\[[0-9;]*m", "", line).rstrip() for line in coloured]
    assert stripped == plain
    assert max(map(len, plain)) <= width


@pytest.mark.parametrize("width", [80, 40, 20])
def test_the_reason_of_a_fault_is_never_cut(width: int) -> None:
    bodies: dict[str, dict[str, Any]] = {
        "slip.left": SLIP
        | {"reasons": ["disagreement", "disagreement_contact", "weight_unknown", "stuck", "rotation"]},
        "status": STATUS
        | {"streams": {"left.wrench": STREAM | {"health": 2, "message": LONG}}}
        | {"recording": {"state": "failed", "name": "a", "path": "/p", "failure": LONG, "lost": 7}},
        "gripper": GRIPPER | {"fault": "overcurrent", "latched_fault": "command_lost", "echo_ok": False},
    }
    view = LiveView()
    for topic, body in bodies.items():
        view.update(topic, body)
    lines = view.render(Terminal(width))
    assert max(map(len, lines)) <= width
    shown = re.sub(r"\s+", "", "".join(lines))
    for reason in (
        *(LONG, "weight_unknown, stuck, rotation"),
        "fault overcurrent latched: command_lost does not repeat the command",
    ):
        assert re.sub(r"\s+", "", reason) in shown


def test_a_low_terminal_shows_the_streams_that_are_not_well() -> None:
    streams = {f"f{n}.wrench": STREAM | {"health": 0, "message": ""} for n in range(30)}
    ill = {"f7.wrench": STREAM | {"health": 2, "message": LONG}}
    view = LiveView()
    view.update("slip.left", SLIP)
    view.update("status", STATUS | {"streams": streams | ill})
    lines = view.render(Terminal(80, 24))
    assert len(lines) <= 24
    assert lines[-1] == "left out in 80 x 24: age and counters of the streams"
    assert "f29.wrench 998 Hz" in "\n".join(lines)
    lines = view.render(Terminal(80, 12))
    left_out = "left out in 80 x 12: rates, age and counters of the streams, 29 streams without a fault"
    assert " ".join(lines[-2:]) == left_out
    assert re.search(r"^ERROR +f7\.wrench", "\n".join(lines), re.MULTILINE)
    assert re.sub(r"\s+", "", LONG) in re.sub(r"\s+", "", "".join(lines))
    assert len(view.render(Terminal(80))) > 30


def test_two_fingers_with_their_pads_and_the_gripper_fit_in_80_x_24() -> None:
    lines = rig(Terminal(80, 24))
    assert len(lines) <= 24
    assert sum("█" * 15 in line for line in lines) == 8, "the loaded half of both pads, two columns a taxel"
    text = "\n".join(lines)
    for part in (
        "WARNING",
        "SLIPPING",
        "0.50 to 0.75",
        "rotation, tipping  moves by load_drop",
        "normal 10.12 N",
        "width",
    ):
        assert part in text
    assert "centroid + 0.0, 6.4 mm  pole o 4.0, 200.0 mm" in text
    assert "largest taxel 0.5" in text
    assert lines[-1].startswith("left out in 80 x 24: age and counters of the streams")


def test_a_narrow_terminal_gets_smaller_pads_and_every_fact() -> None:
    lines = rig(Terminal(60, 20))
    assert len(lines) <= 20
    assert sum("█" * 7 in line and "█" * 17 not in line for line in lines if line[0] == "█") == 4
    for part in ("normal 10.12 N", "tangential 3.50 N", "spin 0.0123 N·m", "mu 0.60", "needs 14.2 N", "pole o"):
        assert part in "\n".join(lines)
    assert lines[-1] == "left out in 60 x 20: age and counters of the streams"


def test_a_large_terminal_gets_larger_pads_and_leaves_nothing_out() -> None:
    lines = rig(Terminal(200, 60))
    assert sum("█" * 31 in line for line in lines) == 16
    assert not any(line.startswith("left out") for line in lines)
    assert sum("reconnects 2" in line for line in lines) == 4


@pytest.mark.parametrize(
    ("columns", "lines", "left_out"),
    [
        (50, 30, "pad of left, pad of right"),
        (80, 14, "pad of left, pad of right, age and counters of the streams"),
        (80, 12, "pad of left, pad of right, 4 streams without a fault"),
        (80, 8, "pad of left, pad of right, forces, 4 streams without a fault"),
    ],
)
def test_what_does_not_fit_is_named(columns: int, lines: int, left_out: str) -> None:
    drawn_lines = rig(Terminal(columns, lines))
    assert len(drawn_lines) <= lines
    assert left_out in " ".join(drawn_lines[-2:])
    assert "WARNING" in drawn_lines[1]
    assert any("SLIPPING" in line for line in drawn_lines), "levels stay to the last"


def test_pads_become_smaller_before_they_are_left_out() -> None:
    ill = {"health": 1, "message": "late"}
    streams = {f"{finger}.{kind}": STREAM | ill for finger in ("left", "right") for kind in ("wrench", "pad")}
    lines = rig(
        Terminal(80, 20), status=STATUS | {"streams": streams, "recording": {"running": True, "path": "p" * 90}}
    )
    assert len(lines) <= 20
    assert sum("█" * 7 in line and "█" * 17 not in line for line in lines if line[0] == "█") == 4
    assert "WARN      left.wrench, left.pad, right.wrench, right.pad  late" in lines, "those with one message are one"


def test_lines_that_do_not_fit_at_all_are_counted() -> None:
    assert rig(Terminal(60, 3))[-1] == "9 more lines do not fit in 60 x 3"


def test_a_silent_daemon_has_no_pads() -> None:
    assert not any("█" * 16 in line for line in rig(Terminal(80, 24), silent_s=5.0))


def test_a_pad_without_a_usable_image_is_not_drawn() -> None:
    lines = rig(Terminal(80, 24), tactile_left=PAD | {"image_ok": False, "image_reasons": ["stale"], "loads_n": None})
    assert sum("█" * 32 in line for line in lines) == 4, "of the other pad"
    assert "no image: stale" in "\n".join(lines)


@given(st.integers(1, 120), st.integers(1, 60), st.booleans(), st.booleans())
def test_the_view_never_exceeds_the_terminal(columns: int, lines: int, colour: bool, ascii_only: bool) -> None:
    drawn_lines = [re.sub(r"\x1b\[[0-9;]*m", "", line) for line in rig(Terminal(columns, lines, colour, ascii_only))]
    assert len(drawn_lines) <= lines
    assert max(map(len, drawn_lines)) <= columns
    assert not ascii_only or "".join(drawn_lines).isascii()


def test_in_ascii_every_character_is_spelled() -> None:
    text = "\n".join(
        rig(Terminal(80, 24, ascii_only=True), status=STATUS | {"object_name": "Teekanne µ", "streams": {}})
    )
    assert text.isascii()
    for part in ("load  0.50  ##########=====.....", "spin 0.0123 N.m", "object Teekanne ?"):
        assert part in text
    assert change_line(SLIP | {"previous": "stable"}, ascii_only=True).endswith(
        "left stable -> warning  (rotation, tipping)"
    )


anything = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64) | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@given(
    st.sampled_from(
        [
            ("slip.left", RIG["slip.left"]),
            ("tactile.left", PAD),
            ("status", STATUS),
            ("gripper", GRIPPER),
            ("status", {"streams": {"a": 1}}),
        ]
    ),
    st.data(),
)
def test_a_field_of_any_kind_can_be_drawn(message: tuple[str, dict[str, Any]], data: st.DataObject) -> None:
    topic, body = message
    changed = body | {data.draw(st.sampled_from(sorted(body))): data.draw(anything)}
    view = LiveView()
    view.update("slip.left", RIG["slip.left"])
    view.update("tactile.left", PAD)
    view.update("status", STATUS | {"streams": {"left.wrench": STREAM | {"health": data.draw(anything)}}})
    view.update(topic, changed)
    assert view.render(Terminal(80, colour=True))
    assert view.summary()
    assert change_line(changed)
