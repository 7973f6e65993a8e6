"""Device, port, sensor, rate and options of a stream must fit each other."""

from __future__ import annotations

import pytest
from config_faults import GOOD, assert_one_fault, broken, faults, line

from slipd import config

FAULTS = [
    (
        'device = "bota"',
        'device = "pvdf"',
        "finger.left.wrench.device",
        "must be a wrench device, got 'pvdf'; known: bota, ",
    ),
    (
        'device = "pvdf"',
        'device = "bota"',
        "finger.left.pad.device",
        "must be a tactile device, got 'bota'; known: dsacon32, external, ",
    ),
    (
        'device = "robotiq_2f"',
        'device = "bota"',
        "gripper.device",
        "must be a gripper device, got 'bota'; known: external_gripper, robotiq_2f, wsg",
    ),
    ('device = "bota"', 'device = "botta"', "finger.left.wrench.device", "must be a wrench device, got 'botta'"),
    (
        'port = "ws://127.0.0.1:5000"',
        'port = "/dev/xela"',
        "finger.right.pad.port",
        "must be ws://HOST:PORT for xela, got '/dev/xela'",
    ),
    ('sensor = "2"', "# no sensor", "finger.right.pad.sensor", 'must name one sensor of the port, such as "1"'),
    (
        "cols = 16",
        'cols = 16\nsensor = "1"',
        "finger.left.pad.sensor",
        "must be left out: a pvdf port carries one sensor",
    ),
    ("rate_hz = 800", "rate_hz = 800\ndelay_s = 0.02", "finger.left.wrench.delay_s", "less than 0.02 s"),
    ("rate_hz = 800", "rate_hz = 800\nstale_s = 0.009", "finger.left.wrench.stale_s", "from 0.01 to 0.5 s"),
    ("rate_hz = 800", "rate_hz = 800\nstale_s = 0.51", "finger.left.wrench.stale_s", "got 0.51"),
    ("rate_hz = 60.0", "rate_hz = 60.0\nstale_s = 0.02", "finger.right.pad.stale_s", "from 0.025 to 0.5 s"),
    ("rate_hz = 60.0", "rate_hz = 5.0\nstale_s = 2.1", "finger.right.pad.stale_s", "from 0.3 to 2 s"),
    ("rate_hz = 60.0", "rate_hz = 60.0\nstale_s = 0.1\ndelay_s = 0.1", "finger.right.pad.delay_s", "less than 0.1 s"),
    ("rate_hz = 60.0", "rate_hz = 60.0\ndelay_s = 0.05", "finger.right.pad.delay_s", "less than 0.05 s"),
    (
        "rate_hz = 800",
        "rate_hz = 800\noptions = { sinc_length = 9 }",
        "finger.left.wrench.options",
        "sinc_length must be an integer from 64",
    ),
    ("rate_hz = 800", "rate_hz = 800\noptions = { sinc_length = 64.5 }", "finger.left.wrench.options", "64.5"),
    (
        "rate_hz = 50.0",
        "rate_hz = 50.0\noptions = { unit = 300 }",
        "gripper.options",
        "an integer from 1 to 247",
    ),
    ("rate_hz = 50.0", 'rate_hz = 50.0\noptions = { unit = "9" }', "gripper.options", "from 1 to 247, got '9'"),
    ("rate_hz = 50.0", "rate_hz = 50.0\noptions = { poll_period_s = 1e300 }", "gripper.options", ""),
    ("rate_hz = 800", "rate_hz = 800\noptions = { speed = 9 }", "finger.left.wrench.options", "speed"),
]


@pytest.mark.parametrize(("old", "new", "path", "expected"), FAULTS)
def test_keys_of_a_stream_that_do_not_fit_are_reported(old: str, new: str, path: str, expected: str) -> None:
    assert_one_fault(old, new, path, expected)


@pytest.mark.parametrize(
    ("address", "fault"),
    [
        ("udp://", "no host"),
        ("udp://:49152", "no host"),
        ("udp://192.168.1.1", "no port from 1 to 65535"),
        ("udp://192.168.1.1:0", "no port from 1 to 65535"),
        ("udp://192.168.1.1:65536", "not an address (Port out of range 0-65535)"),
        ("udp://[::1:49152", "not an address"),
        ("udp://a..b:49152", "not an address"),
        (f"udp://{64 * 'a'}:49152", "not an address"),
    ],
)
def test_an_address_without_a_host_or_a_valid_port_is_refused(address: str, fault: str) -> None:
    text = GOOD.replace('device = "bota"\nport = "/dev/left-wrench"', f'device = "netft"\nport = "{address}"')
    [(path, at, message)] = faults(text)
    assert (path, at) == ("finger.left.wrench.port", line("/dev/left-wrench"))
    assert message.startswith(f"must be udp://HOST:PORT, got {address!r}: {fault}")


def test_the_address_of_a_websocket_server_needs_no_port() -> None:
    assert config.parse(GOOD.replace("127.0.0.1:5000", "pads"), "rig.toml").finger["right"].pad is not None
    [(path, _, _)] = faults(GOOD.replace("127.0.0.1:5000", ""))
    assert path == "finger.right.pad.port"


def test_a_rate_slightly_beyond_the_data_sheet_is_accepted() -> None:
    """Clocks run fast, and some sensors send more than their data sheet promises."""
    assert config.parse(broken("rate_hz = 800", "rate_hz = 1000"), "rig.toml").finger["left"].wrench


def test_a_port_with_a_zero_byte_is_refused() -> None:
    [(path, _, _)] = faults(GOOD.replace("/dev/left-wrench", "a\\u0000b"))
    assert path == "finger.left.wrench.port"


def test_rows_and_cols_must_not_be_among_the_options() -> None:
    [(path, _, message)] = faults(broken("rows = 8", "options = { rows = 3 }\nrows = 8"))
    assert path == "finger.left.pad.options"
    assert message == "must not contain rows: write them as keys of the pad"


def test_the_decoder_of_a_scanned_pad_gets_its_size() -> None:
    rig = config.parse(GOOD, "rig.toml")
    left, right = rig.finger["left"].pad, rig.finger["right"].pad
    assert left is not None
    assert right is not None
    assert config.device_options(left) == {"rows": 8, "cols": 16}
    assert config.device_options(right) == {}
