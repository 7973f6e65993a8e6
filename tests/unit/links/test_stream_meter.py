"""Times of readings, and the health of a stream."""

from __future__ import annotations

import numpy as np
import pytest
from arm_rig import DOWN, RIG, STILL
from fixture_types import Parse
from nanoseconds import MS, T0

from slipd.finger.freshness import PROMPT, Arrival
from slipd.links.stream_meter import OLDEST_HOST_NS, StreamMeter
from slipd.publish.stream_health import SHOWN_NS, Condition, _stream_condition
from slipd.types.samples import ArmSample, Sample, TactileSample, WrenchSample
from slipd_client.messages import Health


def date(stream: StreamMeter, sample: Sample, late_ns: int = 0) -> int | None:
    """Time at which a single reading was acquired; None where it does not fit the stream."""
    read = stream.update([sample], Arrival(late_ns, late_ns=late_ns))
    assert read is None or read.samples == [sample]
    return None if read is None else read.times_ns[0]


def condition(stream: StreamMeter, t_ns: int) -> Condition:
    return _stream_condition(stream, t_ns, None, 0)


def reading(t_ns: int, device_ns: int | None) -> WrenchSample:
    return WrenchSample(t_ns, device_ns, np.zeros(3), np.zeros(3))


def made(parse: Parse, text: str, name: str = "left.wrench") -> StreamMeter:
    return StreamMeter(name, parse(text).streams()[name])


@pytest.fixture
def stream(left: str, parse: Parse) -> StreamMeter:
    return made(parse, left)


def test_L12_readings_that_arrive_in_bunches_get_times_of_their_own(stream: StreamMeter) -> None:
    rng = np.random.default_rng(0)
    for bunch in range(200):
        receipt_ns = T0 + (bunch + 1) * 16 * MS + int(rng.exponential(0.2 * MS))
        for k in range(16):
            acquired = date(stream, reading(receipt_ns, (bunch * 16 + k) * MS))
    assert acquired == pytest.approx(T0 + 200 * 16 * MS - 1 * MS, abs=1.5 * MS)
    assert stream.clock.state == "locked"
    assert 0 < (stream.clock.uncertainty_ns or 0) < 5 * MS


def test_C4_readings_that_waited_are_dated_by_a_clock_that_is_locked_or_the_hosts(
    stream: StreamMeter, parse: Parse
) -> None:
    waited = Arrival(5 * MS, late_ns=5 * MS)
    for k in range(2000):
        locked = stream.update([reading(T0 + k * MS, k * MS)], waited)
        assert locked is not None
        assert locked.arrival.dated == stream.clock.locked
    assert locked.arrival == waited
    pushed = made(parse, EXTERNAL).update([reading(T0, T0)], waited)
    assert pushed is not None
    assert pushed.arrival.dated


def test_without_a_device_clock_the_time_is_the_receipt_less_the_wait(stream: StreamMeter) -> None:
    assert date(stream, reading(T0, None)) == T0
    assert date(stream, reading(T0 + 400 * MS, None), 300 * MS) == T0 + 100 * MS
    assert date(stream, reading(T0 + 401 * MS, None), 310 * MS) == T0 + 100 * MS, "times never go back"
    assert (stream.clock.state, stream.clock.uncertainty_ns) == ("none", None)


def test_a_configured_delay_is_subtracted(left: str, parse: Parse) -> None:
    text = left.replace('port = "/dev/left-wrench"', 'port = "/dev/left-wrench"\ndelay_s = 0.002')
    assert date(made(parse, text), reading(T0, None)) == T0 - 2 * MS


def test_an_unusable_clock_is_reported(stream: StreamMeter) -> None:
    for k in range(20_000):
        date(stream, reading(T0 + k * MS, k * 2 * MS))
    assert condition(stream, T0 + k * MS) == (
        Health.WARN,
        "its clock is unusable (stuck, jumping, or off by more than 1000 ppm): receipt times are used",
    )


def test_F1_readings_that_come_later_than_before_make_the_stream_stale(stream: StreamMeter) -> None:
    for k in range(2000):
        date(stream, reading(T0 + k * MS, k * MS))
    for k in range(2000, 3500):
        date(stream, reading(T0 + (k + 60) * MS, k * MS))
    health, message = condition(stream, T0 + (k + 60) * MS)
    assert health is Health.STALE
    assert message.startswith("its readings are 0.06 s older than before when they come: does a driver")


