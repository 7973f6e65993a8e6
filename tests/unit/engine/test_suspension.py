"""A host that sleeps: what was measured before is stale, and no lease outlives the sleep."""

from __future__ import annotations

from typing import Any

import pytest
from engine_rig import WALL_NS

from slipd.devices import bota
from slipd.events import Bytes, Tick
from slipd.requests.recording_state import utc_stamp

MS = 1_000_000

Run = Any


class TestSuspension:
    def test_a_sleep_makes_every_stream_stale_and_ends_the_lease(self, run: Run) -> None:
        run.tick(suspended_ns=7 * 10**9)
        run.image()
        run.wrench(10.0, (1.0, 0.0))
        run.skin(5.0)
        assert run.ask("lease.acquire", ttl_ms=200)["ok"]
        run.wait(5)
        run.tick(suspended_ns=7 * 10**9 + 50 * MS)
        assert run.level()[0] == "stable", "50 ms may be two clocks read one after the other"
        assert run.ask("lease.renew")["ok"]
        run.wait(5)
        run.tick(suspended_ns=10 * 10**9)
        assert run.level() == run.level("right") == ("unknown", ["stale"])
        assert run.ask("lease.renew")["error"]["code"] == "no_lease"

    def test_images_from_before_the_sleep_are_stale(self, run: Run) -> None:
        """CLOCK_MONOTONIC stood still meanwhile, so the image looks 6 ms old."""
        run.tick()
        run.image()
        run.wrench(10.0, (1.0, 0.0))
        run.tick(suspended_ns=3600 * 10**9)
        run.wrench(10.0, (1.0, 0.0), ms=5.0)
        assert run.level() == ("unknown", ["rotation_unobserved"])
        run.image()
        run.wrench(10.0, (1.0, 0.0))
        assert run.level()[0] == "stable"

    def test_the_first_tick_is_no_sleep(self, run: Run) -> None:
        run.image()
        run.wrench(10.0, (1.0, 0.0))
        run.tick(suspended_ns=10**15)
        assert run.level()[0] == "stable"

    def test_a_sleep_ends_a_tare(self, run: Run) -> None:
        run.tick()
        run.wrench(0.0)
        run.ask("tare", finger="left", seconds=0.05)
        run.tick(suspended_ns=10**12)
        assert run.ask("tare.get", finger="left")["result"]["busy"] is False


def test_C1_a_line_is_not_late_because_the_host_clock_is_slewed(run: Run) -> None:
    """NTP makes CLOCK_MONOTONIC run 8 % fast for a second."""
    begun_ns = run.t_ns
    for k in range(2600):
        run.t_ns = begun_ns + k * MS + min(max(0, k - 700), 1000) * MS // 12
        if k % 5 == 0:
            run.feed(Tick(raw_ns=begun_ns + k * MS))
        run.feed(Bytes("left.wrench", bota.encode_frame((0.0, 0.0, -k * 1e-6), (0.0, 0.0, 0.0), k * 1000)))
    status = run.ask("status")["result"]["streams"]["left.wrench"]
    assert status["clock"] == "locked"
    assert run.published("slip.left")[-1]["age_s"] < 0.002


@pytest.mark.parametrize("moved_ns", [8 * 3600 * 10**9, -5 * 10**9])
def test_timestamps_and_names_of_recordings_follow_a_suspend_and_a_step_of_the_wall_clock(
    run: Run, moved_ns: int
) -> None:
    run.wrench(0.0)
    before = run.published("slip.left")[-1]
    assert before["timestamp"] == pytest.approx((run.t_ns + WALL_NS) * 1e-9, abs=1e-5)
    for _ in range(2):
        run.wait(5)
        run.feed(Tick(wall_minus_monotonic_ns=WALL_NS + moved_ns))
    run.wrench(0.0)
    assert run.published("slip.left")[-1]["timestamp"] == pytest.approx(
        (run.t_ns + WALL_NS + moved_ns) * 1e-9, abs=1e-5
    )
    name = run.ask("record.start")["result"]["name"]
    assert utc_stamp(run.t_ns + WALL_NS + moved_ns) in name
