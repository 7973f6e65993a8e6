"""Every device of a config reads the load on its pad: the daemon's own decoders, mounting and geometry invert it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from driving import drive
from nanoseconds import MS
from project import CONFIG

from slipd import config
from slipd.config import Config, Stream
from slipd.devices import DEVICES
from slipd.devices.shared import modbus
from slipd.errors import ConfigError
from slipd.signals.mounting import mounting_matrix
from slipd.signals.pad import PadGeometry
from slipd.signals.tare import most_std
from slipd.tools.sim.emulated_pads import REST_COUNTS
from slipd.tools.sim.emulators import Emulator
from slipd.tools.sim.hand import PadLoad
from slipd.tools.sim.hand_commands import CommandError, parse_command
from slipd.tools.sim.touched_devices import BIAS, TouchedDevices
from slipd.types.samples import ArmSample, TactileSample, WrenchSample

SHIPPED = sorted(CONFIG.glob("*.toml"))
IN_NEWTONS = [path for path in SHIPPED if path.name != "trial_arq.toml"]
"""Configs of rigs; the readings of that trial are counts, and the emulator of pushed readings sends newtons."""
SECONDS = 0.7
AT_M = (0.004, -0.003)


@dataclass
class Loaded:
    """An emulator that acts in the time of the test under a constant load."""

    emulator: Emulator
    devices: TouchedDevices
    received: list[Any] = field(default_factory=list)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.emulator, name)

    def advance(self, t_ns: int) -> list[bytes]:
        self.devices.advance(t_ns)
        return self.emulator.advance(t_ns)


def give(devices: TouchedDevices, *lines: str) -> None:
    for line in lines:
        command = parse_command(line, devices.fingers)
        assert command is not None
        devices.hand.carry_out(command, 0.0)


def touched(rig: Config, folder: Path) -> TouchedDevices:
    """Return the devices of a rig, with a load on the first finger."""
    devices = TouchedDevices(rig, folder)
    finger = next(iter(rig.finger))
    give(devices, f"press {finger} 6 N at 4 -3 mm", f"push {finger} -y 1 N", f"twist {finger} 10 mNm")
    return devices


def read(rig: Config, folder: Path, stream: Stream) -> list[Any]:
    """Return the readings of a stream under the load of the test, from the last third of some tenths of a second."""
    devices = touched(rig, folder)
    number = list(dict.fromkeys(each.port for each in rig.streams().values())).index(stream.port)
    emulator = Loaded(devices.devices[number][1], devices)
    device, options = DEVICES[stream.device], config.device_options(stream)
    emulator.opened(0)
    if device.session is None:
        decoder, times_ns = device.decoder(**options), range(0, round(SECONDS * 1e9), MS)
        pieces = ((t_ns, data) for t_ns in times_ns for data in emulator.advance(t_ns))
        samples = [sample for t_ns, data in pieces for sample in decoder.receive(data, t_ns)]
    else:
        session = device.session(**options)
        asks = device.inquiry(**options) if device.inquiry is not None else None
        if asks is not None:
            session.start(0)
            session.receive(emulator.inquire(asks.request), 0)
        samples = drive(session, emulator, SECONDS + 0.8, start=asks is None)
    chosen = [sample for sample in samples if sample.source == stream.sensor or not stream.sensor]
    return chosen[2 * len(chosen) // 3 :]


WRENCH = """
[finger.f.wrench]
device = "{}"
port = "{}"
rate_hz = {}
options = {{ {} }}
"""
COUNTS = [
    WRENCH.format("robotous", "/dev/x", 333.0, "torque_divider = 1000.0"),
    WRENCH.format(
        "optoforce",
        "/dev/x",
        1000.0,
        "counts_per_n = [40.0, -40.0, 8.0], counts_per_nm = [1100.0, 1100.0, 1400.0]",
    ),
    WRENCH.format(
        "netft",
        "udp://192.168.1.1:49152",
        1000.0,
        'calibration = "config", counts_per_force = 5e5, counts_per_torque = 2e5, force_unit = "lbf"',
    ),
]
"""Sensors whose options say what a count is worth."""


@pytest.mark.parametrize(
    "text",
    [*(path.read_text() for path in IN_NEWTONS), *COUNTS],
    ids=[*(path.name for path in IN_NEWTONS), "robotous", "optoforce", "netft"],
)
def test_the_sensors_of_a_config_read_the_load_on_their_pad(text: str, tmp_path: Path) -> None:
    rig = config.parse(text, "rig")
    devices = touched(rig, tmp_path)
    finger = next(iter(rig.finger))
    sensors = rig.finger[finger]
    if sensors.wrench is not None:
        readings = [
            np.concatenate((sample.force_n, sample.torque_nm))
            for sample in read(rig, tmp_path, sensors.wrench)
            if isinstance(sample, WrenchSample) and sample.torque_nm is not None
        ]
        noise = np.repeat((sensors.wrench.force_std_n, sensors.wrench.torque_std_nm), 3)
        assert (np.std(readings, axis=0) < most_std(noise)).all(), "a tare would be given up"
        pose = sensors.wrench.pad_from_sensor
        found = mounting_matrix(pose.xyz_m, pose.quat_xyzw, sensors.wrench.sign) @ (np.mean(readings, axis=0) - BIAS)
        assert found - devices.hand.weight(finger, 0.0) == pytest.approx(devices.loads(0)[finger].wrench(), abs=0.06)
    if sensors.pad is not None:
        pad = sensors.pad
        images = [sample.values for sample in read(rig, tmp_path, pad) if isinstance(sample, TactileSample)]
        geometry = PadGeometry(pad.rows, pad.cols, pad.pitch_m, pad.electrode_m, pad.swap_xy, pad.flip_x, pad.flip_y)
        assert np.shape(images)[1] == geometry.taxels
        untared = REST_COUNTS if pad.device == "xela" else 0.0
        values = np.mean(images, axis=0) - (np.reshape(pad.tare, np.shape(images[0])) if pad.tare else untared)
        if config.axes_of(pad) == 3:
            forces = values[:, [1, 0, 2]] * pad.axis_scale if pad.swap_xy else values * np.array(pad.axis_scale)
            assert forces.sum(axis=0)[1:] / forces.sum(axis=0)[2] == pytest.approx([1 / 6, 1.0], abs=0.02)
            pressure = -forces[:, 2]
        else:
            pressure = values * pad.axis_scale[0]
        pressure = np.where(pressure > 0.1 * pressure.max(), pressure, 0.0)
        x, y = geometry.positions()
        assert (pressure @ x, pressure @ y) / pressure.sum() == pytest.approx(AT_M, abs=0.6 * pad.pitch_m)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_the_copy_of_a_config_has_other_ports_and_no_identities(path: Path, tmp_path: Path) -> None:
    rig = config.load(path)
    devices = TouchedDevices(rig, tmp_path)
    copy = config.parse(devices.config_text(), "copy")
    assert {stream.port for stream in copy.streams().values()} == {address for _, _, address in devices.devices}
    assert ({stream.hardware_id for stream in copy.streams().values()}, copy.bus.secret_key) == ({""}, None)
    for name, stream in rig.streams().items():
        over_tcp = {"calibration": "tcp"} if stream.options.get("calibration") == "xml" else {}
        found = copy.streams()[name]
        assert config.transport_of(found.port) == config.transport_of(stream.port)
        expected = stream.model_copy(update={"options": stream.options | over_tcp})
        assert found == expected.model_copy(update={"port": found.port, "hardware_id": found.hardware_id})


def test_an_emulated_gripper_has_the_address_of_its_config(tmp_path: Path) -> None:
    text = (
        (CONFIG / "demo.toml")
        .read_text()
        .replace('device = "robotiq_2f"', 'device = "robotiq_2f"\noptions = { unit = 5 }')
    )
    gripper: Any = TouchedDevices(config.parse(text, "rig"), tmp_path).devices[-1][1]
    assert gripper.receive(bytes.fromhex("09 04 07 D0 00 03 B1 CE"), 0) == []
    assert gripper.receive(modbus.encode_request(modbus.Request(5, modbus.READ_INPUT, 2000, 3)), 10 * MS) != []


@pytest.mark.parametrize(
    "options",
    ['options = { output_hz = 1000, calibration = "xml" }', 'options.calibration = "xml"\noptions.output_hz=1000'],
)
def test_the_output_rate_of_an_emulated_sensor_is_not_set_on_a_page(options: str, tmp_path: Path) -> None:
    text = f'[finger.f.wrench]\ndevice = "netft"\nport = "udp://192.168.1.1:49152"\nrate_hz = 1000\n{options}\n'
    copy = config.parse(TouchedDevices(config.parse(text, "rig"), tmp_path).config_text(), "copy").finger["f"].wrench
    assert copy.options == {"calibration": "tcp", "output_hz": 0}


def test_a_port_in_an_inline_table_is_refused(tmp_path: Path) -> None:
    text = '[finger.f]\nwrench = { device = "bota", port = "/dev/x", rate_hz = 100.0 }\n'
    with pytest.raises(ConfigError, match="every port must be on a line of its own"):
        TouchedDevices(config.parse(text, "rig"), tmp_path).config_text()


@pytest.mark.parametrize(
    ("name", "grip"),
    [
        ("demo.toml", {"_normal_n": 8.0}),
        ("netft_wts.toml", {"_blocked": "blocked_minus", "limit": 16.0}),
        ("external.toml", {"_blocked": True, "force_n": 8.0}),
    ],
)
def test_a_gripper_that_closes_on_an_object_presses_both_pads(name: str, grip: dict[str, Any], tmp_path: Path) -> None:
    devices = TouchedDevices(config.load(CONFIG / name), tmp_path)
    give(devices, "object 40 mm")
    devices.advance(0)
    vars(devices.devices[-1][1]).update(grip)
    assert devices.loads(MS) == dict.fromkeys(devices.fingers, PadLoad((0.0, 0.0), 8.0))


def test_the_arm_moves_the_weight_of_both_fingers_and_its_stream_says_how(tmp_path: Path) -> None:
    rig = config.load(CONFIG / "external.toml")
    devices = TouchedDevices(rig, tmp_path)
    assert devices.hand.arm(0.0)[0] == pytest.approx((0.0, 0.0, 9.80665)), "fingertips down, as without the command"
    give(devices, "weight left 100 g", "weight right 100 g")
    before = devices.hand.weight("left", 0.0)
    give(devices, "arm 0 0 9.80665")
    assert devices.hand.weight("left", 0.0) == pytest.approx(before)
    give(devices, "arm 0 3 9.8 turn 2 0 0 in 1 s")
    for name, side in (("left", 1.0), ("right", -1.0)):
        outward_m = float(np.mean(np.array(rig.grasp.pads[name].positions)[:, 2]))
        felt = devices.hand.weight(name, 1.0)[:3]
        # the pads look along Y of the gripper; a turn about X pulls each finger outwards by w^2 r
        assert (felt[0], felt[2]) == pytest.approx((0.98, -side * 0.1 * (3.0 + 4.0 * outward_m)))
    devices.advance(1_000_000_000)
    (emulator,) = {emulator for name, emulator, _ in devices.devices if name == "external"}
    decoder = DEVICES["external"].decoder()
    samples = [sample for data in emulator.advance(10_000_000) for sample in decoder.receive(data, 0)]
    motion = [sample for sample in samples if isinstance(sample, ArmSample)][-1]
    assert motion.gravity_mps2 == pytest.approx((0.0, 3.0, 9.8), abs=0.1)
    assert motion.angular_velocity_radps == pytest.approx((2.0, 0.0, 0.0), abs=0.01)
    give(devices, "tilt left 0 0 1")
    assert devices.hand.weight("left", 2.0)[:3] == pytest.approx((0.0, 0.0, 0.980665)), "tilt moves a finger alone"


def test_an_arm_needs_to_know_where_its_pads_are(tmp_path: Path) -> None:
    text = (CONFIG / "external.toml").read_text(encoding="utf-8").partition("[grasp.pads.left]")[0]
    with pytest.raises(CommandError, match=r"must have \[grasp.pads\]"):
        give(TouchedDevices(config.parse(text, "rig.toml"), tmp_path), "arm 0 0 9.8")
