"""The list of devices, and what each declares: kind, transports, rates, clock, options and evidence."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from typing import Any

import pytest
from project import DOCS

from slipd.devices import DEVICES, EVIDENCE, Device
from slipd.tools.sim.emulators import make_emulator

devices = pytest.mark.parametrize("device", list(DEVICES.values()), ids=list(DEVICES))


US, MS = (1 << 32) * 1_000, (1 << 32) * 1_000_000
DECLARED: dict[str, tuple[Any, ...]] = {
    "bota": ("wrench", ("serial",), 460_800, 0, (51_200 / 2047, 800), US, 37, None, ()),
    "dsacon32": ("tactile", ("serial", "tcp"), 115_200, 1, (1, 30), MS, 0, None, ()),
    "external": ("any", ("external",), None, 0, (0.1, 10_000), None, 0, None, ()),
    "external_gripper": ("gripper", ("local",), None, 0, (1, 1000), None, 0, None, ()),
    "gauges": ("wrench", ("serial",), 921_600, 0, (1, 10_000), US, 36, None, ()),
    "netft": ("wrench", ("udp",), None, 0, (1, 7912), None, 0, None, ()),
    "optoforce": ("wrench", ("serial", "udp"), 1_000_000, 0, (1000 / 255, 1000), None, 0, None, ()),
    "papillarray": ("tactile", ("serial",), 115_200, 3, (100, 1000), None, 0, 9, ("0", "1")),
    "pvdf": ("tactile", ("serial",), 921_600, 1, (1, 2000), US, 0, None, ()),
    "robotiq_2f": ("gripper", ("serial",), 115_200, 0, (1, 200), None, 0, None, ()),
    "robotous": ("wrench", ("serial",), 115_200, 0, (10, 1000), None, 19, None, ()),
    "tsf85": ("tactile", ("serial",), 115_200, 1, (1000 / 255, 1000), None, 0, 28, ("0", "1")),
    "wsg": ("gripper", ("tcp",), None, 0, (5, 200), None, 0, None, ()),
    "wts": ("tactile", ("serial",), 115_200, 1, (1000 / 65_535, 1000), MS, 0, None, ()),
    "xela": ("tactile", ("websocket",), None, 3, (1, 1000), None, 0, None, ()),
}
"""Kind, transports, baud, axes; lowest and highest rate, 1/s; span of its clock; bytes of a frame on a UART; taxels;
its sensors."""


def test_the_list_names_each_device_once_with_what_it_declares() -> None:
    assert {
        device.name: (
            *(device.kind, device.transports, device.baud, device.axes, pytest.approx(device.rates_hz)),
            *(device.clock_span_ns, device.frame_bytes, device.taxels, tuple(device.sensors)),
        )
        for device in DEVICES.values()
    } == DECLARED
    assert list(DEVICES) == [device.name for device in DEVICES.values()] == list(DECLARED)
    silent = {name for name, device in DEVICES.items() if device.session is None}
    assert silent == {"external", "gauges", "pvdf", "xela"}


def test_the_page_states_the_evidence_of_each_device() -> None:
    page = (DOCS / "devices.md").read_text(encoding="utf-8")
    stated = dict(re.findall(r"^\| `(\w+)` \|.*\| ([^|]+) \|$", page.partition("## In a config")[0], re.MULTILINE))
    assert stated == {name: EVIDENCE[device.evidence] for name, device in DEVICES.items()}


@devices
def test_a_device_names_rates_that_its_emulator_and_its_line_have(device: Device) -> None:
    (low_hz, high_hz), rate_hz = device.rates_hz, make_emulator(device.name).rate_hz
    assert 0.0 < low_hz <= rate_hz <= high_hz > low_hz
    assert device.baud is None or rate_hz * device.frame_bytes * 10 <= device.baud
    assert (device.grip is not None) == (device.kind == "gripper" and device.name != "external_gripper")


@devices
def test_an_unknown_option_is_refused(device: Device) -> None:
    for make in filter(None, (device.decoder, device.session)):
        with pytest.raises(TypeError, match="colour"):
            make(colour="red")


@devices
def test_the_default_of_the_option_sets_a_rate_that_the_device_has(device: Device) -> None:
    """A default of 0 leaves the rate of the device as it is."""
    option, make = device.rate_option, device.session or device.decoder
    if option is not None and (default := inspect.signature(make).parameters[option.name].default):
        assert device.rates_hz[0] <= option.convert(default) <= device.rates_hz[1]
        assert option.convert(option.convert(default)) == pytest.approx(default), "and back"


@pytest.mark.process
def test_a_lookup_loads_only_that_device() -> None:
    code = (
        "import sys; from slipd.devices import DEVICES; DEVICES['xela'];"
        "print([m for m in ('slipd.devices.bota', 'slipd.devices.xela') if m in sys.modules])"
    )
    seen = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert seen.stdout.strip() == "['slipd.devices.xela']"
