from __future__ import annotations

import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd_client.live_view import LiveView, Terminal, change_line
from slipd_client.live_view_format import clock_time
from slipd_client.live_view_lines import LEVEL_COLOURS
from slipd_client.messages import LEVELS

SLIP: dict[str, Any] = {
    "finger": "left",
    "level": "warning",
    "reasons": ["rotation", "tipping"],
    "normal_n": 10.125,
    "tangential_n": [-2.1, 2.8],
    "spin_nm": 0.0123,
    "mu": 0.6,
    "utilisation": 0.5,
    "utilisation_lower": 0.5,
    "utilisation_upper": 0.75,
    "grip_needed_n": 14.25,
    "timestamp": 1_700_000_000.25,
}
STREAM: dict[str, Any] = {
    "health": 1,
    "message": "3 bad frames",
    "expected_hz": 1000.0,
    "rate_hz": 998.4,
    "age_s": 0.0015,
    "bad": 3,
    "lost": 0,
    "reconnects": 2,
}
STATUS: dict[str, Any] = {
    "version": "0.1.0",
    "uptime_s": 75.0,
    "config_id": "3f2a",
    "fingers": {"left": {"level": "caution"}, "right": {"level": "unknown"}},
    "streams": {"left.wrench": STREAM},
    "lease": {"held": True, "expires_in_s": 0.1},
}
GRIPPER: dict[str, Any] = {
    "width_m": 0.0425,
    "force_command_n": 12.0,
    "force_limit_n": 40.0,
    "object": "contact_closing",
    "moving": False,
    "fault": "",
    "echo_ok": True,
}


def drawn(width: int = 200, silent_s: float = 0.0, **bodies: dict[str, Any]) -> str:
    view = LiveView()
    for topic, body in bodies.items():
        view.update(topic.replace("_", "."), body)
    return "\n".join(view.render(Terminal(width), silent_s))


def test_a_finger_shows_level_utilisation_forces_and_reasons() -> None:
    text = drawn(slip_left=SLIP)
    assert re.search(r"left +WARNING +λ +0\.50 +█{10}▒{5}·{5} +0\.50 to 0\.75 ", text)
    for part in ("normal 10.12 N", "tangential 3.50 N", "spin 0.0123 N·m", "mu 0.60", "needs 14.2 N"):
        assert part in text
    assert text.endswith("rotation, tipping")


@pytest.mark.parametrize("field", ["normal_n", "tangential_n", "spin_nm", "mu", "grip_needed_n"])
@pytest.mark.parametrize("unknown", [None, [], [None, 1.0]])
def test_a_quantity_that_is_not_known_is_a_dash_and_never_zero(field: str, unknown: Any) -> None:
    assert drawn(slip_left=SLIP | {field: unknown}).count("–") == 1 + drawn(slip_left=SLIP).count("–")


@pytest.mark.parametrize(
    ("known", "shown"),
    [
        ({}, "–"),
        ({"utilisation_upper": 0.4}, "≤0.40"),
        ({"utilisation_lower": 1.2}, "≥1.20"),
        ({"utilisation": 0.3, "utilisation_upper": 0.4}, "0.30"),
    ],
)
def test_a_bounded_utilisation_shows_its_bound(known: dict[str, float], shown: str) -> None:
    text = drawn(slip_left={"finger": "left", "level": "unknown", **known})
    assert re.search(rf"λ +{shown} ", text)


def test_without_a_coefficient_the_relative_utilisation_is_shown() -> None:
    unknown = {
        "mu": None,
        "mu_source": "none",
        "utilisation": None,
        "utilisation_lower": None,
        "utilisation_upper": None,
    }
    grown = {"required_friction": 0.306, "carried_friction": 0.36, "relative_utilisation": 0.85}
    text = drawn(slip_left=SLIP | unknown | grown)
    assert re.search(r"left +WARNING +λr +0\.85 +▒{17}·{3} ", text)
    assert "mu – none  requires 0.31 of 0.36 carried  needs 14.2 N" in text
    assert re.search(r"λ +– +·{20} .* mu – none  needs", drawn(slip_left=SLIP | unknown)), "nothing carried yet"


def test_the_source_of_the_coefficient_is_shown() -> None:
    assert "mu 0.60 learned  needs" in drawn(slip_left=SLIP | {"mu_source": "learned", "required_friction": 0.3})
    finger = {"level": "stable", "tare_id": 2, "tare_busy": False, "mu": 0.5, "mu_source": "config"}
    assert "tare 2  mu 0.50 config" in drawn(status=STATUS | {"fingers": {"left": finger}})


def test_the_evidence_of_motion_is_shown_after_the_reasons() -> None:
    moving = {"reasons": ["no_mu"], "evidence": ["load_drop", "width"]}
    assert drawn(slip_left=SLIP | moving).endswith("no_mu  moves by load_drop, width")
    assert drawn(slip_left=SLIP | moving | {"reasons": []}).endswith("\n          moves by load_drop, width")
    assert change_line(SLIP | moving | {"previous": "stable"}).endswith("(no_mu; moves by load_drop, width)")


