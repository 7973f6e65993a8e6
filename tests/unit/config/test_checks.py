"""A config that cannot be run is refused as a whole, and every fault is reported with its line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from project import CONFIG

from slipd import config
from slipd.errors import ConfigError

SHIPPED = sorted(CONFIG.glob("*.toml"))

GOOD = """\
[levels]
caution = 0.6

[finger.left]
mu = 0.5

[finger.left.wrench]
device = "bota"
port = "/dev/left-wrench"
rate_hz = 800

[finger.left.pad]
device = "pvdf"
port = "/dev/left-pad"
rate_hz = 200.0
rows = 8
cols = 16
pitch_m = 0.0032
electrode_m = 0.0015

[finger.right]

[finger.right.pad]
device = "xela"
port = "ws://127.0.0.1:5000"
sensor = "2"
rate_hz = 60.0
rows = 4
cols = 4
pitch_m = 0.0047
electrode_m = 0.0047
axis_scale = [0.001, 0.001, -0.001]

[gripper]
device = "robotiq_2f"
port = "/dev/gripper"
rate_hz = 50.0
force_table = [[0, 3.0], [255, 30.0]]
width_table = [
  [0.0, 0.085],
  [1.0, 0.0]
]
speed_table = [[0, 0.02], [255, 0.15]]
max_force_n = 25.0
"""


def line(text: str, number: int = 1) -> int:
    """Return the line of GOOD that has the n-th occurrence of ``text``."""
    return [k for k, content in enumerate(GOOD.splitlines(), start=1) if text in content][number - 1]


def faults(text: str) -> list[tuple[str, int | None, str]]:
    with pytest.raises(ConfigError) as caught:
        config.parse(text, "rig.toml")
    return [(fault.path, fault.line, fault.message) for fault in caught.value.faults]


def broken(old: str, new: str, number: int = 1) -> str:
    """GOOD with one line's beginning changed (the n-th that has it)."""
    at = [match.start() for match in re.finditer(rf"^{re.escape(old)}", GOOD, re.MULTILINE)][number - 1]
    return GOOD[:at] + new + GOOD[at + len(old) :]


def test_the_good_config_is_good() -> None:
    rig = config.parse(GOOD, "rig.toml")
    assert list(rig.streams()) == ["left.wrench", "left.pad", "right.pad", "gripper"]
    assert rig.levels.caution == 0.6
    assert rig.finger["left"].mu == 0.5
    assert rig.finger["right"].mu is None
    assert rig.gripper is not None
    assert rig.gripper.force_table == [(0.0, 3.0), (255.0, 30.0)]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_every_shipped_config_loads(path: Path) -> None:
    rig = config.load(path)
    assert rig.finger
    assert rig.text == path.read_text(encoding="utf-8")


def test_there_are_shipped_configs_and_they_are_found_by_name() -> None:
    assert SHIPPED
    assert config.shipped("grips.toml").samefile(SHIPPED[0].parent / "grips.toml")


def test_the_tables_of_a_gripper_may_start_at_zero() -> None:
    """The smallest setting may stand for 0 N and 0 m/s."""
    text = GOOD.replace("[[0, 3.0],", "[[0, 0.0],").replace("[[0, 0.02],", "[[0, 0.0],")
    assert config.parse(text, "rig.toml").gripper is not None


def test_the_id_of_a_config_changes_with_its_text() -> None:
    ids = {config.parse(text, "rig.toml").config_id for text in (GOOD, GOOD + "\n", GOOD + "# note\n")}
    assert len(ids) == 3
    assert config.parse(GOOD, "a").config_id == config.parse(GOOD, "b").config_id
    assert all(re.fullmatch("[0-9a-f]{12}", config_id) for config_id in ids)


