"""Links: one for each address; their streams, and the identity of the device."""

from __future__ import annotations

import numpy as np
import pytest
from device_links import frame, health, status
from fixture_types import Parse
from nanoseconds import MS, T0, S

from slipd.devices import bota
from slipd.devices.pvdf import encode_scan
from slipd.events import NEVER_NS, LinkSpec
from slipd.links.device_link import RESTART_NS, DeviceLink, make_links
from slipd.tools.sim import emulated_wrenches as sim
from slipd.tools.sim.emulated_pads import encode_message
from slipd_client.messages import Health


def scan(rows: int = 4, cols: int = 4, number: int = 1) -> bytes:
    return encode_scan(np.ones((rows, cols), dtype=int), number, 0.0, 5.0)


def skin(number: int, sensors: str) -> bytes:
    return encode_message(number, {sensor: np.full((4, 3), 1000) for sensor in sensors}, 1.7e9)


def test_streams_that_share_an_address_share_one_link_named_after_the_first(links: dict[str, DeviceLink]) -> None:
    assert {name: link.spec for name, link in links.items()} == {
        "left.wrench": LinkSpec("left.wrench", "serial", "/dev/left-wrench", 460_800),
        "left.pad": LinkSpec("left.pad", "serial", "/dev/left-pad", 921_600),
        "right.pad": LinkSpec("right.pad", "websocket", "ws://127.0.0.1:5000", 0),
        "gripper": LinkSpec("gripper", "serial", "/dev/gripper", 115_200),
    }
    assert [meter.name for meter in links["right.pad"].streams.values()] == ["right.pad", "third.pad"]


def test_options_of_the_config_reach_the_decoder(left: str, parse: Parse) -> None:
    links = make_links(parse(left.replace("rows = 4", "rows = 2").replace("cols = 4", "cols = 3")))
    (((sample,), _, _, name),) = links["left.pad"].receive(scan(2, 3), T0)
    assert (name, np.shape(sample.values)) == ("left.pad", (6,))


def test_L5_a_scan_cut_off_by_an_unplug_is_not_completed_by_later_bytes(links: dict[str, DeviceLink]) -> None:
    link = links["left.pad"]
    link.open("/dev/left-pad", T0)
    link.receive(scan()[:50], T0)
    link.close("unplugged")
    link.open("/dev/left-pad", T0)
    assert link.receive(scan()[50:], T0) == []


def test_only_open_links_to_devices_with_commands_send_last_bytes(links: dict[str, DeviceLink]) -> None:
    assert links["left.wrench"].farewell() == b""
    for link in links.values():
        link.open("address", T0)
    last_bytes = {name: link.farewell() for name, link in links.items()}
    assert last_bytes == dict.fromkeys(links, b"") | {"left.wrench": bota.CONFIGURE}


def test_readings_on_a_shared_port_are_assigned_by_their_sensor_and_those_of_no_stream_are_ignored(
    links: dict[str, DeviceLink],
) -> None:
    found = links["right.pad"].receive(skin(1, sensors="1234"), T0)
    sources = [(name, sample.source) for samples, _, _, name in found for sample in samples]
    assert sorted(sources) == [("right.pad", "2"), ("third.pad", "1")]


def test_a_session_writes_only_while_its_link_is_up_and_a_device_that_sends_unasked_is_sent_nothing(
    links: dict[str, DeviceLink],
) -> None:
    link, unasked = links["gripper"], links["left.pad"]
    assert (link.due(T0), link.due_ns) == ([], NEVER_NS)
    assert link.open("port", T0) != b""
    assert link.due(T0) == [], "one transaction at a time"
    assert (status(link, T0)["state"], link.due_ns) == ("waiting", T0 + 100 * MS)
    assert link.due(T0 + 100 * MS - 1) == []
    assert link.due(T0 + 100 * MS) != [], "the reply is overdue"
    link.close("unplugged")
    assert link.due(T0 + 1000 * MS) == []
    assert (status(link, T0)["state"], link.due_ns) == ("closed", NEVER_NS)
    assert (unasked.open("port", T0), unasked.due(T0 + 10**12), unasked.fault) == (b"", [], "")
    assert status(unasked, T0)["state"] is None


def test_a_session_that_fails_as_it_writes_begins_again_a_second_after_its_start(
    links: dict[str, DeviceLink], monkeypatch: pytest.MonkeyPatch
) -> None:
    link = links["gripper"]
    greeting = link.open("port", T0)
    with monkeypatch.context() as patch:
        patch.setattr(type(link.session), "on_time", lambda *_: 1 / 0)
        assert link.due(T0 + 100 * MS) == []
    assert (link.failed, "ZeroDivisionError" in link.fault, link.due_ns) == (True, True, T0 + RESTART_NS)
    assert link.due(T0 + RESTART_NS) == [greeting]


def boot(link: DeviceLink, serial: str, t_ns: int) -> int:
    """Identify the sensor and send one reading; return how many readings are used."""
    link.open("port", t_ns)
    link.receive(sim.encode_banner("MiniONE", serial), t_ns)
    return len(link.receive(frame(t_ns), t_ns))


