"""What the view in a terminal of any size shows of fingers, pads, gripper, streams and recordings."""

from __future__ import annotations

import re
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slipd_client.live_view import LiveView, change_line
from slipd_client.messages import LEVELS, Health
from slipd_client.messages.fields import FLAG, HEALTH, INTEGER, LEVEL, NUMBER, PAIR, TEXT, fields_of
from slipd_client.messages.parts import StreamStatus
from slipd_client.messages.topics import TOPICS
from slipd_client.terminal import Terminal

Bodies = dict[str, dict[str, Any]]

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
RIG: dict[str, dict[str, Any]] = {
    "slip.left": SLIP | {"centroid_m": [0.0, 0.0064], "pole_m": [0.004, 0.2]},
    "slip.right": SLIP | {"finger": "right", "level": "slipping", "evidence": ["load_drop"]},
    "gripper": GRIPPER,
    "status": STATUS
    | {
        "streams": {
            f"{f}.{s}": STREAM | {"health": 0, "message": ""} for f in ("left", "right") for s in ("wrench", "pad")
        }
    },
}


def viewed(bodies: Bodies) -> LiveView:
    view = LiveView()
    for topic, body in bodies.items():
        view.update(topic.replace("_", "."), body)
    return view


def drawn(silent_s: float = 0.0, **bodies: dict[str, Any]) -> str:
    return "\n".join(viewed(bodies).render(Terminal(200), silent_s))


def rig(terminal: Terminal, silent_s: float = 0.0, **more: dict[str, Any]) -> list[str]:
    return viewed(RIG | more).render(terminal, silent_s)


UNKNOWN = dict.fromkeys(("mu", "utilisation", "utilisation_lower", "utilisation_upper"))
GROWN = {"required_friction": 0.306, "carried_friction": 0.36, "relative_utilisation": 0.85}
MOVING = {"reasons": ["no_mu"], "evidence": ["load_drop", "width"]}
FILE = "/state/a.mcap"
QUIET = STATUS | {"streams": {}}
TARED = {"level": "stable", "tare_id": 2, "tare_busy": False, "mu": 0.5, "mu_source": "config"}


@pytest.mark.parametrize(
    ("bodies", "shown"),
    [
        ({}, r"slipd –  up –  lease –$"),
        (
            {"silent_s": 5.0, "slip_left": SLIP | {"level": "stable"}},
            r"^no message for 5.0 s(?![\s\S]*STABLE)[\s\S]*UNKNOWN",
        ),
        ({"slip_left": SLIP}, r"left +WARNING +λ +0\.50 +█{10}▒{5}·{5} +0\.50 to 0\.75  normal 10\.12 N  "),
        ({"slip_left": SLIP}, r"tangential 3.50 N  spin 0.0123 N·m  mu 0.60  needs 14.2 N\n +rotation, tipping$"),
        ({"slip_left": SLIP | UNKNOWN | {"utilisation_upper": 0.4}}, r"λ ≤0\.40 +▒{8}·{12}  normal"),
        ({"slip_left": SLIP | UNKNOWN | {"utilisation_lower": 1.2}}, r"λ ≥1\.20 "),
        ({"slip_left": SLIP | UNKNOWN}, r"λ +– +·{20} .* mu –  needs"),
        ({"slip_left": SLIP | UNKNOWN | GROWN}, r"WARNING +λr +0\.85 +▒{17}·{3} .*mu –  requires 0.31 of 0.36 carried"),
        ({"slip_left": SLIP | {"utilisation": 7.0, "utilisation_upper": 9.0}}, r"█{20}  0\.50 to 9\.00  normal"),
        ({"slip_left": SLIP | {"mu_source": "learned", "required_friction": 0.3}}, r"mu 0\.60 learned  needs"),
        ({"slip_left": SLIP | {"force_unit": "uncalibrated"}}, r"normal 10\.12  tangential 3\.50  spin 0\.0123  mu"),
        ({"slip_left": SLIP | MOVING}, r"no_mu  moves by load_drop, width$"),
        ({"slip_left": SLIP, "status": STATUS}, r"\nleft +WARNING"),
        ({"status": STATUS}, r"^slipd 0\.1\.0  up 75 s  config 3f2a  lease held\nleft +CAUTION +λ +– "),
        (
            {"status": STATUS | {"fingers": {}}},
            r"\n1 to repair.*\nwarning +stream-degraded  left\.wrench:  3 bad frames\n +slipctl watch\n"
            r"left\.wrench +WARN +998 Hz of 1000 Hz  age 2 ms  bad 3  lost 0  reconnects 2$",
        ),
        (
            {"status": STATUS | {"fingers": {}, "streams": {"left.pad": STREAM | {"health": 0, "message": ""}}}},
            r"nothing to repair\nleft\.pad +OK +998 Hz of 1000 Hz  age 2 ms  bad 3  lost 0  reconnects 2$",
        ),
        (
            {"status": {"streams": {"left.pad": STREAM | {"message": "the daemon was late by 0.02 s"}}}},
            r"nothing to repair\nleft\.pad +WARN .* reconnects 2  the daemon was late by 0\.02 s$",
        ),
        ({"status": STATUS | {"object_name": "mug"}}, r"lease held  object mug\n"),
        ({"status": STATUS | {"fingers": {"left": TARED}}}, r"left +STABLE +tare 2  mu 0\.50 config"),
        ({"gripper": GRIPPER}, r"width 42\.5 mm  force 12\.0 N of at most 40\.0 N  at rest  object contact_closing$"),
        ({"status": {"gripper": GRIPPER}}, r"force 12\.0 N of at most 40\.0 N"),
        (
            {"gripper": GRIPPER | {"fault": "hot", "latched_fault": "no_echo", "echo_ok": False, "moving": None}},
            r"40\.0 N  –  object contact_closing  fault hot  does not repeat the command$",
        ),
        ({"status": QUIET | {"recording": {"running": True, "path": FILE}}}, rf"\nrecording +{FILE}\n"),
        (
            {"status": QUIET | {"run_recording": {"running": True, "path": FILE, "lost": 9}}},
            rf"\nrecording +of the whole run  {FILE}  9 entries lost\n",
        ),
        ({"status": QUIET | {"run_recording": {"state": "failed", "failure": "full"}}}, "recording-failed .* full\n"),
    ],
)
def test_what_each_message_shows_and_of_a_silent_daemon_no_level(bodies: dict[str, Any], shown: str) -> None:
    assert re.search(shown, drawn(**bodies))