@pytest.mark.parametrize(
    ("old", "new", "path", "expected"),
    [
        ("caution = 0.6", "cautoin = 0.6", "levels.cautoin", "unknown key; did you mean 'caution'?"),
        ("caution = 0.6", "zzz = 0.6", "levels.zzz", "unknown key; known here: caution, hysteresis, warning"),
        ("mu = 0.5", 'mu = "slippery"', "finger.left.mu", "must be a number, got 'slippery'"),
        ("mu = 0.5", "mu = nan", "finger.left.mu", "finite number"),
        ("mu = 0.5", "mu = -0.5", "finger.left.mu", "must be from 0.01 to 2, got -0.5"),
        ("mu = 0.5", "load_rul = 0.5", "finger.left.load_rul", "did you mean 'load_rule'?"),
        ("rows = 8", "rows = 8.5", "finger.left.pad.rows", "must be an integer"),
        ("rows = 8", "rows = 0", "finger.left.pad.rows", "must be above 0, got 0"),
        ("rows = 8", "rows = true", "finger.left.pad.rows", "must be an integer"),
        ("pitch_m = 0.0032", "pitch_mm = 3.2", "finger.left.pad.pitch_mm", "did you mean 'pitch_m'?"),
        ("rate_hz = 800", "rate_hz = inf", "finger.left.wrench.rate_hz", "finite number"),
        ("max_force_n = 25.0", "max_force_n = inf", "gripper.max_force_n", "finite number"),
        ('device = "bota"', "device = 7", "finger.left.wrench.device", "must be a text in quotes, got 7"),
    ],
)
def test_G1_a_wrong_value_is_reported_with_its_line(old: str, new: str, path: str, expected: str) -> None:
    found = faults(broken(old, new))
    assert (path, line(old)) in [(found_path, found_line) for found_path, found_line, _ in found]
    assert any(expected in message for found_path, _, message in found if found_path == path), found


@pytest.mark.parametrize(
    ("key", "table"),
    [("mu", "[finger.left]"), ("sign", "[finger.left.wrench]")],
)
def test_an_optional_key_may_be_missing(key: str, table: str) -> None:
    text = "\n".join(row for row in GOOD.splitlines() if not row.startswith(f"{key} ="))
    assert table in text
    config.parse(text, "rig.toml")


@pytest.mark.parametrize(
    ("old", "path", "at"),
    [
        ('port = "/dev/left-wrench"', "finger.left.wrench.port", "[finger.left.wrench]"),
        ("rows = 8", "finger.left.pad.rows", "[finger.left.pad]"),
        ("max_force", "gripper.max_force_n", ""),
        ("width_table = [\n  [0.0, 0.085],\n  [1.0, 0.0]\n]", "gripper.width_table", "[gripper]"),
    ],
)
def test_a_missing_key_is_reported_with_the_line_of_its_table(old: str, path: str, at: str) -> None:
    text = broken(old, f"# {old}".replace("\n", "\n# "))
    if not at:  # no limit is a config that moves nothing, not a fault
        assert config.parse(text, "rig.toml").gripper is not None
        return
    ((found_path, found_line, reason),) = faults(text)
    assert (found_path, found_line, reason.startswith("is missing")) == (path, line(at), True)