def test_the_clock_of_a_scan_is_read_at_its_end(left: str, parse: Parse) -> None:
    stream = made(parse, left, "left.pad")
    for k in range(400):
        acquired = date(stream, TactileSample(T0 + k * 10 * MS, k * 10 * MS, np.zeros(16), dwell_ns=100_000))
    assert acquired == pytest.approx(T0 + k * 10 * MS, abs=0.1 * MS)
    assert date(stream, TactileSample(T0, 0, np.zeros(9))) is None
    assert condition(stream, T0) == (
        Health.ERROR,
        "images of 9 taxels of one axis, where the config says 16 taxels of one axis",
    )


EXTERNAL = """
[finger.left]
[finger.left.wrench]
device = "external"
port = "ipc:///run/slipd/readings"
sensor = "left.wrench"
rate_hz = 1000.0
"""


PAD = """
[finger.left.pad]
device = "external"
port = "ipc:///run/slipd/readings"
sensor = "left.pad"
rate_hz = 1000.0
rows = 2
cols = 2
pitch_m = 0.004
electrode_m = 0.002
"""


def test_times_of_a_program_on_this_host_are_used_unless_they_lie_in_the_future(parse: Parse) -> None:
    stream = made(parse, EXTERNAL)
    assert date(stream, reading(T0, T0 - 3 * MS)) == T0 - 3 * MS
    assert stream.host_clock
    assert condition(stream, T0) == (Health.OK, "")
    assert date(stream, reading(T0, None)) == T0
    assert date(stream, reading(T0, T0 - 2 * MS)) == T0, "times never go back"
    assert condition(stream, T0) == (Health.OK, "")
    assert date(stream, reading(T0, T0 + MS)) == T0, "a time in the future is not used"
    assert condition(stream, T0)[0] == Health.WARN
    assert date(stream, reading(T0 + SHOWN_NS, T0 + SHOWN_NS)) == T0 + SHOWN_NS
    assert condition(stream, T0 + SHOWN_NS) == (Health.OK, "")
    oldest_ns = T0 - OLDEST_HOST_NS
    assert [date(made(parse, EXTERNAL), reading(T0, at_ns)) for at_ns in (oldest_ns, oldest_ns - 1)] == [oldest_ns, T0]


def test_readings_of_another_kind_or_shape_are_refused_and_reported(parse: Parse) -> None:
    stream = made(parse, EXTERNAL)
    assert date(stream, TactileSample(T0, T0, np.zeros(16))) is None
    assert condition(stream, T0) == (Health.ERROR, "readings of kind TactileSample, which this stream does not have")
    pad = made(parse, EXTERNAL + PAD, "left.pad")
    assert date(pad, TactileSample(T0, T0, np.zeros((4, 3)))) is None
    mixed: list[Sample] = [TactileSample(T0, T0, np.zeros(shape)) for shape in (4, (4, 3), 4)]
    assert pad.update(mixed) == ([mixed[0], mixed[2]], [T0, T0], PROMPT, "left.pad"), "those that fit are kept"
    assert condition(pad, T0) == (Health.OK, ""), "the newest fits"
    assert date(pad, TactileSample(T0, T0, np.zeros((4, 3)))) is None
    assert "4 taxels of three axes, where the config says 4 taxels of one axis" in condition(pad, T0)[1]
    assert date(pad, TactileSample(T0, T0, np.zeros(4))) == T0


def test_D6_the_stream_of_an_arm_takes_its_motion_alone_and_names_what_comes_late(parse: Parse) -> None:
    arm = made(parse, RIG, "arm")
    assert date(arm, ArmSample(T0, T0 - 60 * MS, DOWN, STILL)) == T0 - 60 * MS
    assert condition(arm, T0)[1].startswith("its readings are 0.06 s old when they come: does the program")
    assert date(arm, ArmSample(T0, T0 - MS, DOWN, STILL)) == T0 - MS
    assert condition(arm, T0) == (Health.OK, "")
    assert date(arm, reading(T0, None)) is None
    assert "readings of kind WrenchSample" in condition(arm, T0)[1]
