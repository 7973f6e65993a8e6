"""A config names the package of a device that is not one of slipd's own."""

from __future__ import annotations

import pytest
from config_faults import GOOD, faults
from other_packages import Install, install

from slipd import config

__all__ = ["install"]

MINE = """
from slipd.devices import Device
from slipd.devices.bota import Decoder

class Odd:
    def __init__(self, wrong=0):
        if wrong:
            raise KeyError(wrong)

DEVICE = Device("mine", "wrench", ("serial",), {decoder}, interface=1)
"""
SHIPPED = 'device = "bota"'
OTHER = 'device = "mine"\npackage = "some-sensor"'


def fault(new: str) -> str:
    [(path, _, message)] = faults(GOOD.replace(SHIPPED, new))
    return f"{path.removeprefix('finger.left.wrench.')} {message}"


def test_G4_the_package_to_install_is_named(install: Install) -> None:
    needs = "package 'mine' needs the package {!r}, which {}: install it with pip"
    assert fault(OTHER) == needs.format("some-sensor", "is not installed")
    assert fault('device = "mine"\npackage = "numpy"') == needs.format("numpy", "does not provide it")
    install("some-sensor", "mine", "mine_module:DEVICE", MINE.format(decoder="Decoder"))
    assert config.parse(GOOD.replace(SHIPPED, OTHER), "rig.toml").finger["left"].wrench
    assert config.parse(GOOD.replace(SHIPPED, OTHER.replace("-", "_")), "rig.toml").finger["left"].wrench


def test_the_package_must_be_that_of_the_device(install: Install) -> None:
    install("some-sensor", "mine", "mine_module:DEVICE", MINE.format(decoder="Decoder"))
    assert fault('device = "mine"') == "package must be 'some-sensor', the package that provides 'mine', got ''"
    assert fault('device = "bota"\npackage = "a"') == "package must be left out: 'bota' is a device of slipd, got 'a'"


@pytest.mark.parametrize(
    ("module", "options", "why"),
    [
        ("1/0", "", "'mine' of some-sensor cannot be used: mine_module:DEVICE cannot be loaded: ZeroDivisionError"),
        (MINE.format(decoder="Odd"), "\noptions = { wrong = 1 }", "'mine' cannot be used: KeyError: 1"),
        (MINE.format(decoder="Odd"), "", "'mine' cannot be used: it makes no slipd.devices.Decoder"),
    ],
)
def test_G4_a_package_that_does_not_work_is_a_fault_of_the_config(
    install: Install, module: str, options: str, why: str
) -> None:
    install("some-sensor", "mine", "mine_module:DEVICE", module)
    assert fault(OTHER + options).startswith(f"device {why}")