MEANING = [
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
        'port = "/dev/left-pad"',
        'port = "/dev/left-wrench"',
        "finger.left.pad.port",
        "must differ from the port of left.wrench, or each needs a 'sensor' of its own",
    ),
    ('port = "/dev/gripper"', 'port = "/dev/left-pad"', "gripper.port", "must differ from the port of left.pad"),
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
    (
        "axis_scale = [0.001, 0.001, -0.001]",
        "axis_scale = [0.001]",
        "finger.right.pad.axis_scale",
        "must have 3 value(s)",
    ),
    ("axis_scale = [0.001, 0.001", "axis_scale = [0.001, 0", "finger.right.pad.axis_scale", "must not contain 0"),
    ("rate_hz = 800", "rate_hz = 800\ndelay_s = 0.02", "finger.left.wrench.delay_s", "less than 0.02 s"),
    ("rate_hz = 800", "rate_hz = 800\nstale_s = 0.009", "finger.left.wrench.stale_s", "from 0.01 to 0.5 s"),
    ("rate_hz = 800", "rate_hz = 800\nstale_s = 0.51", "finger.left.wrench.stale_s", "got 0.51"),
    ("rate_hz = 60.0", "rate_hz = 60.0\nstale_s = 0.02", "finger.right.pad.stale_s", "from 0.025 to 0.5 s"),
    ("rate_hz = 60.0", "rate_hz = 5.0\nstale_s = 2.1", "finger.right.pad.stale_s", "from 0.3 to 2 s"),
    ("rate_hz = 60.0", "rate_hz = 60.0\nstale_s = 0.1\ndelay_s = 0.1", "finger.right.pad.delay_s", "less than 0.1 s"),
    ("rate_hz = 60.0", "rate_hz = 60.0\ndelay_s = 0.05", "finger.right.pad.delay_s", "less than 0.05 s"),
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
    ("speed_table = [[0, 0.02], [255, 0.15]]", "speed_table = [[9, 0.2], [1, 1]]", "gripper.speed_table", "rise"),
    ("speed_table = [[0, 0.02], [255, 0.15]]", "speed_table = [[0, 0.2], [300, 1]]", "gripper.speed_table", "255"),
    ("caution = 0.6", "caution = 0.9", "levels.caution", "must be below levels.warning, 0.85, got 0.9"),
    ("caution = 0.6", "caution = 0.04", "levels.hysteresis", "must be below levels.caution, 0.04, got 0.05"),
    (
        "rate_hz = 800",
        "rate_hz = 800\noptions = { sinc_length = 9 }",
        "finger.left.wrench.options",
        "sinc_length must be an integer from 64",
    ),
    ("rate_hz = 800", "rate_hz = 800\noptions = { sinc_length = 64.5 }", "finger.left.wrench.options", "64.5"),
    ("rate_hz = 50.0", "rate_hz = 50.0\noptions = { unit = 300 }", "gripper.options", "1 to 247, a Modbus address"),
    ("rate_hz = 50.0", 'rate_hz = 50.0\noptions = { unit = "9" }', "gripper.options", "a Modbus address, got '9'"),
    ("rate_hz = 50.0", "rate_hz = 50.0\noptions = { poll_period_s = 1e300 }", "gripper.options", ""),
    ("rate_hz = 800", "rate_hz = 800\noptions = { speed = 9 }", "finger.left.wrench.options", "speed"),
    ("axis_scale = [0.001", "charge_tau_s = 2.0\naxis_scale = [0.001", "finger.right.pad.charge_tau_s", "not charge"),
]


@pytest.mark.parametrize(("old", "new", "path", "expected"), MEANING)
def test_G3_values_that_do_not_fit_each_other_are_reported(old: str, new: str, path: str, expected: str) -> None:
    text = broken(old, new)
    found = faults(text)
    assert [found_path for found_path, _, _ in found] == [path]
    assert expected in found[0][2]
    at = found[0][1]
    assert at is not None
    key = path.rpartition(".")[2]
    assert key in text.splitlines()[at - 1] or path.rpartition(".")[0] in text.splitlines()[at - 1]


@pytest.mark.parametrize(("quaternion", "length"), [("[0, 0, 0, 0]", "0"), ("[5, 0, 0, 3]", "5.831")])
def test_a_quaternion_that_is_not_a_rotation_is_refused(quaternion: str, length: str) -> None:
    text = broken("rate_hz = 800", f"rate_hz = 800\npad_from_sensor = {{ quat_xyzw = {quaternion} }}")
    [(path, at, message)] = faults(text)
    assert (path, at) == ("finger.left.wrench.pad_from_sensor.quat_xyzw", line("rate_hz = 800") + 1)
    assert message.endswith(f"got one of length {length}")


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