def test_the_named_object_is_shown() -> None:
    assert drawn(status=STATUS | {"object_name": "mug"}).splitlines()[0].endswith("lease held  object mug")


def test_a_utilisation_beyond_one_fills_the_bar_and_no_more() -> None:
    assert "█" * 20 + "  0.50 to 9.00  normal" in drawn(slip_left=SLIP | {"utilisation": 7.0, "utilisation_upper": 9.0})


def test_an_empty_daemon_is_all_dashes() -> None:
    assert drawn() == "slipd –  up –  lease –"


def test_status_shows_the_daemon_its_fingers_and_its_streams() -> None:
    lines = drawn(status=STATUS).splitlines()
    assert lines[0] == "slipd 0.1.0  up 75 s  config 3f2a  lease held"
    reply = {key: value for key, value in STATUS.items() if key != "config_id"}
    assert drawn(status=reply).splitlines()[0] == "slipd 0.1.0  up 75 s  lease held"
    assert re.match(r"left +CAUTION +λ +– ", lines[1])
    assert re.match(r"right +UNKNOWN +λ +– ", lines[2])
    assert re.match(r"left\.wrench +WARN +998 Hz of 1000 Hz  age 2 ms  bad 3  lost 0  reconnects 2", lines[3])
    assert lines[3].endswith("3 bad frames")


def test_the_verdict_of_a_finger_stands_above_what_status_tells_of_it() -> None:
    assert "WARNING" in drawn(slip_left=SLIP, status=STATUS).splitlines()[1]


def test_the_gripper_shows_width_force_and_limit() -> None:
    text = drawn(gripper=GRIPPER)
    assert "width 42.5 mm  force 12.0 N of at most 40.0 N  at rest  object contact_closing" in text
    assert "fault" not in text
    assert "echo" not in text


def test_the_gripper_shows_its_fault_and_a_missing_echo() -> None:
    text = drawn(gripper=GRIPPER | {"fault": "overcurrent", "echo_ok": False, "width_m": None, "moving": None})
    assert "fault overcurrent  does not repeat the command" in text
    assert "width –" in text
    assert "at rest" not in text


def test_a_latched_fault_is_shown_until_it_is_acknowledged() -> None:
    assert "latched: no_echo" in drawn(gripper=GRIPPER | {"latched_fault": "no_echo"})
    assert "latched" not in drawn(gripper=GRIPPER | {"latched_fault": ""})


def test_status_alone_shows_the_gripper_too() -> None:
    assert "force 12.0 N of at most 40.0 N" in drawn(status={"gripper": GRIPPER})
    assert "gripper" not in drawn(status={"gripper": None})


def test_a_silent_daemon_has_no_level() -> None:
    text = drawn(slip_left=SLIP | {"level": "stable"}, silent_s=5.0)
    assert text.startswith("no message for 5.0 s")
    assert "STABLE" not in text
    assert "UNKNOWN" in text


def test_every_level_has_a_colour_of_its_own() -> None:
    assert set(LEVEL_COLOURS) == set(LEVELS)
    assert len(set(LEVEL_COLOURS.values())) == len(LEVELS)


@pytest.mark.parametrize("level", LEVELS)
def test_the_level_is_drawn_in_its_colour(level: str) -> None:
    view = LiveView()
    view.update("slip.left", SLIP | {"level": level})
    assert f"\x1b[{LEVEL_COLOURS[level]}m{level.upper()}" in view.render(Terminal(200, colour=True))[1]


@given(st.integers(0, 120))
def test_no_line_is_wider_than_the_terminal_in_either_mode(width: int) -> None:
    view = LiveView()
    for topic, body in (("slip.left", SLIP), ("status", STATUS), ("gripper", GRIPPER)):
        view.update(topic, body)
    plain, coloured = view.render(Terminal(width)), view.render(Terminal(width, colour=True))
    stripped = [re.sub(r"\x1b\[[0-9;]*m", "", line).rstrip() for line in coloured]
    assert stripped == plain
    assert max(map(len, plain)) <= width


def test_a_text_of_the_daemon_cannot_steer_the_terminal() -> None:
    hostile = "\x1b[2J\n\x9b5m"
    bodies = {
        "status": {"version": hostile, "streams": {hostile: STREAM | {"message": hostile}}},
        "gripper": GRIPPER | {"fault": hostile, "object": hostile},
        f"slip.{hostile}": SLIP | {"level": hostile, "reasons": [hostile]},
    }
    view = LiveView()
    for topic, body in bodies.items():
        view.update(topic, body)
    assert all(line.isprintable() for line in [*view.render(Terminal(500)), view.summary()])
    assert change_line(SLIP | {"previous": hostile, "finger": hostile}).isprintable()


def test_a_finger_that_the_daemon_no_longer_has_vanishes() -> None:
    view = LiveView()
    for finger in ("left", "right", "thumb"):
        view.update(f"slip.{finger}", SLIP | {"finger": finger, "boot": "one"})
    view.update("gripper", GRIPPER | {"boot": "one"})
    view.update("status", STATUS | {"boot": "one", "gripper": None})
    text = "\n".join(view.render(Terminal(200)))
    assert "thumb" not in text
    assert "thumb" not in view.summary()
    assert re.search("^left", text, re.MULTILINE)
    assert re.search("^right", text, re.MULTILINE)
    assert "gripper" not in text


