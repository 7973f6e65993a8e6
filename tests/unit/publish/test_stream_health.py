"""The health of a stream, from the opening of its link to its loss, and why it is silent."""

from __future__ import annotations

import pytest
from device_links import frame, health, status
from fixture_types import Parse
from nanoseconds import MS, T0, S

from slipd.devices import DEVICES, tsf85
from slipd.finger.freshness import PROMPT
from slipd.links.device_link import DeviceLink, FloodGuard, make_links
from slipd.tools.sim.emulated_pads import encode_block
from slipd.types.samples import WrenchSample
from slipd_client.messages import Health


def test_the_health_of_a_link_follows_it_from_opening_to_loss(links: dict[str, DeviceLink]) -> None:
    link = links["left.wrench"]
    assert health(link, T0) == (Health.ERROR, "not opened yet")
    link.open("/dev/ttyUSB0", T0)
    assert (link.guard.opened, status(link, T0)["samples"]) == ("/dev/ttyUSB0", 0)
    assert health(link, T0) == (Health.STALE, "open, but no reading yet")
    link.receive(frame(T0), T0)
    now = status(link, T0 + 15 * MS)
    assert (now["samples"], now["good"], now["reconnects"], now["age_s"]) == (1, 1, 0, pytest.approx(0.015))
    assert health(link, T0 + 20 * MS) == (Health.OK, "")
    assert health(link, T0 + 21 * MS) == (Health.STALE, "no reading for 0.02 s")
    link.close("unplugged")
    assert (health(link, T0 + 21 * MS), status(link, T0)["clock"]) == ((Health.ERROR, "unplugged"), "settling")
    link.open("/dev/ttyUSB0", T0)
    now = status(link, T0)
    assert now["clock"] == "none", "another device may answer"
    assert (now["reconnects"], now["hardware_id"]) == (1, "/dev/ttyUSB0")


@pytest.fixture
def wrench(links: dict[str, DeviceLink]) -> DeviceLink:
    links["left.wrench"].open("port", T0)
    return links["left.wrench"]


def feed(link: DeviceLink, hz: float, seconds: float, start_ns: int) -> int:
    for k in range(round(hz * seconds)):
        t_ns = start_ns + round(k * 1e9 / hz)
        link.receive(frame(t_ns), t_ns)
    return start_ns + round(seconds * 1e9)


@pytest.mark.parametrize(
    ("hz", "well"), [(1000.0, True), (850.0, True), (1150.0, True), (750.0, False), (1300.0, False)]
)
def test_a_rate_that_deviates_from_the_config_is_reported(wrench: DeviceLink, hz: float, well: bool) -> None:
    now = feed(wrench, hz, 0.1, T0)
    health(wrench, now)
    assert status(wrench, now)["rate_hz"] is None, "a tenth of a second counts jitter"
    now = feed(wrench, hz, 1.0, now)
    expected = (Health.OK, "") if well else (Health.WARN, f"{hz:.0f} Hz instead of 1000 Hz")
    assert health(wrench, now) == expected
    assert status(wrench, now)["rate_hz"] == pytest.approx(hz, rel=0.01)
    wrench.streams[""].rate_hint = DEVICES["netft"].rate_hint
    assert ("comm.htm" in health(wrench, now)[1]) != well
    wrench.session.health.warning = "the sensor did not take the rate"
    assert health(wrench, now)[1].endswith("the sensor did not take the rate")


def test_damaged_frames_are_reported_only_while_they_last(wrench: DeviceLink) -> None:
    wrench.receive(b"\xff" * 500, T0)  # before the first reading: a device that boots
    now = feed(wrench, 1000.0, 0.1, T0)
    assert health(wrench, now) == (Health.OK, "")
    now = feed(wrench, 1000.0, 1.0, now)
    assert health(wrench, now) == (Health.OK, "")
    wrench.receive(b"\xff" * 300, now)
    now = feed(wrench, 1000.0, 1.0, now)
    assert health(wrench, now) == (Health.WARN, "300 recent bytes belong to no frame")
    now = feed(wrench, 1000.0, 1.0, now)
    assert health(wrench, now) == (Health.OK, "")
    assert status(wrench, now)["bad_bytes"] == 800


def test_L9_a_flood_drops_the_oldest_readings_and_is_reported(wrench: DeviceLink) -> None:
    flood = b"".join(frame(n * 1000) for n in range(1500))
    ((samples, times_ns, arrival, _),) = wrench.receive(flood, T0)
    assert len(samples) == len(times_ns) == 1000, "a second of readings may have waited"
    assert arrival is PROMPT
    assert samples[-1].device_time_ns == 1499 * 1000
    assert (status(wrench, T0)["dropped"], status(wrench, T0)["good"]) == (500, 1500)
    assert health(wrench, T0) == (Health.WARN, "sends more than 4 times its rate: the oldest readings are dropped")
    ((samples, *_),) = wrench.receive(flood, T0 + 10 * MS)
    assert len(samples) == 40, "four times 1000 Hz for 10 ms"
    now = feed(wrench, 1000.0, 1.5, T0 + 11 * MS)
    assert health(wrench, now) == (Health.OK, "")
    assert status(wrench, now)["dropped"] == 500 + 1460


def test_L9_a_slow_stream_may_bring_32_readings_at_once() -> None:
    guard, bunch = FloodGuard(), [WrenchSample(T0, None, [0.0] * 3, None)] * 33
    guard.rate_hz = 1.0
    guard.open(T0)
    assert (len(guard.admit(bunch, T0)), guard.dropped, guard.dropped_ns) == (32, 1, T0)


def test_L9_an_array_that_comes_in_every_packet_of_a_tsf85_is_no_flood(left: str, parse: Parse) -> None:
    size = 'rows = 7\ncols = 4\nsensor = "0"'
    text = (
        left.replace('"pvdf"', '"tsf85"')
        .replace("rows = 4\ncols = 4", size)
        .replace("rate_hz = 100.0", "rate_hz = 60.0")
    )
    link = make_links(parse(text))["left.pad"]
    link.open("port", T0)
    for ms in range(3000):
        array = encode_block(tsf85.STATIC, 0, [ms // 16] * tsf85.TAXELS)
        link.receive(tsf85.encode_packet(tsf85.AUTOSEND, array), T0 + ms * MS)
    assert (link.flood.dropped, link.streams["0"].count) == (0, 188)


LATER = T0 + 2 * S


def test_a_stream_that_is_silent_reports_why_after_a_while_by_recent_bytes_alone(wrench: DeviceLink) -> None:
    assert health(wrench, T0 + S) == (Health.STALE, "open, but no reading yet"), "right after opening"
    now = feed(wrench, 1000.0, 1.0, T0 + S)
    health(wrench, now)
    assert health(wrench, now + S // 2) == (Health.STALE, "no reading for 0.50 s")
    why = "no reading for 2.00 s: open, but no bytes arrive: is it powered? is it connected to this port?"
    assert health(wrench, now + 2 * S) == (Health.STALE, why)
    wrench.receive(b"\xaa" * 500, now + 3 * S)
    assert "none is a Bota frame" in health(wrench, now + 3 * S)[1]


def test_the_note_of_a_decoder_is_reported_with_and_without_readings(wrench: DeviceLink) -> None:
    wrench._decoder.health.note = "press a pad"
    assert health(wrench, LATER) == (Health.STALE, "press a pad")
    wrench.receive(frame(LATER), LATER)
    assert health(wrench, LATER) == (Health.OK, "press a pad")
    wrench._decoder.health.warning = "a monitor condition is latched"
    assert health(wrench, LATER) == (Health.WARN, "a monitor condition is latched")