@pytest.mark.parametrize(
    ("bodies", "hidden"),
    [
        ({"gripper": GRIPPER}, "fault|echo|latched"),
        ({"status": {"gripper": None}}, "gripper"),
        ({"status": QUIET | {"recording": {"state": "stopped", "path": FILE, "failure": None}}}, "recording"),
        ({"status": STATUS}, "incidents|object"),
        ({"status": {key: value for key, value in STATUS.items() if key != "config_id"}}, "config"),
    ],
)
def test_what_is_not_so_is_not_shown(bodies: Bodies, hidden: str) -> None:
    assert not re.search(hidden, drawn(**bodies))


@pytest.mark.parametrize("field", ["normal_n", "tangential_n", "spin_nm", "mu", "grip_needed_n"])
def test_a_quantity_that_is_not_known_is_a_dash_and_never_zero(field: str) -> None:
    assert drawn(slip_left=SLIP | {field: None}).count("–") == 1 + drawn(slip_left=SLIP).count("–")


def test_a_text_of_the_daemon_cannot_steer_the_terminal() -> None:
    hostile = "\x1b[2J\n\x9b5m"
    view = LiveView()
    view.update("status", {"version": hostile, "streams": {hostile: STREAM | {"message": hostile}}})
    view.update("gripper", GRIPPER | {"fault": hostile, "object": hostile})
    view.update(f"slip.{hostile}", SLIP | {"level": hostile, "reasons": [hostile]})
    assert all(line.isprintable() for line in [*view.render(Terminal(500)), view.summary()])
    assert change_line(SLIP | {"previous": hostile, "finger": hostile}).isprintable()


def test_fingers_and_grippers_that_the_daemon_no_longer_has_vanish() -> None:
    view = LiveView()
    for topic in ("slip.left", "slip.right", "slip.thumb", "gripper"):
        view.update(topic, {**SLIP, **GRIPPER, "boot": "one"})
    view.update("status", STATUS | {"boot": "one", "gripper": None})
    text = "\n".join([*view.render(Terminal(200)), view.summary()])
    assert not re.search("thumb|gripper", text)
    assert re.findall("^(left|right) ", text, re.MULTILINE) == ["left", "right"]
    view.update("slip.index", SLIP | {"boot": "two"})
    assert "left" not in "\n".join(view.render(Terminal(200))), "another run of the daemon"


