"""Values that no rig can have, or that do not fit each other, are refused with their line and the rule."""

from __future__ import annotations

import pytest
from config_faults import GOOD, broken, faults

from slipd import config
from slipd.tools.shipped_files import shipped_config

BELOW = "rate_hz = 800\n"
"""The line below which keys of the left force sensor are written."""

STREAM = [
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
    ("rate_hz = 60.0", "rate_hz = 5.0\nstale_s = 2.0\ndelay_s = 1.01", "finger.right.pad.delay_s", "got 1.01"),
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
    (
        "rate_hz = 800",
        "rate_hz = 800\noptions = { speed = 9 }",
        "finger.left.wrench.options.speed",
        "it has sinc_length",
    ),
    (
        "rate_hz = 800",
        "rate_hz = 800\noptions = { sinc_lenght = 64 }",
        "finger.left.wrench.options.sinc_lenght",
        "unknown option of bota; did you mean 'sinc_length'?",
    ),
    ("rate_hz = 800", BELOW + "range_n = 1e7", "finger.left.wrench.range_n", "must be from 0.1 to 100000 N, got 1e+07"),
    ("rate_hz = 800", "rate_hz = 1e-300", "finger.left.wrench.rate_hz", "must be at least 0.001"),
    ("rate_hz = 800", "rate_hz = 1e300", "finger.left.wrench.rate_hz", "must be at most 1000000"),
    ('port = "/dev/left-wrench"', 'port = "a\\u0000b"', "finger.left.wrench.port", "must be a text without control"),
    (
        "rows = 8",
        "options = { rows = 3 }\nrows = 8",
        "finger.left.pad.options",
        "must not contain rows: write them",
    ),
    ("rate_hz = 60.0", "rate_hz = 60.0\npoll_s = 1.01", "finger.right.pad.poll_s", "got 1.01"),
    ("rate_hz = 60.0", "rate_hz = 60.0\npoll_s = -0.01", "finger.right.pad.poll_s", "got -0.01"),
    ('port = "ws://127.0.0.1:5000"', 'port = "ws://"', "finger.right.pad.port", "no host"),
    *(
        (
            'device = "bota"\nport = "/dev/left-wrench"',
            f'device = "netft"\nport = "{address}"',
            "finger.left.wrench.port",
            f"must be udp://HOST:PORT, got {address!r}: {fault}",
        )
        for address, fault in (
            ("udp://", "no host"),
            ("udp://:49152", "no host"),
            ("udp://192.168.1.1", "no port from 1 to 65535"),
            ("udp://192.168.1.1:0", "no port from 1 to 65535"),
            ("udp://192.168.1.1:65536", "not an address (Port out of range 0-65535)"),
            ("udp://[::1:49152", "not an address"),
            ("udp://a..b:49152", "not an address"),
            (f"udp://{64 * 'a'}:49152", "not an address"),
        )
    ),
]
FINGER = [
    (
        "axis_scale = [0.001, 0.001, -0.001]",
        "axis_scale = [0.001]",
        "finger.right.pad.axis_scale",
        "must have 3 value(s)",
    ),
    ("axis_scale = [0.001, 0.001", "axis_scale = [0.001, 0", "finger.right.pad.axis_scale", "must not contain 0"),
    (
        "electrode_m = 0.0015",
        "axis_scale = [1.0, 1.0]\nelectrode_m = 0.0015",
        "finger.left.pad.axis_scale",
        "must have 1 value(s)",
    ),
    (
        "electrode_m = 0.0015",
        "tare = [1.0]\nelectrode_m = 0.0015",
        "finger.left.pad.tare",
        "must have 128 values, got 1",
    ),
    ("axis_scale = [0.001", "charge_tau_s = 2.0\naxis_scale = [0.001", "finger.right.pad.charge_tau_s", "not charge"),
    ("mu = 0.5", "mu = 0.5\nmu_max = 0.4", "finger.left.mu_max", "must be at least mu, 0.5, got 0.4"),
    ("mu = 0.5", "mu = 0.5\nmu_max = 2.1", "finger.left.mu_max", "must be from 0.01 to 2, got 2.1"),
    *(
        (
            "mu = 0.5",
            f"mu = 0.5\nmu_spread = {spread}",
            "finger.left.mu_spread",
            f"must be from 0.001 to 1, got {spread}",
        )
        for spread in ("0.0001", "1.01", "-0.1")
    ),
    *(
        (
            "rate_hz = 800",
            BELOW + f"pad_from_sensor = {{ quat_xyzw = {quaternion} }}",
            "finger.left.wrench.pad_from_sensor.quat_xyzw",
            f"got one of length {length}",
        )
        for quaternion, length in (("[0, 0, 0, 0]", "0"), ("[5, 0, 0, 3]", "5.831"))
    ),
]
GRIPPER = [
    (
        "max_force_n = 25.0",
        "max_force_n = 30.5",
        "gripper.max_force_n",
        "must be at most the largest force of force_table, 30 N, got 30.5",
    ),
    (
        "max_force_n = 25.0",
        "max_force_n = 3.0",
        "gripper.max_force_n",
        "must be above the least force of force_table, 3 N, got 3",
    ),
    (
        "max_force_n = 25.0",
        "max_force_n = 25.0\nmin_force_n = 2.0",
        "gripper.min_force_n",
        "must be at least the smallest force of force_table, 3 N, got 2",
    ),
    ("force_table = [[0, 3.0], [255, 30.0]]", "force_table = [[9, 3.0], [0, 30.0]]", "gripper.force_table", "rise"),
    ("force_table = [[0, 3.0], [255, 30.0]]", "force_table = [[0, 3.0], [256, 30.0]]", "gripper.force_table", "255"),
    ("force_table = [[0, 3.0], [255, 30.0]]", "force_table = [[-1, 3.0], [9, 30.0]]", "gripper.force_table", "0"),
    ("force_table = [[0, 3.0], [255, 30.0]]", "force_table = [[0, -3.0], [9, 30.0]]", "gripper.force_table", "or more"),
    ("  [1.0, 0.0]", "  [1.5, 0.0]", "gripper.width_table", "closure must rise within 0…1"),
    ("  [1.0, 0.0]", "  [1.0, 0.1]", "gripper.width_table", "while the width falls"),
    ("  [1.0, 0.0]", "  [0.0, 0.085]", "gripper.width_table", "closure must rise within 0…1"),
    ("speed_table = [[0, 0.02], [255, 0.15]]", "speed_table = [[9, 0.2], [1, 1]]", "gripper.speed_table", "rise"),
    ("speed_table = [[0, 0.02], [255, 0.15]]", "speed_table = [[0, 0.2], [300, 1]]", "gripper.speed_table", "255"),
]
WHOLE = [
    (
        'port = "/dev/left-pad"',
        'port = "/dev/left-wrench"',
        "finger.left.pad.port",
        "must differ from the port of left.wrench, or each needs a 'sensor' of its own",
    ),
    ('port = "/dev/gripper"', 'port = "/dev/left-pad"', "gripper.port", "must differ from the port of left.pad"),
    ("caution = 0.6", "caution = 0.85", "levels.caution", "must be below levels.warning, 0.85, got 0.85"),
    ("caution = 0.6", "caution = 0.0", "levels.caution", "must be above 0, got 0"),
    ("caution = 0.6", "caution = 1.0", "levels.caution", "must be below 1, got 1"),
    ("caution = 0.6", "caution = 0.05", "levels.hysteresis", "must be below levels.caution, 0.05, got 0.05"),
    ("[levels]", "[rates]\nslip_hz = 1e300\n[levels]", "rates.slip_hz", "must be at most 1000000"),
    (
        "[levels]",
        "[recording.continuous]\nkeep_bytes = 399_999_999\n[levels]",
        "recording.continuous.keep_bytes",
        "must be at least twice recording.continuous.file_bytes, 200000000, got 399999999",
    ),
]
IMPOSSIBLE = [
    (
        "pitch_m = 0.0032",
        "pitch_m = 3.2",
        "finger.left.pad.pitch_m",
        "must be from 0.0001 to 0.05 m, got 3.2: did you mean 3.2 mm? write 0.0032",
    ),
    ("pitch_m = 0.0032", "pitch_m = 1e-6", "finger.left.pad.pitch_m", "must be from 0.0001 to 0.05 m, got 1e-06"),
    ("pitch_m = 0.0032", "pitch_m = 0.04", "finger.left.pad.pitch_m", "the pad must be at most 0.5 m long, got 0.64 m"),
    ("electrode_m = 0.0015", "electrode_m = 1.5", "finger.left.pad.electrode_m", "did you mean 1.5 mm? write 0.0015"),
    (
        "electrode_m = 0.0015",
        "electrode_m = 0.0033",
        "finger.left.pad.electrode_m",
        "must be at most pitch_m, 0.0032 m",
    ),
    (
        "rate_hz = 800",
        "rate_hz = 800\npad_from_sensor = { xyz_m = [0.0, 0.0, -25.0] }",
        "finger.left.wrench.pad_from_sensor.xyz_m",
        "must be from -1 to 1 m, got -25: did you mean -25 mm? write -0.025",
    ),
    (
        "rate_hz = 800",
        "rate_hz = 800\nmass_kg = 85.0",
        "finger.left.wrench.mass_kg",
        "must be from 1e-05 to 10 kg, got 85: did you mean 85 g? write 0.085",
    ),
    ("rate_hz = 800", "rate_hz = 800\nmass_kg = -0.1", "finger.left.wrench.mass_kg", "got -0.1"),
    ("rate_hz = 800", "rate_hz = 800\ncom_m = [0.0, 2.0, 0.0]", "finger.left.wrench.com_m", "did you mean 2 mm?"),
    ("rate_hz = 800", "rate_hz = 800\nforce_std_n = 20.0", "finger.left.wrench.force_std_n", "did you mean 20 mN?"),
    (
        "rate_hz = 800",
        "rate_hz = 800\nrange_n = 0.3",
        "finger.left.min_normal_n",
        "below wrench.range_n, 0.3 N, got 0.3",
    ),
    ("mu = 0.5", "mu = 2.1", "finger.left.mu", "must be from 0.01 to 2, got 2.1"),
    ("mu = 0.5", "mu = 5", "finger.left.mu", "must be from 0.01 to 2, got 5: did you mean 0.5?"),
    ("mu = 0.5", "mu = 55.0", "finger.left.mu", "must be from 0.01 to 2, got 55: did you mean 0.55?"),
    (
        "rate_hz = 800",
        "rate_hz = 800\npad_from_sensor = { quat_xyzw = [0.0, 0.0, 0.7, 0.7] }",
        "finger.left.wrench.pad_from_sensor.quat_xyzw",
        "got one of length 0.9899: its digits are too few; write [0.0, 0.0, 0.7071068, 0.7071068]",
    ),
    ("mu = 0.5", "mu = 0.5\nmin_normal_n = 60.0", "finger.left.min_normal_n", "must be at most 50 N, got 60"),
    (
        "rate_hz = 800",
        "rate_hz = 4000",
        "finger.left.wrench.rate_hz",
        "must be from 25.01 to 800 Hz, the rates of bota, got 4000",
    ),
    (
        "rate_hz = 800",
        "rate_hz = 0.00125",
        "finger.left.wrench.rate_hz",
        "did you mean a period of 0.00125 s? write 800",
    ),
    (
        "rate_hz = 800",
        "rate_hz = 800\nbaud = 295999",
        "finger.left.wrench.rate_hz",
        "at most 800 Hz, the most that bota can send at 295999 bit/s, got 800; lower it or raise baud (default 460800)",
    ),
    (
        "rate_hz = 50.0",
        "rate_hz = 500.0",
        "gripper.rate_hz",
        "must be from 1 to 200 Hz, the rates of robotiq_2f, got 500",
    ),
    (
        "force_table = [[0, 3.0], [255, 30.0]]",
        "force_table = [[0, 3.0], [255, 3000.0]]",
        "gripper.force_table",
        "must have a largest force on one pad of at most 235 N, the most of any robotiq_2f, got 3000",
    ),
    (
        "speed_table = [[0, 0.02], [255, 0.15]]",
        "speed_table = [[0, 20.0], [255, 150.0]]",
        "gripper.speed_table",
        "must be from 0 to 2 m/s, got 20: did you mean 20 mm/s? write 0.02",
    ),
    (
        "speed_table = [[0, 0.02], [255, 0.15]]",
        "speed_table = [[0, 0.02], [255, 1.5]]",
        "gripper.speed_table",
        "must have a largest speed of at most 0.25 m/s, the most of any robotiq_2f, got 1.5",
    ),
    ("  [0.0, 0.085]", "  [0.0, 85.0]", "gripper.width_table", "must be from 0 to 1 m, got 85: did you mean 85 mm?"),
    ("  [0.0, 0.085]", "  [0.0, 0.85]", "gripper.width_table", "must have a stroke of at most 0.14 m"),
    ("max_force_n = 25.0", "max_force_n = 25.0\nraise_n_per_s = 1e9", "gripper.raise_n_per_s", "got 1e+09"),
    ("caution = 0.6", "caution = 0.6\n[reflex]\ncalm_s = 1e9", "reflex.calm_s", "must be from 0.001 to 3600 s"),
]
SECRET, READERS, REQUESTERS = (f'{key} = "/etc/slipd/{key}"\n' for key in ("secret_key", "readers", "requesters"))
BUS = [
    *(
        ("[levels]", f'[bus]\npublish = "{endpoint}"\n[levels]', "bus.publish", "ipc:///PATH")
        for endpoint in ("tcp://0.0.0.0:5555", "bogus", "ipc://", "ipc:///", "ipc://relative", "tcp://127.0.0.1")
    ),
    *(
        ("[levels]", f"[bus]\n{bus}\n[levels]", path, "")
        for bus, path in (
            ('publish = "tcp://*:5555"', "bus.publish"),
            ('publish = "tcp://*:5555"\nallow_local_tcp = true', "bus.publish"),
            ('publish = "tcp://127.0.0.1:5555"', "bus.publish"),
            ('requests = "tcp://10.0.0.7:*"', "bus.requests"),
            (f'requests = "tcp://10.0.0.7:*"\n{SECRET}{READERS}', "bus.requests"),
            (f'publish = "tcp://10.0.0.7:*"\n{SECRET}{REQUESTERS}', "bus.publish"),
            (f'requests = "tcp://10.0.0.7:*"\n{REQUESTERS}', "bus.requesters"),
            (SECRET, "bus.secret_key"),
            ('secret_key = "relative"', "bus.secret_key"),
            ("requests_hz = 0.0", "bus.requests_hz"),
        )
    ),
]


