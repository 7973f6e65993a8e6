"""A stream knows when its readings were acquired, and says how well it knows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from slipd.config import Config
from slipd.pipeline.streams import BAD_TIME_TOLD_NS, Stream, make_stream
from slipd.samples import TactileSample, WrenchSample
from slipd_client.messages import Health

MS = 1_000_000
T0 = 100_000_000_000
Parse = Callable[[str], Config]


def reading(t_ns: int, device_ns: int | None) -> WrenchSample:
    return WrenchSample(t_ns, device_ns, np.zeros(3), np.zeros(3))


@pytest.fixture
def stream(left: str, parse: Parse) -> Stream:
    return make_stream("left.wrench", parse(left).streams()["left.wrench"])


def test_L12_readings_that_come_in_bunches_get_their_own_times(stream: Stream) -> None:
    rng = np.random.default_rng(0)
    for bunch in range(200):
        receipt_ns = T0 + (bunch + 1) * 16 * MS + int(rng.exponential(0.2 * MS))
        for k in range(16):
            acquired = stream.take(reading(receipt_ns, (bunch * 16 + k) * MS), 0)
    assert acquired == pytest.approx(T0 + 200 * 16 * MS - 1 * MS, abs=1.5 * MS)
    told = stream.told(receipt_ns)
    assert told["clock"] == "locked"
    assert 0.0 < told["clock_uncertainty_s"] < 0.005


def test_without_a_device_clock_the_receipt_counts_less_what_waited(stream: Stream) -> None:
    assert stream.take(reading(T0, None), 0) == T0
    assert stream.take(reading(T0 + MS, None), 300 * MS) == T0 - 299 * MS
    assert stream.told(T0)["clock"] == "none"
    assert stream.told(T0)["clock_uncertainty_s"] is None


def test_a_known_delay_is_taken_off(left: str, parse: Parse) -> None:
    text = left.replace('port = "/dev/left-wrench"', 'port = "/dev/left-wrench"\ndelay_s = 0.002')
    assert make_stream("left.wrench", parse(text).streams()["left.wrench"]).take(reading(T0, None), 0) == T0 - 2 * MS


def test_a_clock_that_is_none_is_told(stream: Stream) -> None:
    for k in range(20_000):
        stream.take(reading(T0 + k * MS, k * 2 * MS), 0)
    assert stream.level(T0 + k * MS) == (
        Health.WARN,
        "its clock is none (stuck, jumping, or off by more than 1000 ppm): the receipt counts",
    )


def test_a_scan_is_dated_by_its_end(left: str, parse: Parse) -> None:
    stream = make_stream("left.pad", parse(left).streams()["left.pad"])
    for k in range(400):
        image = TactileSample(T0 + k * 10 * MS, k * 10 * MS, np.zeros(16), dwell_ns=100_000)
        acquired = stream.take(image, 0)
    assert acquired == pytest.approx(T0 + k * 10 * MS, abs=0.1 * MS)
    assert stream.take(TactileSample(T0, 0, np.zeros(9)), 0) is None
    assert stream.level(T0) == (Health.ERROR, "images of 9 taxels, where rows and cols say 16")


EXTERNAL = """
[finger.left]
[finger.left.wrench]
device = "external"
port = "ipc:///run/slipd/readings"
sensor = "left.wrench"
rate_hz = 1000.0
"""


def test_a_pusher_on_this_host_tells_its_own_time(parse: Parse) -> None:
    stream = make_stream("left.wrench", parse(EXTERNAL).streams()["left.wrench"])
    assert stream.take(reading(T0, T0 - 3 * MS), 0) == T0 - 3 * MS
    assert stream.told(T0)["clock"] == "host"
    assert stream.level(T0) == (Health.OK, "")
    assert stream.take(reading(T0, None), 0) == T0
    assert stream.level(T0) == (Health.OK, "")
    assert stream.take(reading(T0, T0 + MS), 0) == T0, "a time to come is not believed"
    assert stream.level(T0)[0] == Health.WARN
    assert stream.take(reading(T0 + BAD_TIME_TOLD_NS, T0 + BAD_TIME_TOLD_NS), 0) == T0 + BAD_TIME_TOLD_NS
    assert stream.level(T0 + BAD_TIME_TOLD_NS) == (Health.OK, "")