def test_what_another_run_of_the_daemon_said_vanishes() -> None:
    view = LiveView()
    view.update("slip.thumb", SLIP | {"boot": "one"})
    view.update("gripper", GRIPPER | {"boot": "one"})
    view.update("slip.left", SLIP | {"boot": "two"})
    text = "\n".join(view.render(Terminal(200)))
    assert "thumb" not in text
    assert "gripper" not in text
    assert "left" in text


LONG = "no such port: /dev/serial/by-id/usb-Bota_Systems_AG_SensONE_ABC123; tries again every second; is it plugged in?"


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


@pytest.mark.parametrize(
    ("recording", "shown"),
    [
        ({"running": True, "state": "running", "path": "/state/a.mcap", "lost": 0}, r"OK +/state/a\.mcap$"),
        (
            {"running": True, "state": "running", "path": "/state/a.mcap", "lost": 9},
            r"OK +/state/a\.mcap +9 entries lost$",
        ),
        (
            {"state": "failed", "path": "/state/a.mcap", "failure": "/state/a.mcap: full"},
            r"FAILED +/state/a\.mcap: full$",
        ),
        (
            {"state": "limited", "path": "/state/a.mcap", "failure": "/state/a.mcap: max"},
            r"ENDED +/state/a\.mcap: max$",
        ),
        ({"running": False, "name": "a.mcap", "failure": "of an older daemon"}, r"FAILED +of an older daemon$"),
        ({"state": "stopped", "path": "/state/a.mcap", "failure": None}, None),
        ({"state": "none"}, None),
    ],
)
def test_a_recording_is_shown_with_its_path_while_it_runs_and_where_it_failed(
    recording: dict[str, Any], shown: str | None
) -> None:
    text = drawn(status=STATUS | {"recording": recording})
    assert bool(re.search("^recording", text, re.MULTILINE)) == (shown is not None)
    if shown is not None:
        assert re.search(r"^recording +" + shown, text, re.MULTILINE)
        whole_run = drawn(status=STATUS | {"run_recording": recording})
        assert re.search("^recording", whole_run, re.MULTILINE)
        assert ("of the whole run" in whole_run) == (not recording.get("failure"))


def test_forces_without_calibration_are_not_shown_as_newtons() -> None:
    body = SLIP | {"force_unit": "uncalibrated"}
    view = LiveView()
    view.update("slip.left", body)
    text = view.render(Terminal(200))[1]
    assert "normal 10.12  tangential 3.50  spin 0.0123  mu 0.60  needs 14.2" in text
    assert view.summary().endswith("λ 0.50 10.12")


PAD: dict[str, Any] = {
    "finger": "left",
    "rows": 8,
    "cols": 16,
    "pitch_m": 0.0032,
    "image_ok": True,
    "loads_n": [0.0] * 64 + [0.5] * 64,
}
RIG: dict[str, dict[str, Any]] = {
    "slip.left": SLIP | {"centroid_m": [0.0, 0.0064], "pole_m": [0.004, 0.2]},
    "slip.right": SLIP | {"finger": "right", "level": "slipping", "evidence": ["load_drop"]},
    "tactile.left": PAD,
    "tactile.right": PAD | {"finger": "right"},
    "gripper": GRIPPER,
    "status": STATUS
    | {
        "streams": {
            f"{f}.{s}": STREAM | {"health": 0, "message": ""} for f in ("left", "right") for s in ("wrench", "pad")
        }
    },
}


def rig(terminal: Terminal, silent_s: float = 0.0, **more: dict[str, Any]) -> list[str]:
    view = LiveView()
    for topic, body in (RIG | {key.replace("_", "."): body for key, body in more.items()}).items():
        view.update(topic, body)
    return view.render(terminal, silent_s)


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


def test_the_summary_names_every_finger_in_one_line() -> None:
    view = LiveView()
    assert view.summary() == "–  no verdict yet"
    view.update("slip.left", SLIP)
    view.update(
        "slip.right", SLIP | {"level": "stable", "utilisation": None, "utilisation_upper": None, "normal_n": None}
    )
    time_of_day, left, right = re.fullmatch(r"(\S+)  (.*)  \|  (.*)", view.summary()).groups()
    assert time_of_day.endswith(".250")
    assert (left, right) == ("left warning λ 0.50 10.12 N", "right stable λ ≥0.50 –")


def test_a_change_of_level_is_one_line() -> None:
    line = change_line(SLIP | {"previous": "stable", "rising": True})
    assert line.endswith("  left stable → warning  (rotation, tipping)")
    assert change_line({}) == "–  – – → –"


def test_a_time_out_of_range_is_a_dash() -> None:
    assert [clock_time(value) for value in (0.0, 1e300, float("inf"))] == ["–", "–", "–"]