@pytest.mark.parametrize(("old", "new", "path", "expected"), [*WHOLE, *BUS, *STREAM, *FINGER, *GRIPPER, *IMPOSSIBLE])
def test_G3_a_value_that_does_not_fit_is_refused_with_its_line(old: str, new: str, path: str, expected: str) -> None:
    """The only fault has the path, the text and the line of the key or of its table."""
    text = broken(old, new)
    [(found, at, message)] = faults(text)
    assert found == path
    assert expected in message
    assert at is not None
    table, _, key = path.rpartition(".")
    reported = text.splitlines()[at - 1]
    assert key in reported or table in reported or table.rpartition(".")[2] in reported


@pytest.mark.parametrize(
    ("old", "new"),
    [
        *(("[levels]", f'[bus]\nrequests = "{endpoint}"\nallow_local_tcp = true\n[levels]') for endpoint in (
            "tcp://127.0.0.1:5555", "tcp://localhost:*", "ipc:///run/slipd/publish"
        )),
        ("[levels]", f'[bus]\nrequests = "tcp://10.0.0.7:*"\n{SECRET}{REQUESTERS}[levels]'),
        ("[levels]", f'[bus]\npublish = "tcp://*:*"\nrequests = "tcp://*:*"\n{SECRET}{READERS}{REQUESTERS}[levels]'),
        ("[levels]", "[recording.continuous]\nkeep_bytes = 400_000_000\n[levels]"),  # room for two files
        ("rate_hz = 800", "rate_hz = 800\nbaud = 296000"),
        ("rate_hz = 60.0", "rate_hz = 5.0\nstale_s = 2.0\ndelay_s = 1.0\npoll_s = 1.0"),
        ("pitch_m = 0.0032", "pitch_m = 0.03125"),  # half a metre
        ("mu = 0.5", "mu = 0.5\nmin_normal_n = 50.0"),
        ("max_force_n = 25.0", "max_force_n = 30.0\nmin_force_n = 3.0"),
        ("rate_hz = 800", "rate_hz = 1000"),  # clocks run fast, and some sensors send more than their data sheet says
        ('port = "ws://127.0.0.1:5000"', 'port = "ws://pads"'),
        ("mu = 0.5", "mu = 0.5\nmu_max = 0.5"),
        ("mu = 0.5", "mu = 0.5\nmu_max = 2.0"),
        ("mu = 0.5", "mu = 0.5\nmu_spread = 0.0"),
        ("mu = 0.5", "mu = 0.5\nmu_spread = 1.0"),
        ("force_table = [[0, 3.0],", "force_table = [[0, 0.0],"),  # the smallest setting may stand for 0 N and 0 m/s
        ("speed_table = [[0, 0.02],", "speed_table = [[0, 0.0],"),
    ],
)  # fmt: skip
def test_a_value_at_a_limit_or_beyond_a_data_sheet_is_accepted(old: str, new: str) -> None:
    assert config.parse(broken(old, new), "rig.toml").finger["left"].wrench


def test_all_values_that_do_not_fit_are_reported_at_once() -> None:
    text = GOOD.replace("caution = 0.6", "caution = 0.9").replace("max_force_n = 25.0", "max_force_n = 99.0")
    text = text.replace('"/dev/left-pad"', '"/dev/left-wrench"').replace("[0.001, 0.001, -0.001]", "[0.001]")
    paths = {"levels.caution", "finger.left.pad.port", "finger.right.pad.axis_scale", "gripper.max_force_n"}
    assert {path for path, _, _ in faults(text)} == paths


def test_pad_positions_in_millimetres_are_refused() -> None:
    text = shipped_config("demo").read_text(encoding="utf-8").replace("[0.085, 0.0, 0.0425, 0.0]", "[85, 0, 42, 0]")
    at = next(n for n, row in enumerate(text.splitlines(), start=1) if "85, 0, 42, 0" in row)
    fault = "must be from 0 to 1 m, got 85: did you mean 85 mm? write 0.085"
    assert faults(text) == [("grasp.pads.left.positions", at, fault)]