def test_a_range_that_no_sensor_has_is_refused() -> None:
    [(path, _, message)] = faults(broken("rate_hz = 800", "rate_hz = 800\nrange_n = 1e7"))
    assert path == "finger.left.wrench.range_n"
    assert message == "must be from 0.1 to 100000 N, got 1e+07"


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
        "rate_hz = 800\nrange_n = 0.2",
        "finger.left.min_normal_n",
        "below wrench.range_n, 0.2 N, got 0.3",
    ),
    ("mu = 0.5", "mu = 2.1", "finger.left.mu", "must be from 0.01 to 2, got 2.1"),
    ("mu = 0.5", "mu = 55.0", "finger.left.mu", "must be from 0.01 to 2, got 55"),
    ("mu = 0.5", "mu = 0.5\nmin_normal_n = 60.0", "finger.left.min_normal_n", "must be at most 50 N, got 60"),
    (
        "rate_hz = 800",
        "rate_hz = 4000",
        "finger.left.wrench.rate_hz",
        "must be from 50 to 800 Hz, the rates of bota, got 4000",
    ),
    (
        "rate_hz = 800",
        "rate_hz = 0.00125",
        "finger.left.wrench.rate_hz",
        "did you mean a period of 0.00125 s? write 800",
    ),
    (
        "rate_hz = 800",
        "rate_hz = 800\nbaud = 115200",
        "finger.left.wrench.rate_hz",
        "must be at most 311 Hz, the most that bota can send at 115200 bit/s, got 800; lower it or raise baud",
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


@pytest.mark.parametrize(("old", "new", "path", "expected"), IMPOSSIBLE)
def test_an_impossible_value_is_refused_with_the_likely_meaning(old: str, new: str, path: str, expected: str) -> None:
    text = broken(old, new)
    [(found, at, message)] = faults(text)
    assert found == path
    assert expected in message
    assert at is not None
    line_text, key = text.splitlines()[at - 1], path.rpartition(".")[2]
    assert key in line_text or path.rpartition(".")[0].rpartition(".")[2] in line_text


def test_pad_positions_in_millimetres_are_refused() -> None:
    text = (
        config.shipped("demo.toml").read_text(encoding="utf-8").replace("[0.085, 0.0, 0.0425, 0.0]", "[85, 0, 42, 0]")
    )
    [(path, at, message)] = faults(text)
    assert path == "grasp.pads.left.positions"
    assert message == "must be from 0 to 1 m, got 85: did you mean 85 mm? write 0.085"
    assert at is not None
    assert "85, 0, 42, 0" in text.splitlines()[at - 1]


@pytest.mark.parametrize(("mu_max", "good"), [("0.5", True), ("2.0", True), ("0.4", False), ("2.1", False)])
def test_mu_max_must_be_at_least_mu(mu_max: str, good: bool) -> None:
    text = GOOD.replace("mu = 0.5", f"mu = 0.5\nmu_max = {mu_max}")
    if good:
        assert config.parse(text, "rig.toml").finger["left"].most_mu == float(mu_max)
    else:
        [(path, at, _)] = faults(text)
        assert (path, at) == ("finger.left.mu_max", line("mu = 0.5") + 1)


def test_a_rate_slightly_beyond_the_data_sheet_is_accepted() -> None:
    """Clocks run fast, and some sensors send more than their data sheet promises."""
    assert config.parse(broken("rate_hz = 800", "rate_hz = 1000"), "rig.toml").finger["left"].wrench


@pytest.mark.parametrize("endpoint", ["tcp://0.0.0.0:5555", "bogus", "ipc://", "ipc://relative", "tcp://127.0.0.1"])
def test_an_endpoint_that_cannot_be_served_is_refused(endpoint: str) -> None:
    [(path, at, message)] = faults(f'{GOOD}\n[bus]\npublish = "{endpoint}"\n')
    assert path == "bus.publish"
    assert at == len(GOOD.splitlines()) + 3
    assert "ipc:///PATH" in message


@pytest.mark.parametrize("endpoint", ["tcp://127.0.0.1:5555", "tcp://localhost:*", "ipc:///run/slipd/publish"])
def test_an_endpoint_that_can_be_served_is_accepted(endpoint: str) -> None:
    bus = f'[bus]\nrequests = "{endpoint}"\nallow_local_tcp = true\n'
    assert config.parse(f"{GOOD}\n{bus}", "rig.toml").bus.requests == endpoint


SECRET, READERS, REQUESTERS = (f'{key} = "/etc/slipd/{key}"\n' for key in ("secret_key", "readers", "requesters"))


@pytest.mark.parametrize(
    ("bus", "wrong"),
    [
        ('publish = "tcp://*:5555"', ["bus.publish"]),
        ('publish = "tcp://*:5555"\nallow_local_tcp = true', ["bus.publish"]),
        ('publish = "tcp://127.0.0.1:5555"', ["bus.publish"]),
        ('requests = "tcp://10.0.0.7:*"', ["bus.requests"]),
        (f'requests = "tcp://10.0.0.7:*"\n{SECRET}{READERS}', ["bus.requests"]),
        (f'publish = "tcp://10.0.0.7:*"\n{SECRET}{REQUESTERS}', ["bus.publish"]),
        (f'requests = "tcp://10.0.0.7:*"\n{SECRET}{REQUESTERS}', []),
        (f'publish = "tcp://*:*"\nrequests = "tcp://*:*"\n{SECRET}{READERS}{REQUESTERS}', []),
        (f'requests = "tcp://10.0.0.7:*"\n{REQUESTERS}', ["bus.requesters"]),
        (SECRET, ["bus.secret_key"]),
        ('secret_key = "relative"', ["bus.secret_key"]),
        ("requests_hz = 0.0", ["bus.requests_hz"]),
    ],
)
def test_an_endpoint_over_tcp_needs_the_daemon_key_and_a_list_of_client_keys(bus: str, wrong: list[str]) -> None:
    text = f"{GOOD}\n[bus]\n{bus}\n"
    if wrong:
        assert [path for path, _, _ in faults(text)] == wrong
    else:
        config.parse(text, "rig.toml")


def test_a_port_with_a_zero_byte_is_refused() -> None:
    [(path, _, _)] = faults(GOOD.replace("/dev/left-wrench", "a\\u0000b"))
    assert path == "finger.left.wrench.port"


def test_wrong_values_do_not_hide_values_that_do_not_fit_each_other() -> None:
    text = GOOD.replace("mu = 0.5", "mu = -0.5").replace("caution = 0.6", "caution = 0.6\nwarning = 0.6")
    assert [path for path, _, _ in faults(text)] == ["finger.left.mu", "levels.caution"]


def test_G1_all_wrong_values_are_reported_at_once() -> None:
    text = GOOD.replace("mu = 0.5", "mu = -1").replace("rows = 8", "rows = 0").replace("pitch_m = 0.0047", "pitch = 1")
    assert {(path, at) for path, at, _ in faults(text)} == {
        ("finger.left.mu", line("mu = 0.5")),
        ("finger.left.pad.rows", line("rows = 8")),
        ("finger.right.pad.pitch", line("pitch_m = 0.0047")),
        ("finger.right.pad.pitch_m", line("[finger.right.pad]")),
    }


def test_all_values_that_do_not_fit_are_reported_at_once() -> None:
    text = GOOD
    for old, new in [
        ("caution = 0.6", "caution = 0.9"),
        ('port = "/dev/left-pad"', 'port = "/dev/left-wrench"'),
        ("[finger.right]", "[finger.right]\n"),
        ("max_force_n = 25.0", "max_force_n = 99.0"),
        ("axis_scale = [0.001, 0.001, -0.001]", "axis_scale = [0.001]"),
    ]:
        text = text.replace(old, new)
    assert {path for path, _, _ in faults(text)} == {
        "levels.caution",
        "finger.left.pad.port",
        "finger.right.pad.axis_scale",
        "gripper.max_force_n",
    }


def test_the_error_has_one_line_per_fault_with_file_and_line() -> None:
    with pytest.raises(ConfigError) as caught:
        config.parse(GOOD.replace("mu = 0.5", "mu = -1").replace("rows = 8", "rows = 0"), "rig.toml")
    assert str(caught.value).splitlines() == [
        f"rig.toml:{line('mu = 0.5')}: finger.left.mu: must be from 0.01 to 2, got -1",
        f"rig.toml:{line('rows = 8')}: finger.left.pad.rows: must be above 0, got 0",
    ]


@pytest.mark.parametrize("name", ["Left", "left_pad", 33 * "x", "link\u0073\u00e9", '"left hand"'])
def test_a_finger_has_a_plain_name(name: str) -> None:
    quoted = name if name.startswith('"') or name.isascii() else f'"{name}"'
    text = GOOD.replace("finger.left", f"finger.{quoted}")
    plain = name.strip('"')
    found = faults(text)
    assert [message for _, _, message in found] == [
        f"a finger name must consist of 1 to 32 characters a-z and 0-9, got {plain!r}"
    ]
    assert found[0][1] in (line("[finger.left]"), None)


def test_no_finger_name_begins_with_another() -> None:
    """A subscription matches every topic with its prefix: ``slip.left`` would match ``slip.left2`` too."""
    found = faults(GOOD.replace("finger.right", "finger.left2"))
    assert [(path, at) for path, at, _ in found] == [("finger.left2", line("[finger.right]"))]
    assert "must not begin with the name of finger 'left'" in found[0][2]


def test_a_finger_without_a_stream_is_refused() -> None:
    found = faults("[finger.left]\nmu = 0.5\n")
    assert found == [("finger.left", 1, "must have [wrench], [pad] or both, got neither")]


def test_a_pad_that_measures_no_shear_needs_a_force_sensor() -> None:
    head, _, tail = GOOD.partition("[finger.left.wrench]")
    found = faults(head + "[finger.left.pad]" + tail.partition("[finger.left.pad]")[2])
    assert [path for path, _, _ in found] == ["finger.left.wrench"]
    assert "pvdf measures no shear" in found[0][2]


def test_two_pads_may_share_a_server_if_their_sensors_differ() -> None:
    other = re.search(r"\[finger\.right\.pad\]\n(.*\n)+?\n", GOOD)
    assert other is not None
    twin = other[0].replace("finger.right", "finger.third")
    assert config.parse(GOOD + twin.replace('"2"', '"1"'), "rig.toml").finger["third"].pad is not None
    found = faults(GOOD + twin)
    assert [path for path, _, _ in found] == ["finger.third.pad.port"]
    assert "each needs a 'sensor' of its own" in found[0][2]


def test_two_pads_of_one_server_need_the_same_options() -> None:
    """The link is opened once, with the options of the first pad; other options would be ignored silently."""
    other = re.search(r"\[finger\.right\.pad\]\n(.*\n)+?\n", GOOD)
    assert other is not None
    twin = other[0].replace("finger.right", "finger.third").replace('"2"', '"1"')
    found = faults(GOOD + twin.replace('sensor = "1"', 'sensor = "1"\noptions = { calibrated = true }'))
    assert [path for path, _, _ in found] == ["finger.third.pad.options"]


@pytest.mark.parametrize(("key", "value"), [("baud", "9600"), ("hardware_id", '"S/N 1"')])
def test_two_sensors_of_one_port_need_the_same_baud_and_hardware_id(key: str, value: str) -> None:
    other = re.search(r"\[finger\.right\.pad\]\n(.*\n)+?\n", GOOD)
    assert other is not None
    twin = other[0].replace("finger.right", "finger.third").replace('"2"', '"1"')
    found = faults(GOOD + twin.replace('sensor = "1"', f'sensor = "1"\n{key} = {value}'))
    assert [path for path, _, _ in found] == [f"finger.third.pad.{key}"]


PADS = [
    ("tsf85", "7", "4", "", ""),
    ("tsf85", "4", "4", "finger.right.pad.rows", "rows x cols must be 28, the taxels of one tsf85 sensor, got 4 x 4"),
    ("papillarray", "3", "3", "", ""),
    ("papillarray", "9", "3", "finger.right.pad.rows", "rows x cols must be 9"),
]


@pytest.mark.parametrize(("device", "rows", "cols", "path", "expected"), PADS)
def test_a_pad_must_have_the_taxels_and_a_sensor_of_its_device(
    device: str, rows: str, cols: str, path: str, expected: str
) -> None:
    scale = "axis_scale = [1.0, 1.0, 1.0]" if device == "papillarray" else "axis_scale = [1.0]"
    text = GOOD.replace(
        "[finger.right]", '[finger.right]\nwrench = { device = "bota", port = "/dev/w", rate_hz = 800 }'
    )
    for old, new in (
        ('"xela"', f'"{device}"'),
        ("ws://127.0.0.1:5000", "/dev/pads"),
        ('sensor = "2"', 'sensor = "1"'),
        ("rate_hz = 60.0", "rate_hz = 100.0" if device == "papillarray" else "rate_hz = 60.0"),
        ("rows = 4", f"rows = {rows}"),
        ("cols = 4", f"cols = {cols}"),
        ("axis_scale = [0.001, 0.001, -0.001]", scale),
    ):
        text = text.replace(old, new)
    if path:
        [(found, _, message)] = faults(text)
        assert found == path
        assert expected in message
    else:
        assert config.parse(text, "rig.toml").finger["right"].pad is not None
    [(found, _, message)] = faults(text.replace('sensor = "1"', 'sensor = "2"'))
    assert found == "finger.right.pad.sensor"
    assert message == f'must be "0" or "1", the sensors of {device}, got \'2\''


@pytest.mark.parametrize(
    ("text", "at"),
    [
        ("[finger.left\nmu = 1", 1),
        ("a = 1\nb = \n", 2),
        ("a = 1\na = 2\n", 2),
        ("a = " + "1" * 5000, None),
        ("a = " + "[" * 5000, None),
    ],
)
def test_a_text_that_is_not_toml_is_refused(text: str, at: int | None) -> None:
    found = faults(text)
    assert [(path, line) for path, line, _ in found] == [("", at)]
    assert found[0][2].startswith("not TOML: ")


@pytest.mark.parametrize("text", ["", "[levels]\n", "finger = 3\n", "[finger]\n"])
def test_a_config_without_a_finger_is_refused(text: str) -> None:
    assert "finger" in [path for path, _, _ in faults(text)]


@pytest.mark.parametrize("rate", ["1e-300", "1e300"])
@pytest.mark.parametrize("key", ["rate_hz = 800", "caution = 0.6"])
def test_a_rate_that_no_stream_has_is_refused(rate: str, key: str) -> None:
    if key.startswith("rate"):
        found = faults(broken(key, f"rate_hz = {rate}"))
        assert [path for path, _, _ in found] == ["finger.left.wrench.rate_hz"]
    else:
        found = faults(f"[rates]\nslip_hz = {rate}\n" + GOOD)
        assert [path for path, _, _ in found] == ["rates.slip_hz"]


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    for name, expected in (("none.toml", "No such file"), (".", "Is a directory")):
        with pytest.raises(ConfigError, match=expected):
            config.load(tmp_path / name)
    (tmp_path / "latin.toml").write_bytes(b"# \xe9\n")
    with pytest.raises(ConfigError, match=r"latin\.toml: cannot be read: it is not UTF-8 text"):
        config.load(tmp_path / "latin.toml")


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
