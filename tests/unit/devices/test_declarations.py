"""What devices declare for a config: the option that sets their rate, and what they do not report."""

from __future__ import annotations

import inspect
import math

import pytest

from slipd.devices import DEVICES, RateOption


def default_of(name: str) -> float:
    """Return the default of the option that sets the rate; 0: it leaves the rate of the device as it is."""
    device = DEVICES[name]
    option = device.rate_option
    return (
        0.0 if option is None else inspect.signature(device.session or device.decoder).parameters[option.name].default
    )


SET = [name for name in DEVICES if default_of(name)]


@pytest.mark.parametrize("name", SET)
def test_the_default_of_the_option_sets_a_rate_that_the_device_has(name: str) -> None:
    device = DEVICES[name]
    assert device.rate_option is not None
    default = default_of(name)
    rate_hz = device.rate_option.convert(default)
    least_hz, most_hz = device.rates_hz
    assert least_hz <= rate_hz <= most_hz
    assert device.rate_option.convert(rate_hz) == pytest.approx(default), "and back"


def test_no_interval_is_as_fast_as_the_device_can() -> None:
    assert RateOption("interval_ms", 1000.0).convert(0.0) == math.inf


def test_an_option_that_is_needed_is_one_that_the_decoder_takes() -> None:
    for device in DEVICES.values():
        for need in device.needs:
            name = need.key.removeprefix("options.")
            if name != need.key:
                assert name in inspect.signature(device.decoder).parameters
