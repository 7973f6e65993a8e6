"""The weight of a finger is found from a recording in several poses, for any bias and mounting of the sensor."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from nanoseconds import MS
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from slipd.devices import bota
from slipd.errors import UsageError
from slipd.events import Bytes, Event, LinkDown, LinkUp, Request, Tick
from slipd.recording.mcap_file import EVENTS, RecordingFile, RunHead
from slipd.signals.gravity import STANDARD_GRAVITY_MPS2, FingerWeight
from slipd.signals.mounting import mounting_matrix
from slipd.tools.commission.weight_identification import Identification
from slipd.tools.recordings.identify_mass import identification_text, identify_recording

G = STANDARD_GRAVITY_MPS2
POSES = [(0.0, 0.0, -G), (G, 0.0, 0.0), (0.0, G, 0.0), (0.0, -G, 0.0)]
WEIGHT = FingerWeight(0.060, (0.002, -0.001, -0.012))
XYZ, QUAT = (0.004, -0.002, -0.025), (0.9659258, 0.2588190, 0.0, 0.0)
BIAS = np.array((3.0, -2.0, 20.0, 0.05, 0.02, -0.1))
NOISE = np.repeat((0.02, 0.0002), 3)
CONFIG = f"""
[finger.left]
[finger.left.wrench]
device = "bota"
port = "/dev/left-wrench"
rate_hz = 500.0
sign = -1
pad_from_sensor = {{ xyz_m = {list(XYZ)}, quat_xyzw = {list(QUAT)} }}
force_std_n = 0.02
torque_std_nm = 0.0002

[finger.right.pad]
device = "xela"
port = "ws://127.0.0.1:5000"
sensor = "1"
rate_hz = 60.0
rows = 4
cols = 4
pitch_m = 0.0047
electrode_m = 0.004
axis_scale = [0.001, 0.001, 0.001]
"""


class Session:
    """A run in which the arm holds the finger in several poses and sends gravity."""

    def __init__(self) -> None:
        self.events: list[tuple[int, Event]] = [(0, LinkUp("left.wrench", "S/N 1"))]
        self.t_ns = MS
        self._rng = np.random.default_rng(3)
        self._from_pad = np.linalg.inv(np.array(mounting_matrix(XYZ, QUAT, -1)))

    def tell(self, gravity: object, finger: str = "left", op: str = "gravity.set") -> None:
        body = {"v": 1, "id": 1, "op": op, "boot": "b", "finger": finger, "gravity_mps2": gravity}
        self.events.append((self.t_ns, Request(b"arm", body)))

    def read(self, gravity: Sequence[float], load: float = 0.0) -> None:
        """Record a reading 2 ms later, in two pieces."""
        self.t_ns += 2 * MS
        values = self._from_pad @ (WEIGHT.wrench(gravity) + load) + BIAS + NOISE * self._rng.normal(size=6)
        frame = bota.encode_frame(values[:3], values[3:], self.t_ns // 1000)
        self.events += [(self.t_ns, Bytes("left.wrench", piece)) for piece in (frame[:20], frame[20:])]

    def hold(self, gravity: Sequence[float]) -> None:
        """Hold still for half a second, and send gravity every 100 ms."""
        for k in range(250):
            if k % 50 == 0:
                self.tell(list(gravity))
            self.read(gravity)

    def turn(self, start: Sequence[float], end: Sequence[float]) -> None:
        """Rotate by a right angle within 0.2 s; gravity is sent late."""
        whole = np.cross(start, end) / G**2 * math.pi / 2
        told: Sequence[float] = start
        for k in range(100):
            present = Rotation.from_rotvec(whole * k / 100).apply(start).tolist()
            if k % 10 == 0:
                self.tell(list(told))
                told = present
            self.read(present)

    def identify(self, folder: Path, finger: str = "left") -> Identification:
        """Record the run, and identify the weight from it."""
        file = RecordingFile(folder / "run.mcap", RunHead(CONFIG, "b", 10**18))
        for n, (t_ns, event) in enumerate(self.events):
            file.add(n, t_ns, EVENTS, event)
        file.finish(len(self.events))
        return identify_recording(folder / "run.mcap", finger)


def test_mass_and_centre_are_found_through_bias_mounting_and_sign_and_fit_a_config(tmp_path: Path) -> None:
    session = Session()
    for pose in POSES:
        session.hold(pose)
        session.t_ns += 500 * MS
    found = session.identify(tmp_path)
    assert (found.poses, found.mass_kg) == (4, pytest.approx(0.060, abs=5 * found.mass_std_kg))
    assert found.mass_std_kg < 0.0005
    assert_allclose(found.com_m, WEIGHT.com_m, atol=0.001)
    assert_allclose(found.bias_force_n, (mounting_matrix(XYZ, QUAT, -1) @ BIAS)[:3], atol=0.01)
    text = identification_text(found, "left")
    table = tomllib.loads(text.partition("\n\n")[2])["finger"]["left"]["wrench"]
    assert_allclose((table["mass_kg"], *table["com_m"]), (found.mass_kg, *found.com_m), rtol=0.0, atol=1e-5)
    assert "in 4 poses" in text
    assert "the residual is large" not in text
    for residual in ({"residual_n": 0.04}, {"residual_nm": 0.001}):
        assert "the residual is large" in identification_text(replace(found, **residual), "left")


def test_readings_of_a_turn_and_of_a_gravity_that_is_old_are_left_out(tmp_path: Path) -> None:
    session = Session()
    for before, after in zip(POSES, (*POSES[1:], POSES[0]), strict=True):
        session.hold(before)
        if not np.allclose(np.cross(before, after), 0.0):
            session.turn(before, after)
    session.tell([0.0, 0.0, -G])
    for _ in range(130):
        session.read((0.0, 0.0, -G))
    for _ in range(400):
        session.read((0.0, 0.0, -G), load=5.0)  # more than 260 ms after the last gravity
    found = session.identify(tmp_path)
    assert (found.poses, found.mass_kg) == (5, pytest.approx(0.060, abs=0.001))
    assert found.residual_n < 0.01


def test_N1_other_requests_invalid_gravity_and_readings_that_are_no_numbers_are_ignored(tmp_path: Path) -> None:
    session = Session()
    for pose in POSES:
        session.tell(list(pose))
        session.tell([0.0, 0.0, 5.0], finger="right")
        session.tell([0.0, 0.0, 5.0], op="gravity.get")
        session.tell([0.0, 0.0, 500.0])
        session.tell("down")
        session.events += [(session.t_ns, Tick()), (session.t_ns, Bytes("right.pad", b"{}"))]
        for _ in range(120):
            session.read(pose)
        session.read(pose, load=math.nan)
        session.events.append((session.t_ns, LinkDown("left.wrench", "unplugged")))
        session.t_ns += 500 * MS
        session.events.append((session.t_ns, LinkUp("left.wrench", "S/N 1")))
    assert session.identify(tmp_path).mass_kg == pytest.approx(0.060, abs=0.001)


@pytest.mark.parametrize("finger", ["right", "middle"])
def test_a_finger_without_a_force_sensor_has_nothing_to_identify(tmp_path: Path, finger: str) -> None:
    with pytest.raises(UsageError, match=f"must be a finger with a force sensor, got '{finger}'; known: left"):
        Session().identify(tmp_path, finger)
