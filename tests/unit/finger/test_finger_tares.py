"""Tares of pad and force sensor, each with a zero of its own. Through the engine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from slipd.devices.external import encode_reading
from slipd.events import Bytes

EMPTY = np.zeros((4, 4), dtype=int)

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


class TestTareOfPad:
    """A pad beside a force sensor has a zero of its own."""

    def offset(self, counts: float, press: float = 0.0) -> np.ndarray:
        """Counts of the left pad whose unloaded taxels read ``counts``."""
        return np.full((4, 4), counts + press, dtype=int)

    def show(self, run: Run, counts: np.ndarray) -> None:
        """Images until one of them is published."""
        for _ in range(20):
            run.wait(10)
            run.tick()
            run.image(counts)

    def test_pad_is_tared_and_undone_apart_from_the_force_sensor(self, run: Run) -> None:
        run.bring_up()
        run.image(self.offset(4))
        reply = run.ask("tare", finger="left", stream="pad", seconds=0.1)["result"]
        assert reply == {"finger": "left", "seconds": 0.1, "verified": True, "tare_id": 0, "tare_ids": {"pad": 0}}
        assert run.ask("status")["result"]["streams"]["left.pad"]["tare_busy"] is True
        for _ in range(14):
            run.wrench(0.0, ms=10.0)
            run.image(self.offset(4))
        got = run.ask("tare.get", finger="left", stream="pad")["result"]
        assert (got["stream"], got["tare_id"], got["busy"], got["by"]) == ("pad", 1, False, "ann")
        assert got["offset"] == pytest.approx([4.0] * 16)
        assert run.ask("tare.get", finger="left")["result"]["stream"] == "wrench", "the other tare is unchanged"
        assert run.ask("tare.get", finger="left")["result"]["tare_id"] == 1
        status = run.ask("status")["result"]
        assert (status["streams"]["left.pad"]["tare_id"], status["fingers"]["left"]["tare_id"]) == (1, 1)
        self.show(run, self.offset(4, press=100))
        assert run.published("tactile.left")[-1]["tare_id"] == 1
        assert run.published("tactile.left")[-1]["loads_n"] == pytest.approx([1.0] * 16)
        run.lease()  # something presses
        undone = run.ask("tare.undo", finger="left", stream="pad")["result"]
        assert (undone["stream"], undone["tare_id"], undone["by"]) == ("pad", 0, "config")
        self.show(run, self.offset(4, press=100))
        assert run.published("tactile.left")[-1]["loads_n"] == pytest.approx([1.04] * 16)
        run.lease()
        assert run.refusal("tare.undo", finger="left", stream="pad") == ("not_ready", "finger")
        assert run.ask("tare.get", finger="left")["result"]["tare_id"] == 1

    @pytest.fixture
    def untared(self, make_run: Callable[..., Run], rig: str) -> Run:
        run = make_run(rig, zeros=False)
        run.up()
        return run

    def test_stream_all_tares_both(self, untared: Run) -> None:
        run = untared
        run.image(self.offset(300))
        run.wrench(0.2)
        reply = run.ask("tare", finger="left", stream="all", seconds=0.1)["result"]
        assert (reply["verified"], reply["tare_id"], reply["tare_ids"]) == (False, 0, {"wrench": 0, "pad": 0})
        for _ in range(14):
            run.wrench(0.2, ms=10.0)
            run.image(self.offset(300))
        for stream, offset in (("wrench", [0.0, 0.0, -0.2, 0.0, 0.0, 0.0]), ("pad", [300.0] * 16)):
            got = run.ask("tare.get", finger="left", stream=stream)["result"]
            assert (got["tare_id"], got["busy"]) == (1, False), "neither sensor vouches for the zero of the other"
            assert got["offset"] == pytest.approx(offset, abs=1e-6)
        run.image(self.offset(300))
        again = run.ask("tare", finger="left", stream="all", seconds=0.1)["result"]
        assert again["verified"] is True, "now each shows that the finger is free"

    def test_tare_of_a_charge_pad_keeps_its_loads(self, make_run: Callable[[str], Run], left: str) -> None:
        loads = []
        for tares in (False, True):
            run = make_run(left + "charge_tau_s = 2.0\n")
            run.up()
            for k in range(60):
                run.wait(5)
                run.tick()
                run.image(self.offset(40, press=100 if k > 40 else 0))
                run.wrench(16.0 if k >= 40 else 0.0, ms=5.0)
                if tares and k == 10:
                    assert run.refusal("tare", finger="left", stream="pad", seconds=0.1) is None
            got = run.ask("tare.get", finger="left", stream="pad")["result"]
            assert got["offset"] == pytest.approx([40.0 if tares else 0.0] * 16)
            loads.append(run.published("tactile.left")[-1]["loads_n"])
        assert loads[0] == pytest.approx([1.0] * 16, rel=0.1)
        assert loads[1] == pytest.approx(loads[0], abs=1e-9)

    def test_image_of_a_tared_pad_refuses_a_tare_in_contact(self, untared: Run) -> None:
        run = untared
        self.test_stream_all_tares_both(run)
        for stream in ("wrench", "pad", "wrench"):  # the two in progress, and the one before
            assert run.refusal("tare.undo", finger="left", stream=stream) is None
        run.wrench(0.2)
        run.image(self.offset(300, press=100))
        assert run.refusal("tare", finger="left", stream="all") == ("in_contact", "finger")
        assert run.refusal("tare", finger="left", stream="wrench") == ("in_contact", "finger")

    def test_contact_gives_up_the_tare(self, run: Run) -> None:
        run.bring_up()
        assert run.ask("tare", finger="left", stream="pad", seconds=0.2)["ok"]
        run.wrench(5.0, ms=10.0)
        got = run.ask("tare.get", finger="left", stream="pad")["result"]
        assert (got["busy"], got["tare_id"], got["given_up"]) == (False, 0, "a contact began")
        assert got["given_up_reason"] == "contact"
        assert run.refusal("tare", finger="left", stream="pad") == ("in_contact", "finger")

    def test_silent_pad_is_not_tared(self, run: Run) -> None:
        run.wrench(0.0)
        assert run.refusal("tare", finger="left", stream="pad") == ("not_ready", "finger")
        run.image(EMPTY)
        assert run.refusal("tare", finger="left", stream="pad", seconds=0.5) is None
        for _ in range(60):
            run.wrench(0.0, ms=10.0)
        run.tick()
        got = run.ask("tare.get", finger="left", stream="pad")["result"]
        assert (got["busy"], got["given_up"]) == (False, "the stream fell silent")
        assert got["given_up_reason"] == "silent"

    def test_unplugged_pad_gives_up_its_tare(self, run: Run) -> None:
        run.wrench(0.0)
        run.image(EMPTY)
        assert run.refusal("tare", finger="left", stream="pad") is None
        run.down("left.pad")
        got = run.ask("tare.get", finger="left", stream="pad")["result"]
        assert (got["given_up"], got["given_up_reason"]) == ("the stream ended", "ended")

    @pytest.mark.parametrize(
        ("op", "fields", "refusal"),
        [
            ("tare", {"finger": "left", "stream": "both"}, ("out_of_range", "stream")),
            ("tare.get", {"finger": "left", "stream": "all"}, ("out_of_range", "stream")),
            ("tare.undo", {"finger": "left", "stream": "all"}, ("out_of_range", "stream")),
            ("tare", {"finger": "right", "stream": "wrench"}, ("not_ready", "stream")),
            ("tare", {"finger": "middle", "stream": "pad"}, ("unknown_finger", "finger")),
            ("tare", {"finger": "left", "stream": 1}, ("bad_type", "stream")),
        ],
    )
    def test_unknown_stream_is_refused(
        self, run: Run, op: str, fields: dict[str, Any], refusal: tuple[str, str]
    ) -> None:
        run.wrench(0.0)
        assert run.refusal(op, **fields) == refusal

    def test_pad_that_measures_the_force_may_be_named(self, run: Run) -> None:
        run.skin(0.4)
        for stream in ("pad", "all"):
            reply = run.ask("tare", finger="right", stream=stream, seconds=0.1)["result"]
            assert reply["tare_ids"] == {"pad": 0}

    def test_readings_marked_invalid_are_left_out(self, make_run: Callable[..., Run]) -> None:
        run = make_run(EXTERNAL, zeros=False)
        run.up()
        for k in range(40):
            run.wait(10.0)
            invalid = k % 3 > 0
            counts = [500.0 if invalid else 40.0] * 4
            status = ["invalid"] if invalid else []
            force_n = [0.0, 0.0, 9.0 if invalid else 0.2]
            for reading in (
                encode_reading("pad", run.t_ns, values=counts, seq=k, status=status),
                encode_reading("wrench", run.t_ns, force_n=force_n, torque_nm=[0.0] * 3, seq=k, status=status),
            ):
                run.feed(Bytes(next(iter(run.engine.links)), reading))
            if k == 3:
                assert run.refusal("tare", finger="left", stream="all", seconds=0.2) is None
        for stream, offset in (("pad", [40.0] * 4), ("wrench", [0.0, 0.0, 0.2, 0.0, 0.0, 0.0])):
            got = run.ask("tare.get", finger="left", stream=stream)["result"]
            assert (got["tare_id"], got["given_up"]) == (1, None)
            assert got["offset"] == pytest.approx(offset, abs=1e-9)

    def test_images_marked_invalid_are_left_out_of_the_tare_of_a_three_axis_pad(
        self, make_run: Callable[[str], Run]
    ) -> None:
        alone = EXTERNAL.replace("axis_scale = [1.0]", "axis_scale = [1.0, 1.0, -1.0]")
        run = make_run(alone.partition("[finger.left.wrench]")[0] + alone[alone.index("[finger.left.pad]") :])
        run.up()
        for k in range(40):
            run.wait(10.0)
            invalid = k % 3 > 0
            counts = [[0.0, 0.0, 90.0 if invalid else 0.04]] * 4
            status = ["invalid"] if invalid else []
            image = encode_reading("pad", run.t_ns, values=counts, seq=k, status=status)
            run.feed(Bytes(next(iter(run.engine.links)), image))
            if k == 3:
                assert run.refusal("tare", finger="left", seconds=0.2) is None
        got = run.ask("tare.get", finger="left")["result"]
        assert (got["tare_id"], got["given_up"]) == (1, None)
        assert got["offset"] == pytest.approx([0.0, 0.0, 0.04] * 4, abs=1e-9)
