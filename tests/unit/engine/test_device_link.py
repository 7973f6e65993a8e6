"""Links: one for each address; their streams, the identity of the device, and the health of each stream."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from slipd.config import Config
from slipd.devices import bota, pvdf, xela
from slipd.devices.bota import bota_text
from slipd.devices.shared.decoder_health import DecoderHealth
from slipd.engine.device_link import DeviceLink, make_links
from slipd.events import LinkSpec
from slipd.publish.status_publisher import StreamStatus
from slipd.samples import TactileSample
from slipd_client.messages import Health

MS = 1_000_000
T0 = 100_000_000_000
Parse = Callable[[str], Config]


@pytest.fixture
def links(left: str, right: str, gripper: str, parse: Parse) -> dict[str, DeviceLink]:
    twin = right.replace("finger.right", "finger.third").replace('"2"', '"1"')
    return make_links(parse(left + right + twin + gripper))


def frame(t_ns: int) -> bytes:
    return bota.encode_frame((0.0, 0.0, -1.0), (0.0, 0.0, 0.0), t_ns // 1000)


def skin(number: int, taxels: int = 4, sensors: str = "12") -> bytes:
    return xela.encode_message(number, {sensor: np.full((taxels, 3), 1000) for sensor in sensors}, 1.7e9)


def health(link: DeviceLink, t_ns: int, source: str = "") -> tuple[Health, str]:
    return link.condition(link.streams[source], t_ns)


def status(link: DeviceLink, t_ns: int, source: str = "") -> StreamStatus:
    return link.status(link.streams[source], t_ns, [], None)


def test_streams_that_share_an_address_share_one_link_named_after_the_first(links: dict[str, DeviceLink]) -> None:
    assert {name: link.spec for name, link in links.items()} == {
        "left.wrench": LinkSpec("left.wrench", "serial", "/dev/left-wrench", 460_800),
        "left.pad": LinkSpec("left.pad", "serial", "/dev/left-pad", 921_600),
        "right.pad": LinkSpec("right.pad", "websocket", "ws://127.0.0.1:5000", 0),
        "gripper": LinkSpec("gripper", "serial", "/dev/gripper", 115_200),
    }
    assert [meter.name for meter in links["right.pad"].streams.values()] == ["right.pad", "third.pad"]


def test_the_baud_rate_of_the_config_overrides_the_default_of_the_device(left: str, parse: Parse) -> None:
    links = make_links(parse(left.replace("rate_hz = 100.0", "rate_hz = 100.0\nbaud = 57600")))
    assert (links["left.pad"].spec.baud, links["left.wrench"].spec.baud) == (57_600, 460_800)


def test_options_of_the_config_reach_the_decoder(left: str, parse: Parse) -> None:
    links = make_links(parse(left.replace("rows = 4", "rows = 2").replace("cols = 4", "cols = 3")))
    scan = pvdf.encode_scan(np.ones((2, 3), dtype=int), 1, 0.0, 5.0)
    ((name, (sample,), _),) = links["left.pad"].receive(scan, T0)
    assert name == "left.pad"
    assert isinstance(sample, TactileSample)
    assert sample.values.shape == (6,)


def test_L5_a_scan_cut_off_by_an_unplug_is_not_completed_by_later_bytes(links: dict[str, DeviceLink]) -> None:
    link, scan = links["left.pad"], pvdf.encode_scan(np.ones((4, 4), dtype=int), 1, 0.0, 5.0)
    link.open("/dev/left-pad", T0)
    link.receive(scan[:50], T0)
    link.close("unplugged")
    link.open("/dev/left-pad", T0)
    assert link.receive(scan[50:], T0) == []


def test_only_open_links_to_devices_with_commands_send_last_bytes(links: dict[str, DeviceLink]) -> None:
    assert links["left.wrench"].farewell() == b""
    for link in links.values():
        link.open("address", T0)
    last_bytes = {name: link.farewell() for name, link in links.items()}
    assert last_bytes == {
        "left.wrench": bota_text.CONFIGURE.encode(),
        "left.pad": b"",
        "right.pad": b"",
        "gripper": b"",
    }


def test_readings_on_a_shared_port_are_assigned_by_their_sensor(links: dict[str, DeviceLink]) -> None:
    found = links["right.pad"].receive(skin(1), T0)
    sources = [(name, sample.source) for name, samples, _ in found for sample in samples]
    assert sorted(sources) == [("right.pad", "2"), ("third.pad", "1")]


def test_readings_of_no_configured_stream_are_ignored(links: dict[str, DeviceLink]) -> None:
    assert links["right.pad"].receive(skin(1, sensors="34"), T0) == []


def test_images_of_another_size_are_an_error_of_the_stream(links: dict[str, DeviceLink]) -> None:
    link = links["right.pad"]
    link.open("server", T0)
    assert link.receive(skin(1, taxels=16), T0) == []
    assert health(link, T0, "2") == (
        Health.ERROR,
        "images of 16 taxels of three axes, where the config says 4 taxels of three axes",
    )
    assert len(link.receive(skin(2), T0 + MS)) == 2
    assert health(link, T0 + MS, "2") == (Health.OK, "")


def test_the_health_of_a_link_follows_it_from_opening_to_loss(links: dict[str, DeviceLink]) -> None:
    link = links["left.wrench"]
    assert health(link, T0) == (Health.ERROR, "not opened yet")
    link.open("/dev/ttyUSB0", T0)
    assert link.opened == "/dev/ttyUSB0"
    assert health(link, T0) == (Health.STALE, "open, but no reading yet")
    assert status(link, T0).samples == 0
    link.receive(frame(T0), T0)
    now = status(link, T0)
    assert (now.samples, now.counters.good, now.reconnects) == (1, 1, 0)
    assert status(link, T0 + 15 * MS).age_s == pytest.approx(0.015)
    assert health(link, T0 + 20 * MS) == (Health.OK, "")
    assert health(link, T0 + 21 * MS) == (Health.STALE, "no reading for 0.02 s")
    link.close("unplugged")
    assert health(link, T0 + 21 * MS) == (Health.ERROR, "unplugged")
    link.open("/dev/ttyUSB0", T0)
    assert (status(link, T0).reconnects, status(link, T0).hardware_id) == (1, "/dev/ttyUSB0")


def feed(link: DeviceLink, hz: float, seconds: float, start_ns: int) -> int:
    count = round(hz * seconds)
    for k in range(count):
        t_ns = start_ns + round(k * 1e9 / hz)
        link.receive(frame(t_ns), t_ns)
    return start_ns + round(seconds * 1e9)


@pytest.mark.parametrize(
    ("hz", "well"), [(1000.0, True), (850.0, True), (1150.0, True), (750.0, False), (1300.0, False)]
)
def test_a_rate_that_deviates_from_the_config_is_reported(links: dict[str, DeviceLink], hz: float, well: bool) -> None:
    link = links["left.wrench"]
    link.open("port", T0)
    now = feed(link, hz, 0.1, T0)
    link.condition(link.streams[""], now)
    assert status(link, now).rate_hz is None, "a tenth of a second counts jitter"
    now = feed(link, hz, 1.0, now)
    expected = (Health.OK, "") if well else (Health.WARN, f"{hz:.0f} Hz instead of 1000 Hz")
    assert health(link, now) == expected
    assert status(link, now).rate_hz == pytest.approx(hz, rel=0.01)


def test_damaged_frames_are_reported_only_while_they_last(links: dict[str, DeviceLink]) -> None:
    link = links["left.wrench"]
    link.open("port", T0)
    link.receive(b"\xff" * 500, T0)  # before the first reading: a device that boots
    now = feed(link, 1000.0, 0.1, T0)
    assert health(link, now) == (Health.OK, "")
    now = feed(link, 1000.0, 1.0, now)
    assert health(link, now) == (Health.OK, "")
    link.receive(b"\xff" * 300, now)
    now = feed(link, 1000.0, 1.0, now)
    level, message = health(link, now)
    assert level == Health.WARN
    assert message == "300 recent bytes belong to no frame"
    now = feed(link, 1000.0, 1.0, now)
    assert health(link, now) == (Health.OK, "")
    assert status(link, now).counters.bad_bytes == 800


def test_a_session_writes_only_while_its_link_is_up(links: dict[str, DeviceLink]) -> None:
    link = links["gripper"]
    assert link.due(T0) == []
    assert link.open("port", T0) != b""
    assert status(link, T0).state == "waiting"
    assert link.due(T0) == [], "one transaction at a time"
    assert link.due(T0 + 100 * MS - 1) == []
    assert link.due(T0 + 100 * MS) != [], "the reply is overdue"
    link.close("unplugged")
    assert link.due(T0 + 1000 * MS) == []
    assert status(link, T0).state == "closed"


def test_a_device_that_sends_unasked_is_sent_nothing(links: dict[str, DeviceLink]) -> None:
    link = links["left.pad"]
    assert link.open("port", T0) == b""
    assert link.due(T0 + 10**12) == []
    assert status(link, T0).state is None


def boot(link: DeviceLink, serial: str, t_ns: int) -> int:
    """Identify the sensor and send one reading; return how many readings are used."""
    link.open("port", t_ns)
    link.receive(bota_text.encode_banner("MiniONE", serial), t_ns)
    return len(link.receive(frame(t_ns), t_ns))


def test_L6_another_device_on_the_same_port_is_refused_and_the_first_accepted_again(
    links: dict[str, DeviceLink],
) -> None:
    link = links["left.wrench"]
    assert boot(link, "1234", T0) == 1
    assert "1234" in status(link, T0).hardware_id
    assert boot(link, "777", T0 + MS) == 0
    level, message = health(link, T0 + MS)
    assert level == Health.ERROR
    assert "another device answers" in message
    assert "777" in message
    assert "1234" in message
    assert boot(link, "1234", T0 + 2 * MS) == 1
    assert health(link, T0 + 2 * MS) == (Health.OK, "")


def test_L6_another_adapter_at_the_same_path_is_refused(links: dict[str, DeviceLink]) -> None:
    link = links["left.pad"]
    link.open("/dev/x (usb 0403:6001 A)", T0)
    link.open("/dev/x (usb 0403:6001 B)", T0)
    assert link.receive(pvdf.encode_scan(np.ones((4, 4), dtype=int), 1, 0.0, 5.0), T0) == []
    assert health(link, T0)[0] == Health.ERROR
    assert "another port answers" in health(link, T0)[1]


def test_D1_no_reading_is_used_before_the_device_has_identified_itself(left: str, parse: Parse) -> None:
    named = left.replace('port = "/dev/left-wrench"', 'port = "/dev/left-wrench"\nhardware_id = "MiniONE S/N 1234"')
    link = make_links(parse(named))["left.wrench"]
    link.open("port", T0)
    assert link.receive(frame(T0), T0) == []
    assert health(link, T0) == (Health.ERROR, "waits for the device to identify itself as 'MiniONE S/N 1234'")
    assert boot(link, "1234", T0) == 1
    assert boot(link, "777", T0) == 0
    assert "where hardware_id says 'MiniONE S/N 1234'" in health(link, T0)[1]


def test_L9_a_flood_drops_the_oldest_readings_and_is_reported(links: dict[str, DeviceLink]) -> None:
    link = links["left.wrench"]
    link.open("port", T0)
    flood = b"".join(frame(n * 1000) for n in range(1500))
    ((_, samples, times_ns),) = link.receive(flood, T0)
    assert len(samples) == len(times_ns) == 1000, "a second of readings may have waited"
    assert samples[-1].device_time_ns == 1499 * 1000
    assert (status(link, T0).dropped, status(link, T0).counters.good) == (500, 1500)
    assert health(link, T0) == (Health.WARN, "sends more than 4 times its rate: the oldest readings are dropped")
    ((_, samples, _),) = link.receive(flood, T0 + 10 * MS)
    assert len(samples) == 40, "four times 1000 Hz for 10 ms"
    now = feed(link, 1000.0, 1.5, T0 + 11 * MS)
    assert health(link, now) == (Health.OK, "")
    assert status(link, now).dropped == 500 + 1460


class Mute:
    """A session that is always due and never has bytes to write."""

    state, identity = "mute", ""

    def next_deadline(self) -> int:
        return T0

    def on_time(self, now_ns: int) -> bytes:
        del now_ns
        return b""


def test_a_session_that_is_due_without_bytes_to_write_ends_the_loop(links: dict[str, DeviceLink]) -> None:
    link = links["left.wrench"]
    link.open("port", T0)
    link.session = Mute()  # type: ignore[assignment]
    assert link.due(T0) == []


S = 1_000_000_000
LATER = T0 + 2 * S


def silent(link: DeviceLink, t_ns: int = LATER, source: str = "") -> str:
    level, message = health(link, t_ns, source)
    assert level is Health.STALE
    return message


def test_silence_right_after_opening_is_not_explained_yet(links: dict[str, DeviceLink]) -> None:
    link = links["left.wrench"]
    link.open("port", T0)
    assert silent(link, T0 + S) == "open, but no reading yet"


def test_a_stream_that_falls_silent_reports_why_by_recent_bytes_alone(links: dict[str, DeviceLink]) -> None:
    link = links["left.wrench"]
    link.open("port", T0)
    now = feed(link, 1000.0, 1.0, T0)
    health(link, now)
    assert silent(link, now + S // 2) == "no reading for 0.50 s"
    assert silent(link, now + 2 * S) == (
        "no reading for 2.00 s: open, but no bytes arrive: is it powered? is it connected to this port?"
    )
    link.receive(b"\xaa" * 500, now + 3 * S)
    assert "none is a Bota frame" in silent(link, now + 3 * S)


def test_the_note_of_a_decoder_is_reported_with_and_without_readings(links: dict[str, DeviceLink]) -> None:
    link = links["left.wrench"]
    link.open("port", T0)
    link._decoder.health.note = "press a pad"
    assert silent(link) == "press a pad"
    link.receive(frame(LATER), LATER)
    assert health(link, LATER) == (Health.OK, "press a pad")


class Failing:
    """A session with a bug in every call."""

    health = DecoderHealth()
    state = identity = ""

    def receive(self, data: bytes, t_ns: int) -> list[TactileSample]:
        raise OverflowError("cannot convert float infinity to integer")

    def forget(self) -> None:
        raise ValueError

    def start(self, now_ns: int) -> bytes:
        return b""

    def next_deadline(self) -> int | None:
        return 0

    def on_time(self, now_ns: int) -> bytes:
        raise KeyError("rate")


@pytest.mark.parametrize("name", ["left.wrench", "left.pad"])
def test_bytes_on_which_a_decoder_fails_are_dropped_and_reported(links: dict[str, DeviceLink], name: str) -> None:
    link = links[name]
    link.open("port", T0)
    good, session = link._decoder, link.session
    link._decoder = failing = Failing()
    if session is not None:
        link.session = failing
    assert link.receive(b"whatever", T0) == []
    expected = "its bytes cannot be read (OverflowError: cannot convert float infinity to integer): they are dropped"
    assert health(link, T0) == (Health.ERROR, expected)
    if session is not None:
        assert link.due(T0 + MS) == []
        assert health(link, T0 + MS) == (Health.ERROR, "its bytes cannot be read (KeyError: 'rate'): they are dropped")
    link._decoder, link.session = good, session
    assert health(link, T0 + 2 * S)[0] is Health.STALE