def test_L6_another_device_on_the_same_port_is_refused_and_the_first_accepted_again(
    links: dict[str, DeviceLink],
) -> None:
    link = links["left.wrench"]
    assert boot(link, "1234", T0) == 1
    assert "1234" in status(link, T0)["hardware_id"]
    assert boot(link, "777", T0 + MS) == 0
    why = "another device answers: 'MiniONE S/N 777', where 'MiniONE S/N 1234' was; restart slipd"
    assert health(link, T0 + MS) == (Health.ERROR, why)
    assert boot(link, "1234", T0 + 2 * MS) == 1
    assert health(link, T0 + 2 * MS) == (Health.OK, "")


def test_L6_another_adapter_at_the_same_path_is_refused(links: dict[str, DeviceLink]) -> None:
    link = links["left.pad"]
    link.open("/dev/x (usb 0403:6001 A)", T0)
    link.open("/dev/x (usb 0403:6001 B)", T0)
    assert link.receive(scan(), T0) == []
    why = "another port answers: '/dev/x (usb 0403:6001 B)', where '/dev/x (usb 0403:6001 A)' was"
    assert health(link, T0) == (Health.ERROR, why)


def test_D1_no_reading_is_used_before_the_device_has_identified_itself(left: str, parse: Parse) -> None:
    named = left.replace('port = "/dev/left-wrench"', 'port = "/dev/left-wrench"\nhardware_id = "MiniONE S/N 1234"')
    link = make_links(parse(named))["left.wrench"]
    link.open("port", T0)
    assert link.receive(frame(T0), T0) == []
    assert health(link, T0) == (Health.ERROR, "waits for the device to identify itself as 'MiniONE S/N 1234'")
    assert boot(link, "1234", T0) == 1
    assert boot(link, "777", T0) == 0
    assert "where hardware_id says 'MiniONE S/N 1234'" in health(link, T0)[1]


def raising(*_: object) -> bytes:
    raise KeyError("speed")


@pytest.mark.parametrize(
    ("deadlines", "pieces", "sent"),
    [([T0] * 2, [b""], []), ([T0 - 1, T0, T0, T0 + 1], [b"", b"next"], [b"next"])],
    ids=["it stays due", "it is due again"],
)
def test_a_session_that_is_due_without_bytes_to_write_ends_the_loop_unless_time_goes_on(
    deadlines: list[int],
    pieces: list[bytes],
    sent: list[bytes],
    links: dict[str, DeviceLink],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    link, left = links["left.wrench"], iter(pieces)
    link.open("port", T0)
    monkeypatch.setattr(link.session, "next_deadline", iter(deadlines).__next__)
    monkeypatch.setattr(link.session, "on_time", lambda _: next(left))
    assert link.due(T0) == sent


def test_bytes_on_which_a_decoder_fails_are_dropped_and_reported_and_what_it_kept_is_forgotten(
    links: dict[str, DeviceLink], monkeypatch: pytest.MonkeyPatch
) -> None:
    link = links["left.pad"]
    link.open("port", T0)
    link.receive(scan()[:50], T0)
    with monkeypatch.context() as patch:
        patch.setattr(link._decoder, "receive", raising)
        assert link.receive(b"whatever", T0) == []
        assert health(link, T0) == (Health.ERROR, "its bytes cannot be read (KeyError: 'speed'): they are dropped")
        patch.setattr(link._decoder, "forget", raising)
        assert link.receive(b"whatever", T0) == []
    assert link.receive(scan()[50:], T0) == []
    assert health(link, T0 + 2 * S)[0] is Health.STALE
    assert len(link.receive(scan(number=2), T0 + 2 * S)) == 1


@pytest.mark.parametrize("call", ["start", "receive", "next_deadline", "stop"])
def test_a_session_that_fails_begins_anew_at_most_once_a_second(
    links: dict[str, DeviceLink], monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    """It is an error of its own stream only."""
    link = links["gripper"]
    greeting = link.open("port", T0 - 9 * S)
    with monkeypatch.context() as patch:
        patch.setattr(link.session, call, raising)
        assert link.open("port", T0) == (greeting if call in ("receive", "stop") else b"")
        if call == "stop":
            assert link.farewell() == b""
            return
        assert link.receive(b"whatever", T0 + S // 2) == link.due(T0 + S // 2) == []
        expected = "its bytes cannot be read (KeyError: 'speed'): they are dropped"
        assert health(link, T0 + S // 2) == (Health.ERROR, expected)
        assert link.failed
    assert link.due(T0 + S - 1) == link.receive(b"whatever", T0 + S - 1) == []
    assert link.due(T0 + S) == [greeting]
    patch.setattr(link.session, "receive", raising)
    link.receive(b"whatever", T0 + 9 * S)
    assert link.due(T0 + 9 * S) == [greeting], "at once, as the session last began long ago"
