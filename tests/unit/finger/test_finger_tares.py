"""Tares of pad and force sensor, each with a zero of its own, and what gives them up. Through the engine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from engine_rig import NO_IMAGE

from slipd.devices.external import encode_reading
from slipd.events import Bytes

Run = Any

EXTERNAL = """
[finger.left]
mu = 0.5

[finger.left.wrench]
device = "external"
port = "ipc:///run/slipd/readings"
sensor = "wrench"
rate_hz = 100.0
stuck_after = 0

[finger.left.pad]
device = "external"
port = "ipc:///run/slipd/readings"
sensor = "pad"
rate_hz = 100.0
rows = 2
cols = 2
pitch_m = 0.004
electrode_m = 0.002
axis_scale = [1.0]
"""


def counts(number: float) -> np.ndarray:
    """An image of the left pad."""
    return np.full((4, 4), number, dtype=int)


def feed(run: Run, times: int, image: float, normal_n: float | None = None) -> None:
    """Give an image of equal counts every 10 ms, and a force before each where one is named."""
    for _ in range(times):
        run.wait(5)
        run.tick()
        if normal_n is not None:
            run.wrench(normal_n, ms=0.0)
        run.wait(5)
        run.image(counts(image))


def tare_of(run: Run, stream: str) -> dict[str, Any]:
    found: dict[str, Any] = run.ask("tare.get", finger="left", stream=stream)["result"]
    return found


@pytest.fixture
def untared(make_run: Callable[..., Run], rig: str) -> Run:
    run = make_run(rig, zeros=False)
    run.up()
    return run


def test_pad_is_tared_and_undone_apart_from_the_force_sensor(run: Run) -> None:
    run.bring_up()
    run.image(counts(4))
    reply = run.ask("tare", finger="left", stream="pad", seconds=0.1)["result"]
    assert reply == {"finger": "left", "seconds": 0.1, "verified": True, "tare_id": 0, "tare_ids": {"pad": 0}}
    assert run.ask("status")["result"]["streams"]["left.pad"]["tare_busy"] is True
    feed(run, 14, 4, 0.0)
    got, other = tare_of(run, "pad"), run.ask("tare.get", finger="left")["result"]
    assert (got["stream"], got["tare_id"], got["busy"], got["by"]) == ("pad", 1, False, "ann")
    assert got["offset"] == pytest.approx([4.0] * 16)
    assert (other["stream"], other["tare_id"]) == ("wrench", 1), "the other tare is unchanged"
    status = run.ask("status")["result"]
    assert (status["streams"]["left.pad"]["tare_id"], status["fingers"]["left"]["tare_id"]) == (1, 1)
    for tare_id, load_n in ((1, 1.0), (0, 1.04)):
        feed(run, 20, 104)
        shown = run.published("tactile.left")[-1]
        assert (shown["tare_id"], shown["loads_n"]) == (tare_id, pytest.approx([load_n] * 16))
        run.lease()  # something presses
        if tare_id == 1:
            undone = run.ask("tare.undo", finger="left", stream="pad")["result"]
            assert (undone["stream"], undone["tare_id"], undone["by"]) == ("pad", 0, "config")
    assert run.refusal("tare.undo", finger="left", stream="pad") == ("not_ready", "finger")
    assert run.ask("tare.get", finger="left")["result"]["tare_id"] == 1


def test_stream_all_tares_both_and_then_each_shows_whether_the_finger_is_free(untared: Run) -> None:
    run = untared
    run.image(counts(300))
    run.wrench(0.2)
    reply = run.ask("tare", finger="left", stream="all", seconds=0.1)["result"]
    assert (reply["verified"], reply["tare_id"], reply["tare_ids"]) == (False, 0, {"wrench": 0, "pad": 0})
    feed(run, 14, 300, 0.2)
    for stream, offset in (("wrench", [0.0, 0.0, -0.2, 0.0, 0.0, 0.0]), ("pad", [300.0] * 16)):
        got = tare_of(run, stream)
        assert (got["tare_id"], got["busy"]) == (1, False), "neither sensor vouches for the zero of the other"
        assert got["offset"] == pytest.approx(offset, abs=1e-6)
    assert run.ask("tare", finger="left", stream="all", seconds=0.1)["result"]["verified"] is True
    for stream in ("wrench", "pad", "wrench"):  # the two in progress, and the one before
        assert run.refusal("tare.undo", finger="left", stream=stream) is None
    run.wrench(0.2)
    run.image(counts(400))
    for stream in ("all", "wrench"):
        assert run.refusal("tare", finger="left", stream=stream) == ("in_contact", "finger"), "the pad shows it"


def test_tare_of_a_charge_pad_keeps_its_loads(make_run: Callable[[str], Run], left: str) -> None:
    loads = []
    for tares in (False, True):
        run = make_run(left + "charge_tau_s = 2.0\n")
        run.up()
        feed(run, 10, 40, 0.0)
        if tares:
            assert run.refusal("tare", finger="left", stream="pad", seconds=0.1) is None
        feed(run, 30, 40, 0.0)
        run.wrench(16.0, ms=0.0)
        feed(run, 20, 140, 16.0)
        assert tare_of(run, "pad")["offset"] == pytest.approx([40.0 if tares else 0.0] * 16)
        loads.append(run.published("tactile.left")[-1]["loads_n"])
    assert loads[0] == pytest.approx([1.0] * 16, rel=0.1)
    assert loads[1] == pytest.approx(loads[0], abs=1e-9)


@pytest.mark.parametrize("stream", ["wrench", "pad"])
@pytest.mark.parametrize(
    ("event", "reason", "text"),
    [
        ("press", "contact", "a contact began"),
        ("silence", "silent", "the stream fell silent"),
        ("unplug", "ended", "the stream ended"),
        ("undo", "undone", "undone before it was taken"),
    ],
)
def test_a_tare_is_given_up(run: Run, stream: str, event: str, reason: str, text: str) -> None:
    run.bring_up()
    run.image(NO_IMAGE)
    before = tare_of(run, stream)["tare_id"]
    assert run.refusal("tare", finger="left", stream=stream, seconds=0.9) is None
    if event == "press":
        run.wrench(5.0, ms=10.0)
    elif event == "unplug":
        run.down(f"left.{stream}")
    elif event == "undo":
        assert run.refusal("tare.undo", finger="left", stream=stream) is None
    for k in range(60 if event == "silence" else 0):
        assert tare_of(run, stream)["busy"] is True or k > 48, "a short silence is survived"
        run.wait(10)
        run.tick()
        if stream == "pad":
            run.wrench(0.0, ms=0.0)
        else:
            run.image(NO_IMAGE)
    got = tare_of(run, stream)
    assert (got["busy"], got["tare_id"], got["given_up"]) == (False, before, text)
    assert got["given_up_reason"] == reason
    if event == "press":
        assert run.refusal("tare", finger="left", stream=stream) == ("in_contact", "finger")


@pytest.mark.parametrize(
    ("op", "fields", "refusal"),
    [
        ("tare", {"finger": "left", "stream": "both"}, ("out_of_range", "stream")),
        ("tare.get", {"finger": "left", "stream": "all"}, ("out_of_range", "stream")),
        ("tare.undo", {"finger": "left", "stream": "all"}, ("out_of_range", "stream")),
        ("tare", {"finger": "right", "stream": "wrench"}, ("not_ready", "stream")),
        ("tare", {"finger": "middle", "stream": "pad"}, ("unknown_finger", "finger")),
        ("tare", {"finger": "left", "stream": 1}, ("bad_type", "stream")),
        ("tare", {"finger": "left", "stream": "pad"}, ("not_ready", "finger")),  # it is silent
        ("tare", {"finger": "right", "stream": "all"}, None),
    ],
)
def test_stream_that_is_unknown_or_silent_is_refused(
    run: Run, op: str, fields: dict[str, Any], refusal: tuple[str, str] | None
) -> None:
    run.wrench(0.0)
    run.skin(0.4)
    assert run.refusal(op, **fields) == refusal


@pytest.mark.parametrize("axes", [1, 3])
def test_readings_marked_invalid_are_left_out(make_run: Callable[..., Run], axes: int) -> None:
    """A pad with a force sensor behind it, and one of three-axis taxels."""
    alone = EXTERNAL.replace("axis_scale = [1.0]", "axis_scale = [1.0, 1.0, -1.0]")
    alone = alone.partition("[finger.left.wrench]")[0] + alone[alone.index("[finger.left.pad]") :]
    run = make_run(EXTERNAL if axes == 1 else alone, zeros=False)
    run.up()
    for k in range(40):
        run.wait(10.0)
        wrong = k % 3 > 0
        more = {"seq": k, "status": ["invalid"] if wrong else []}
        values: list[Any] = [500.0 if wrong else 40.0] * 4 if axes == 1 else [[0.0, 0.0, 90.0 if wrong else 0.04]] * 4
        readings = [encode_reading("pad", run.t_ns, values=values, **more)]
        if axes == 1:
            force_n = [0.0, 0.0, 9.0 if wrong else 0.2]
            readings.append(encode_reading("wrench", run.t_ns, force_n=force_n, torque_nm=[0.0] * 3, **more))
        for reading in readings:
            run.feed(Bytes(next(iter(run.engine.links)), reading))
        if k == 3:
            assert run.refusal("tare", finger="left", stream="all", seconds=0.2) is None
    offsets = {"pad": [40.0] * 4, "wrench": [0.0, 0.0, 0.2, 0.0, 0.0, 0.0]}
    for stream, offset in offsets.items() if axes == 1 else (("pad", [0.0, 0.0, 0.04] * 4),):
        got = tare_of(run, stream)
        assert (got["tare_id"], got["given_up"], got["offset"]) == (1, None, pytest.approx(offset, abs=1e-9))
