"""The list of devices, and the contracts that every device must fulfil."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from project import DOCS

from slipd.devices import DEVICES, EVIDENCE, Device
from slipd.tools.sim.emulators import make_emulator

MS = 1_000_000
READINGS = 5

devices = pytest.mark.parametrize("device", list(DEVICES.values()), ids=list(DEVICES))


def test_the_list_names_each_device_once_with_its_kind_and_transports() -> None:
    assert {name: (device.kind, device.transports, device.baud, device.axes) for name, device in DEVICES.items()} == {
        "bota": ("wrench", ("serial",), 460_800, 0),
        "dsacon32": ("tactile", ("serial", "tcp"), 115_200, 1),
        "external": ("any", ("external",), None, 0),
        "external_gripper": ("gripper", ("local",), None, 0),
        "gauges": ("wrench", ("serial",), 921_600, 0),
        "netft": ("wrench", ("udp",), None, 0),
        "optoforce": ("wrench", ("serial", "udp"), 1_000_000, 0),
        "papillarray": ("tactile", ("serial",), 115_200, 3),
        "pvdf": ("tactile", ("serial",), 921_600, 1),
        "robotiq_2f": ("gripper", ("serial",), 115_200, 0),
        "robotous": ("wrench", ("serial",), 115_200, 0),
        "tsf85": ("tactile", ("serial",), 115_200, 1),
        "wsg": ("gripper", ("tcp",), None, 0),
        "wts": ("tactile", ("serial",), 115_200, 1),
        "xela": ("tactile", ("websocket",), None, 3),
    }
    assert all(name == device.name for name, device in DEVICES.items())
    silent = {"external", "gauges", "pvdf", "xela"}
    assert {name for name, device in DEVICES.items() if device.session is None} == silent
    assert len(DEVICES) == 15


US_MS_WRAP = {"µs": (1 << 32) * 1_000, "ms": (1 << 32) * 1_000_000, "": None}
DECLARED: dict[str, tuple[float, float, str, int, int | None, str]] = {
    "bota": (51_200 / 2047, 800, "µs", 37, None, ""),
    "dsacon32": (1, 30, "ms", 0, None, ""),
    "external": (0.1, 10_000, "", 0, None, ""),
    "external_gripper": (1, 1000, "", 0, None, ""),
    "gauges": (1, 10_000, "µs", 36, None, ""),
    "netft": (1, 7912, "", 0, None, ""),
    "optoforce": (1000 / 255, 1000, "", 0, None, ""),
    "papillarray": (100, 1000, "", 0, 9, "01"),
    "pvdf": (1, 2000, "µs", 0, None, ""),
    "robotiq_2f": (1, 200, "", 0, None, ""),
    "robotous": (10, 1000, "", 19, None, ""),
    "tsf85": (1000 / 255, 1000, "", 0, 28, "01"),
    "wsg": (5, 200, "", 0, None, ""),
    "wts": (1000 / 65_535, 1000, "ms", 0, None, ""),
    "xela": (1, 1000, "", 0, None, ""),
}
"""Lowest and highest rate, 1/s; what its 32-bit clock counts; bytes of a frame on a UART; taxels; its sensors."""


def test_each_device_declares_its_rates_its_clock_and_its_sensors() -> None:
    assert set(DECLARED) == set(DEVICES)
    for name, (low_hz, high_hz, clock, frame_bytes, taxels, sensors) in DECLARED.items():
        device = DEVICES[name]
        assert device.rates_hz == pytest.approx((low_hz, high_hz)), name
        assert (device.clock_span_ns, device.frame_bytes) == (US_MS_WRAP[clock], frame_bytes), name
        assert (device.taxels, "".join(device.sensors)) == (taxels, sensors), name


def test_the_page_states_the_evidence_of_each_device() -> None:
    page = (DOCS / "devices.md").read_text(encoding="utf-8")
    stated = dict(re.findall(r"^\| `(\w+)` \|.*\| ([^|]+) \|$", page.partition("## In a config")[0], re.MULTILINE))
    assert stated == {name: EVIDENCE[device.evidence] for name, device in DEVICES.items()}


@devices
def test_a_device_names_rates_that_its_emulator_and_its_line_have(device: Device) -> None:
    low_hz, high_hz = device.rates_hz
    assert 0.0 < low_hz < high_hz
    assert low_hz <= make_emulator(device.name).rate_hz <= high_hz
    if device.frame_bytes and device.baud is not None:
        assert make_emulator(device.name).rate_hz * device.frame_bytes * 10 <= device.baud
    assert (device.grip is not None) == (device.kind == "gripper" and device.name != "external_gripper")


def test_the_folder_of_shared_parts_is_not_a_device() -> None:
    for name in ("framing", "crc", "health", "no_such_device", "", "bota.py", "../errors"):
        assert name not in DEVICES
    with pytest.raises(KeyError, match="framing"):
        DEVICES["framing"]


@devices
def test_an_unknown_option_is_refused(device: Device) -> None:
    for make in filter(None, (device.decoder, device.session)):
        with pytest.raises(TypeError, match="colour"):
            make(colour="red")


@devices
def test_a_session_starts_reads_noise_and_stops(device: Device) -> None:
    if device.session is None:
        return
    session = device.session()
    assert session.state == "closed"
    assert session.next_deadline() is None
    session.start(0)
    for now_ns in range(0, 20_000_000_000, 100_000_000):
        due = session.next_deadline()
        assert due is not None
        if due <= now_ns:
            session.on_time(now_ns)
        assert session.receive(bytes(range(256)), now_ns) == []
    session.stop()
    assert session.next_deadline() is None


def listener_to(device: Device) -> Any:
    return (device.session or device.decoder)(**make_emulator(device.name).options)


def new_link(device: Device, listener: Any) -> Iterator[tuple[bytes, int]]:
    """Start again, and yield the data of the device with their times; the caller has processed all earlier data."""
    emulator: Any = make_emulator(device.name)
    emulator.opened(0)
    session = listener if device.session is not None else None
    output = emulator.receive(session.start(0), 0) if session else listener.forget() or []
    if device.inquiry is not None and (inquiry := device.inquiry(**emulator.options)) is not None:
        yield emulator.inquire(inquiry.request), 0
    for now_ns in range(MS, 5_000 * MS, MS):
        for data in output + emulator.advance(now_ns):
            yield data, now_ns
        output = []
        while session and (due := session.next_deadline()) is not None and due <= now_ns:
            output += emulator.receive(session.on_time(now_ns), now_ns)


def first_readings(device: Device, listener: Any) -> tuple[list[Any], int]:
    """Return the first readings of a new link, and the number of pieces they took."""
    readings: list[Any] = []
    for pieces, (data, now_ns) in enumerate(new_link(device, listener)):
        for sample in listener.receive(data, now_ns):
            fields = (getattr(sample, name) for name in sample.__slots__)
            readings.append(tuple(field.tolist() if isinstance(field, np.ndarray) else field for field in fields))
        if len(readings) >= READINGS:
            return readings, pieces
    raise AssertionError(f"{device.name} says too little")


@devices
def test_L5_a_frame_that_an_unplug_tore_is_not_completed_by_what_comes_after(device: Device) -> None:
    expected, last = first_readings(device, listener_to(device))
    listener = listener_to(device)
    for at, (data, now_ns) in enumerate(new_link(device, listener)):
        if at == last:
            break
        listener.receive(data, now_ns)
    listener.receive(data[: len(data) // 2], now_ns)
    next(new_link(device, listener), None)  # the link is opened again
    assert list(listener.receive(data[len(data) // 2 :], now_ns)) == []
    before = listener.health.lost, listener.health.duplicates, listener.health.restarts
    assert first_readings(device, listener)[0] == expected
    assert (listener.health.lost, listener.health.duplicates, listener.health.restarts) == before


@pytest.mark.process
def test_a_lookup_loads_only_that_device() -> None:
    code = (
        "import sys; from slipd.devices import DEVICES; DEVICES['xela'];"
        "print([m for m in ('slipd.devices.bota', 'slipd.devices.xela') if m in sys.modules])"
    )
    seen = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert seen.stdout.strip() == "['slipd.devices.xela']"
