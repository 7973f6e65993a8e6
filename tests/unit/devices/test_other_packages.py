"""Devices of other packages: found by their entry points, checked, and named when they cannot be used."""

from __future__ import annotations

from pathlib import Path

import pytest
from other_packages import Install, install

from slipd.devices import DEVICES, INTERFACE, find_device, installed, is_installed, normalized

__all__ = ["install"]

GOOD = """
from slipd.devices import Device
from slipd.devices.bota import Decoder
DEVICE = Device("mine", "wrench", ("serial",), Decoder, interface=1)
"""


def fault_of(name: str) -> str:
    found = find_device(name)
    assert found in installed()
    assert found is not None
    assert (found.device, name in DEVICES) == (None, False)
    return f"{found.package}: {found.fault}"


def test_a_device_of_another_package_is_listed_after_those_of_slipd_and_found_by_its_name(install: Install) -> None:
    install("some-sensor", "mine", "mine_module:DEVICE", GOOD)
    found = installed()[-1]
    assert (found.name, found.package, found.version, found.fault) == ("mine", "some-sensor", "1.2", "")
    assert DEVICES["mine"] is found.device
    assert list(DEVICES)[-1] == "mine"
    assert len(DEVICES) == len(installed())
    assert find_device("nothing") is None


@pytest.mark.parametrize(
    ("names", "module", "fault"),
    [
        ("gone_module:DEVICE", "", "gone_module:DEVICE cannot be loaded: ModuleNotFoundError: No module named"),
        ("bad_module:DEVICE", "1/0", "bad_module:DEVICE cannot be loaded: ZeroDivisionError: division by zero"),
        ("dict_module:DEVICE", "DEVICE = {}", "its entry point must name a slipd.devices.Device, got dict"),
        (
            "other_module:DEVICE",
            GOOD.replace('"mine"', '"other"'),
            "its entry point must have the name of the device, 'other', got 'mine'",
        ),
        ("new_module:DEVICE", GOOD.replace("=1", "=2"), f"it must be written for interface {INTERFACE} of slipd 0.1.0"),
        ("old_module:DEVICE", GOOD.replace(", interface=1", ""), f"interface {INTERFACE} of slipd 0.1.0, got None"),
    ],
)
def test_G4_a_broken_package_is_named_and_stops_no_other_device(
    install: Install, names: str, module: str, fault: str
) -> None:
    install("some-sensor", "mine", names, module)
    assert fault_of("mine").startswith("some-sensor: ")
    assert fault in fault_of("mine")
    assert DEVICES["bota"].name == "bota"


def test_a_name_that_two_packages_or_slipd_itself_use_is_refused(install: Install) -> None:
    install("some-sensor", "mine", "mine_module:DEVICE", GOOD)
    install("another", "mine", "mine_module:DEVICE", folder="second")
    install("some-sensor", "mine", "mine_module:DEVICE", folder="third")  # the same package again, further ahead
    assert fault_of("mine").endswith("more than one package provides it; uninstall all but one")
    install("third-one", "bota", "bota_module:DEVICE", folder="fourth")
    assert installed()[-2].fault == "slipd 0.1.0 uses the name itself"
    assert DEVICES["bota"].interface is None


def test_damaged_metadata_of_a_package_hides_no_other(install: Install, tmp_path: Path) -> None:
    install("some-sensor", "mine", "mine_module:DEVICE", GOOD)
    (tmp_path / "site" / "damaged-1.0.dist-info").mkdir()
    (tmp_path / "site" / "damaged-1.0.dist-info" / "entry_points.txt").write_bytes(b"[slipd.devices]\nmine2 = \xff\n")
    assert "mine" in DEVICES
    assert "mine2" not in DEVICES


def test_names_of_packages_compare_as_on_an_index() -> None:
    assert normalized("Some_Sensor.X") == normalized("some-sensor-x")
    assert [is_installed(name) for name in ("NumPy", "no-such-package", "")] == [True, False, False]