@pytest.mark.parametrize(
    ("body", "line"),
    [
        (SLIP | {"previous": "stable"}, r"\d\d\.250  left stable → warning  \(rotation, tipping\)"),
        (SLIP | MOVING | {"previous": "stable"}, r".*\(no_mu; moves by load_drop, width\)"),
        ({}, "–  – – → –"),
        *(({"timestamp": no_time}, "–  – – → –") for no_time in (0.0, 1e300, float("inf"))),
    ],
)
def test_a_change_of_level_is_one_line(body: dict[str, Any], line: str) -> None:
    assert re.fullmatch(rf"(\d\d:\d\d:)?{line}", change_line(body))


@pytest.mark.parametrize(
    ("columns", "lines", "left_out"),
    [
        (200, 60, ""),
        (80, 14, "streams"),
        (80, 11, "streams, forces"),
    ],
)
def test_two_fingers_and_a_gripper_fit_and_what_does_not_is_named(columns: int, lines: int, left_out: str) -> None:
    shown = rig(Terminal(columns, lines))
    text = "\n".join(shown)
    assert len(shown) <= lines
    assert ("left out" in text, left_out in " ".join(shown[-2:])) == (bool(left_out), True)
    assert ("WARNING" in shown[1], "SLIPPING" in text) == (True, True)
    parts = ("normal 10.12 N", "tangential 3.50 N", "spin 0.0123 N·m", "needs 14.2 N", "6.4 mm", "200.0 mm")
    assert {part in text for part in parts} == {"forces" not in left_out}


REASONS = next(field.kind for field in fields_of(TOPICS["slip"]) if field.name == "reasons")
FINITE = st.floats(allow_nan=False, allow_infinity=False)
OF_KIND = {
    NUMBER: st.none() | FINITE | st.integers(-(2**63), 2**64),
    INTEGER: st.none() | st.integers(-(2**63), 2**64),
    TEXT: st.none() | st.text(max_size=5),
    FLAG: st.none() | st.booleans(),
    PAIR: st.none() | st.lists(FINITE, min_size=2, max_size=2),
    LEVEL: st.sampled_from([*LEVELS]),
    HEALTH: st.sampled_from([*Health]),
    REASONS: st.none() | st.lists(st.text(max_size=5), max_size=3),
}


def changed(cls: type[Any], body: dict[str, Any]) -> st.SearchStrategy[dict[str, Any]]:
    """The body of a message, or part of one, with whatever may be in one of its fields; nil where it is a map."""
    kinds = {field.name: field.kind for field in fields_of(cls) if field.name in body}
    return st.sampled_from(sorted(kinds)).flatmap(
        lambda name: OF_KIND.get(kinds[name], st.none()).map(lambda value: {**body, name: value})
    )


@settings(max_examples=40)
@given(
    st.sampled_from([*RIG, "status"]),
    st.builds(Terminal, st.integers(1, 120), st.integers(1, 60), st.booleans()),
    st.data(),
)
def test_whatever_a_field_may_have_is_drawn_within_the_terminal(
    topic: str, terminal: Terminal, data: st.DataObject
) -> None:
    view = viewed(RIG)
    view.update("status", STATUS | {"streams": {"left.wrench": data.draw(changed(StreamStatus, STREAM))}})
    view.update(topic, data.draw(changed(TOPICS[topic.partition(".")[0]], RIG[topic])))
    lines = [re.sub(r"\x1b\[[0-9;]*m", "", line) for line in view.render(terminal)]
    assert 0 < len(lines) <= terminal.lines
    assert max(map(len, lines)) <= terminal.columns
    assert view.summary()


LONG = "no such port: /dev/serial/by-id/usb-Bota_Systems_AG_SensONE_ABC123; tries again every second; is it plugged in?"


def test_on_a_small_terminal_the_repairs_stay_in_full() -> None:
    ill = {f"f{n}.wrench": STREAM | {"health": 2, "message": LONG} for n in (7, 8)}
    shown = rig(Terminal(80, 22), status=STATUS | {"streams": ill})
    assert re.sub(r"\s+", "", LONG) in re.sub(r"\s+", "", "".join(shown))
    assert shown[-1] == "left out in 80 x 22: streams"
    assert rig(Terminal(60, 3))[-1] == "12 more lines do not fit in 60 x 3"
