"""Emulated sensors that are as unkind as real ones."""

from __future__ import annotations

import json
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from emulated_engine import EmulatedEngine
from nanoseconds import MS
from project import CONFIG

from slipd import config
from slipd.tools.sim import unkind
from slipd.tools.sim.emulators import EmulatedDevice, make_emulator
from slipd.tools.sim.unkind import Unkind
from slipd_client.messages.topics import Slip

PERIOD_NS = 10 * MS


class Silent(EmulatedDevice):
    """A device with a piece at every look, which keeps what acts on it."""

    def __init__(self) -> None:
        super().__init__(100.0)
        self.times_ns: list[int] = []
        self.felt: list[np.ndarray] = []
        self.began_ns = 0

    def advance(self, t_ns: int) -> list[bytes]:
        self.times_ns.append(t_ns)
        return [b"%d" % len(self.times_ns)]

    def press(self, values: np.ndarray) -> None:
        self.felt.append(values)

    def feel(self, force_n: np.ndarray, torque_nm: np.ndarray) -> None:
        self.felt.append(np.concatenate((force_n, torque_nm)))


def run(device: Unkind, begin_s: float, end_s: float, step_ns: int = MS) -> list[bytes]:
    times_ns = range(round(begin_s * 1e9), round(end_s * 1e9), step_ns)
    return [piece for t_ns in times_ns for piece in device.advance(t_ns)]


def test_a_device_has_its_own_time_which_never_runs_back() -> None:
    inner = Silent()
    run(Unkind(inner, 1), 0.0, 2.0)
    times = np.array(inner.times_ns)
    assert (np.diff(times) >= 0).all()
    assert 0 < 2e9 - times[-1] < unkind.OFFSET_NS + 10 * unkind.JITTER_NS


def test_a_line_drops_repeats_and_bunches() -> None:
    inner = Silent()
    sent = [int(piece) for piece in run(Unkind(inner, 2), 0.0, 10.0)]
    assert set(range(1, len(inner.times_ns) + 1)) - set(sent), "dropped"
    assert len(sent) > len(set(sent)), "repeated"
    assert len(inner.times_ns) < 9_999, "held back"


def test_two_sensors_of_one_server_never_share_a_time() -> None:
    server = Unkind(make_emulator("xela"), 3)
    server.opened(0)
    messages = [json.loads(piece) for piece in run(server, 0.0, 3.0)]
    times = np.array([(message["1"]["time"], message["2"]["time"]) for message in messages if "1" in message])
    apart = np.abs(times[:, 0] - times[:, 1])
    assert 0.0 < apart.min() <= apart.max() < 0.02
    assert np.ptp(apart) > 0.001, "they drift apart"


def test_what_only_the_emulator_has_is_that_of_the_emulator() -> None:
    inner = Silent()
    device = Unkind(inner, 1)
    device.began_ns = 7
    assert (device.began_ns, inner.began_ns, device.times_ns) == (7, 7, [])
    assert not hasattr(Unkind(make_emulator("xela"), 1), "began_ns")
    assert device.receive(b"?", 0) == []


def test_taxels_differ_leak_creep_and_spring_back() -> None:
    inner = Silent()
    device = Unkind(inner, 4, cols=4)
    rest, pressed = np.full((16, 3), 5.0), np.full((16, 3), 5.0)
    pressed[5] = 5.0, 5.0, 105.0
    device.press(rest)
    run(device, 0.0, 0.1)
    assert inner.felt[-1] == pytest.approx(rest)
    device.press(pressed)
    run(device, 0.1, 0.2)
    soon = inner.felt[-1] - 5.0
    assert 70.0 < soon[5, 2] < 120.0
    assert soon[[1, 4, 6, 9], 2].min() > 0.5
    assert np.abs(soon[5, :2]).max() > 0.5
    run(device, 0.2, 6.2, 20 * MS)
    assert inner.felt[-1][5, 2] - 5.0 > 1.03 * soon[5, 2]
    device.press(rest)
    run(device, 6.2, 6.3)
    assert inner.felt[-1][5, 2] - 5.0 > 0.03 * soon[5, 2]
    run(device, 6.3, 40.0, 100 * MS)
    assert inner.felt[-1] == pytest.approx(rest, abs=0.1)


def test_a_force_sensor_couples_and_drifts() -> None:
    inner = Silent()
    device = Unkind(inner, 5)
    device.feel(np.array((0.0, 0.0, 10.0)), np.zeros(3))
    run(device, 0.0, 0.1)
    first = inner.felt[-1]
    assert 0.0 < np.abs(first[:2]).max() < 0.5
    assert first[2] == pytest.approx(10.0, abs=0.4)
    run(device, 0.1, 10.0, 5 * MS)
    assert 0.0 < np.abs(inner.felt[-1] - first)[:3].max() < 0.1


@pytest.mark.parametrize("name", ["demo", "grips"])
def test_a_steady_grip_on_unkind_sensors_is_stable_and_measured(name: str, tmp_path: Path) -> None:
    rig = config.load(CONFIG / f"{name}.toml")
    engine = EmulatedEngine(rig, rig, tmp_path, unkind=True)
    wait(engine, 0.8)
    for finger in rig.finger:
        engine.ask("tare", finger=finger, seconds=0.3)
    wait(engine, 0.5)
    engine.touch("; ".join(f"press {finger} 6 N at 2 -1 mm; push {finger} -y 1 N" for finger in rig.finger))
    wait(engine, 0.4)
    engine.drop_messages()
    verdicts = (message for message in iter(engine.receive, None) if isinstance(message, Slip))
    taken = list(islice(verdicts, 100))
    assert {message.level.value for message in taken} <= {"stable", "unknown"}
    ratios = [message.friction_ratio for message in taken if message.friction_ratio is not None]
    assert len(ratios) > 90
    assert np.median(ratios) == pytest.approx(1 / 6, abs=0.05)


def wait(engine: EmulatedEngine, seconds: float) -> None:
    end_ns = engine.now_ns + round(seconds * 1e9)
    while engine.now_ns < end_ns:
        engine.receive()
