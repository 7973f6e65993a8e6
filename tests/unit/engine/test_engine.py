"""Contracts of the whole engine, with the bytes that real devices send."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from engine_rig import wrench_of

from slipd.devices import bota, xela
from slipd.devices.wsg import wsg_messages
from slipd.engine.warm_up import warm_up
from slipd.events import Bytes, Publish, Write
from slipd_client.messages import MESSAGE_LIMITS, Health, decode, encode

FULL = np.full((4, 4), 100)
EMPTY = np.zeros((4, 4), dtype=int)
Run = Any

WSG = """
[gripper]
device = "wsg"
port = "tcp://127.0.0.1:1000"
rate_hz = 50.0
max_force_n = 25.0
"""

CONTACTS: dict[str, list[tuple[Any, ...]]] = {
    "no_contact": [(0.0,)],
    "stable": [(10.0, (1.0, 0.0))],
    "caution": [(10.0, (3.75, 0.0))],
    "warning": [(10.0, (4.6, 0.0))],
    "slipping": [(10.0, (2.0 + 0.005 * k if k < 580 else 3.9, 0.0)) for k in range(620)],
    "unknown": [(math.nan,)],
}
"""One reading that brings the left finger to each level; "slipping" needs a pull that grows and falls."""


def changes(run: Run, finger: str = "left") -> list[tuple[str, str, bool]]:
    warnings = [body for body in run.published("warning") if body["finger"] == finger]
    return [(body["previous"], body["level"], body["rising"]) for body in warnings]


def test_a_reading_is_published_in_the_call_that_brings_its_bytes(run: Run) -> None:
    run.image()
    out = run.wrench(10.0, (1.0, 0.0))
    published = [output for output in out if isinstance(output, Publish)]
    assert [message.topic for message in published] == ["warning", "slip.left", "wrench.left"]
    assert {message.body["t_ns"] for message in published} == {run.t_ns}


def test_L11_bytes_that_trickle_in_are_no_stream(run: Run) -> None:
    run.image()
    run.wrench(10.0, (1.0, 0.0))
    run.image()
    assert run.level()[0] == "stable"
    frame = bota.encode_frame(*wrench_of(10.0), 0)
    for byte in frame[:-1]:
        run.wait(5)
        run.image()
        run.feed(Bytes("left.wrench", bytes((byte,))))
        run.tick()
    assert run.level() == ("unknown", ["stale"])


def test_farewell_is_sent_to_devices_with_commands_and_moves_nothing(
    run: Run, make_run: Callable[[str], Run], left: str
) -> None:
    """A WSG treats a connection that breaks as a fault, and stops."""
    assert run.engine.farewell() == [Write("left.wrench", bota.CONFIGURE)]
    wsg = make_run(left + WSG)
    wsg.up("gripper")
    assert wsg.engine.farewell() == [Write("gripper", wsg_messages.encode(wsg_messages.DISCONNECT))]


@pytest.mark.parametrize("level", CONTACTS)
def test_every_level_is_reached_from_bytes_of_the_sensor(run: Run, level: str) -> None:
    run.image()
    run.wrench(0.0)
    for contact in CONTACTS[level]:
        run.wrench(*contact)
    assert run.level()[0] == level
    assert run.published("slip.left")[-1]["level_code"] == list(CONTACTS).index(level)


def test_every_change_of_level_is_published_at_once_with_the_previous_level(run: Run) -> None:
    levels = ("no_contact", "stable", "stable", "caution", "warning", "caution", "unknown", "stable", "no_contact")
    for n, level in enumerate(levels):
        for k in range(4 if n in (5, 7) else 1):  # a level is left after a while
            run.wait(100)
            run.image(np.full((4, 4), 100) + (n + k) % 2)  # a pad that repeats itself while the force moves hangs
            run.wrench(*CONTACTS[level][0])
    assert changes(run) == [
        ("unknown", "no_contact", False),
        ("no_contact", "stable", True),
        ("stable", "caution", True),
        ("caution", "warning", True),
        ("warning", "caution", False),
        ("caution", "unknown", False),
        ("unknown", "caution", True),
        ("caution", "stable", False),
        ("stable", "no_contact", False),
    ]
    assert {body["frame"] for body in run.published("warning")} == {"left_pad"}


def test_unknown_is_worse_than_stable(run: Run) -> None:
    run.image()
    for level in ("stable", "unknown"):
        run.wrench(*CONTACTS[level][0])
    assert changes(run)[-1] == ("stable", "unknown", True)


def test_a_warning_carries_reasons_and_utilisation(run: Run) -> None:
    run.image()
    run.wrench(10.0, (4.6, 0.0))
    body = run.published("warning")[-1]
    assert body["reasons"] == ["translation"]
    assert body["utilisation"] == pytest.approx(0.92, rel=1e-5)
    assert body["level_code"] == 3
    run.wrench(0.0)
    assert run.published("warning")[-1]["utilisation"] is None


def test_the_utilisation_of_a_contact_that_no_grip_holds_is_nil(run: Run) -> None:
    one = np.zeros((4, 4), dtype=int)
    one[1, 1] = 100
    run.image(one)
    run.wrench(10.0, (0.0, 0.0), 0.01, (-0.002, -0.002))
    body = run.published("warning")[-1]
    assert body["reasons"][0] == "unsupportable"
    assert body["utilisation"] is None


def test_a_pad_that_measures_the_force_gives_verdicts_too(run: Run) -> None:
    for contact, level in (((0.0,), "no_contact"), ((8.0, (1.0, 0.0)), "stable"), ((8.0, (3.6, 0.0)), "warning")):
        run.skin(*contact)
        assert run.level("right")[0] == level
    assert run.published("slip.right")[-1]["model"] == "exact"
    assert run.published("wrench.right")[-1]["force_n"] == pytest.approx([3.6, 0.0, -8.0])
    assert run.published("tactile.right")[-1]["loads_n"] == pytest.approx([2.0] * 4)


def test_messages_of_each_topic_are_numbered_without_gaps_and_share_one_boot(run: Run) -> None:
    for k in range(50):
        run.image()
        run.wrench(10.0, (0.1 * k, 0.0))
        run.skin(5.0)
        run.serve_gripper(5)
    by_topic: dict[str, list[int]] = {}
    for _, output in run.out:
        if isinstance(output, Publish):
            by_topic.setdefault(output.topic, []).append(output.body["seq"])
            assert output.body["boot"] == "b00t"
    assert set(by_topic) == {
        *("slip.left", "wrench.left", "tactile.left", "slip.right", "wrench.right", "tactile.right"),
        *("gripper", "status", "warning"),
    }
    for numbers in by_topic.values():
        assert numbers == list(range(len(numbers)))


def test_the_timestamp_of_a_message_is_the_wall_time_of_its_readings(run: Run) -> None:
    run.wrench(0.0)
    body = run.published("slip.left")[-1]
    assert body["timestamp"] == pytest.approx(1_700_000_000 + run.t_ns * 1e-9, abs=1e-5)


def test_rates_are_limited_by_the_time_of_the_readings(run: Run) -> None:
    for k in range(1000):
        if k % 5 == 0:
            run.image()
        run.wrench(10.0, (1.0, 0.0))
    count = Counter(output.topic for _, output in run.out if isinstance(output, Publish))
    assert count["slip.left"] == pytest.approx(250, abs=2)
    assert count["wrench.left"] == pytest.approx(250, abs=2)
    assert count["tactile.left"] == pytest.approx(50, abs=2)


def test_a_rate_may_be_raised_until_every_reading_is_published(make_run: Callable[[str], Run], left: str) -> None:
    run = make_run(left + "[rates]\nslip_hz = 1000.0\nwrench_hz = 100.0\n")
    for _ in range(500):
        run.wrench(0.0)
    assert len(run.published("slip.left")) == 500
    assert len(run.published("wrench.left")) == pytest.approx(50, abs=1)


def test_every_reading_gets_a_verdict_whatever_is_published(run: Run) -> None:
    run.image()
    for pull in (3.0, 3.75, 4.3):  # within 3 ms; at 250 Hz one of them would be published
        run.wrench(10.0, (pull, 0.0))
    assert [level for _, level, _ in changes(run)] == ["stable", "caution", "warning"]
    assert [body["level"] for body in run.published("slip.left")] == ["stable", "caution", "warning"]


def test_status_is_published_once_a_second_and_when_a_link_changes(run: Run) -> None:
    before = len(run.published("status"))
    for _ in range(1000):
        run.wait(5)
        run.tick()
    assert len(run.published("status")) - before == pytest.approx(5, abs=1)
    run.down("left.pad")
    run.up("left.pad")
    assert [body["streams"]["left.pad"]["health"] for body in run.published("status")[-2:]] == [
        Health.ERROR,
        Health.STALE,
    ]
    body = run.published("status")[-1]
    assert set(body["streams"]) == {"left.wrench", "left.pad", "right.pad", "gripper"}
    assert body["uptime_s"] == pytest.approx(5.0)
    state = {"level": "unknown", "reasons": ["stale"], "evidence": [], "tare_id": 0, "tare_busy": False}
    low, high = pytest.approx(0.4242, abs=1e-4), pytest.approx(0.5894, abs=1e-4)
    friction = {"mu": 0.5, "mu_source": "config", "mu_low": low, "mu_high": high, "mu_d": None}
    assert body["fingers"]["left"] == state | friction | {"mu_by": None, "mu_t_ns": None}
    assert (body["object_name"], body["object_by"], body["object_t_ns"]) == (None, None, None)


def test_a_lost_force_sensor_makes_its_finger_unknown_at_once(run: Run) -> None:
    run.image()
    run.wrench(10.0, (1.0, 0.0))
    out = run.down("left.wrench")
    assert next(output.topic for output in out if isinstance(output, Publish)) == "warning"
    assert run.level() == ("unknown", ["stale"])
    assert run.published("status")[-1]["streams"]["left.wrench"]["message"] == "unplugged"


def test_a_lost_server_makes_every_finger_on_it_unknown(make_run: Callable[[str], Run], right: str) -> None:
    twin = right.replace("finger.right", "finger.third").replace('"2"', '"1"')
    run = make_run(right + twin)
    run.up()
    counts = np.full((4, 3), 1000)
    run.feed(Bytes("right.pad", xela.encode_message(1, {"1": counts, "2": counts}, 1.7e9)))
    assert run.level("right") == run.level("third") == ("no_contact", [])
    run.down("right.pad")
    assert run.level("right") == run.level("third") == ("unknown", ["stale"])


def test_without_its_pad_a_finger_judges_translation_alone(run: Run) -> None:
    run.image()
    run.wrench(10.0, (1.0, 0.0))
    run.down("left.pad")
    run.wrench(10.0, (1.0, 0.0))
    assert run.level() == ("unknown", ["rotation_unobserved"])
    run.wrench(10.0, (4.6, 0.0))
    assert run.level() == ("warning", ["translation"])


def test_silence_of_a_force_sensor_is_noticed_at_a_tick(run: Run) -> None:
    run.image()
    run.wrench(10.0, (1.0, 0.0))
    run.wait(20)
    run.tick()
    assert run.level()[0] == "stable"
    run.wait(1)
    run.tick()
    assert run.level() == ("unknown", ["stale"])
    assert run.published("slip.left")[-1]["age_s"] == pytest.approx(0.021)
    before = len(run.published("warning"))
    run.wait(100)
    run.tick()
    assert len(run.published("warning")) == before


def test_an_overloaded_sensor_makes_the_verdict_unknown(run: Run) -> None:
    run.image()
    run.wrench(10.0, (1.0, 0.0), status=2)
    assert run.level() == ("unknown", ["overload"])
    assert run.published("wrench.left")[-1]["status"] == ["overload"]


def test_the_largest_message_is_within_the_limits_of_a_client(make_run: Callable[[str], Run], left: str) -> None:
    run = make_run(left.replace("rows = 4", "rows = 64").replace("cols = 4", "cols = 64"))
    counts = np.random.default_rng(0).integers(6, 30000, (64, 64))
    run.image(counts)
    body = run.published("tactile.left")[-1]
    assert len(body["loads_n"]) == 4096
    assert decode(encode(body), MESSAGE_LIMITS)["active"] == 4096


def test_unknown_quantities_are_nil_not_zero(run: Run) -> None:
    run.tick()
    run.down("left.wrench")
    body = run.published("slip.left")[-1]
    assert {body[name] for name in ("normal_n", "tangential_n", "utilisation", "pole_m", "grip_needed_n")} == {None}


def test_the_engine_lists_the_links_to_open(run: Run) -> None:
    assert {name: (spec.transport, spec.address) for name, spec in run.engine.links.items()} == {
        "left.wrench": ("serial", "/dev/left-wrench"),
        "left.pad": ("serial", "/dev/left-pad"),
        "right.pad": ("websocket", "ws://127.0.0.1:5000"),
        "gripper": ("serial", "/dev/gripper"),
    }


def test_a_reading_after_the_warm_up_gets_a_verdict(run: Run) -> None:
    warm_up()
    run.image()
    run.wrench(10.0, (1.0, 0.0), 0.001)
    assert run.level()[0] == "stable"


def test_what_relies_on_a_session_that_fails_forgets_it_until_it_reports_again(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def raising(*_: object) -> list[Any]:
        raise KeyError("speed")

    run.bring_up()
    run.grip()
    run.serve_gripper(2000)
    with monkeypatch.context() as patch:
        patch.setattr(run.engine._links["gripper"].session, "receive", raising)
        run.serve_gripper(20)
    body = run.published("gripper")[-1]
    assert (body["width_m"], body["latched_fault"], body["lease"]["held"]) == (None, "link_lost", False)
    run.let_lease_be()
    run.serve_gripper(1100)
    assert run.published("gripper")[-1]["width_m"] is not None
    assert run.writes() == [], "nothing moves"
