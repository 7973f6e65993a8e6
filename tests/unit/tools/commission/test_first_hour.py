"""From what `slipd init` writes for serial force sensors, charge pads and a WSG to a first grasp, in simulated time."""

from __future__ import annotations

from pathlib import Path

import pytest
from commission_person import ANSWERS, POSES_OF_TWO, TOUCHES
from emulated_engine import EmulatedEngine
from guided_engine import GuidedEngine

from slipd import config
from slipd.config.toml_text import marked_keys
from slipd.tools.commission import gripper_steps
from slipd.tools.commission.commission_guide import Commission
from slipd.tools.commission.dialogue import AGAIN, Prompt, Say, follow
from slipd.tools.discovery.config_draft import draft
from slipd.tools.discovery.port_probe import Found, SerialPort

FOUND = {"wrench": Found("optoforce", 100.0), "pad": Found("pvdf", 50.0, taxels=128, rows=8)}
PORTS = [(SerialPort(Path(f"/dev/{name}-{kind}")), FOUND[kind]) for name in ("left", "right") for kind in FOUND]
FILLED_IN = {
    "rate_hz = 1000.0": "rate_hz = 100.0",
    "counts_per_n = [1.0, 1.0, 1.0]  # MEASURE": "period_ms = 10\ncounts_per_n = [20.0, 20.0, 20.0]  #",
    "counts_per_nm = [1.0, 1.0, 1.0]  # MEASURE": "counts_per_nm = [1000.0, 1000.0, 1000.0]  #",
    "axis_scale = [1.0]  # MEASURE": "axis_scale = [0.0005]  #",
    "threshold = 0.0         # MEASURE": "threshold = 0.005         #",
    "charge_tau_s = 2.0  # MEASURE": "charge_tau_s = 2.0  #",
}
"""What a person fills in after ``slipd init``, from data sheets and drawings."""

GRIPPER = """
[gripper]
device = "wsg"
port = "tcp://192.168.1.20:1000"
rate_hz = 50.0
max_force_n = 30.0
"""
TRIED_AGAIN = {"close_again": ("", AGAIN)}
"""A close that is refused is tried again."""

MOUNTED = {
    "sign = 1 ": "sign = -1 ",
    "xyz_m = [0.0, 0.0, 0.0], quat_xyzw = [0.0, 0.0, 0.0, 1.0]": "xyz_m = [0.0, 0.006, -0.048], "
    "quat_xyzw = [0.0, 0.0, 0.7071068, 0.7071068]",
    "flip_x = false": "flip_x = true",
    "force_std_n": "mass_kg = 0.1\ncom_m = [-0.004, 0.0, -0.022]\nforce_std_n",
}
"""How the sensors are mounted, which the guide finds."""


class Person(GuidedEngine):
    """Acknowledges the stop of a gripper that lost its connection, as the guide asks for."""

    def _show(self, shown: Say | Prompt) -> None:
        if "slipctl grip ack" in shown.text:
            self.engine.ask("lease.acquire", ttl_ms=200)
            self.engine.ask("fault.ack")
            for _ in range(200):
                self._message()
        super()._show(shown)


def replaced(text: str, changed: dict[str, str]) -> str:
    for old, new in changed.items():
        assert old in text, old
        text = text.replace(old, new)
    return text


def test_a_rig_of_serial_optoforce_pvdf_and_wsg_is_commissioned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gripper_steps, "HOLD_S", 1.0)
    read = config.parse(replaced(draft(PORTS, [], "rig.toml"), FILLED_IN) + GRIPPER, "read")
    true = config.parse(replaced(read.text, MOUNTED), "true")
    host = Person(EmulatedEngine(true, read, tmp_path), read.text, TOUCHES, ANSWERS | POSES_OF_TWO | TRIED_AGAIN)
    follow(Commission(read, ["left", "right"], 20.0, "restart").run(), host.respond)
    assert any("left stable" in line and "right stable" in line for line in host.printed), "\n".join(host.printed)
    found = config.parse(host.text, "found")
    for finger in found.finger.values():
        assert finger.wrench is not None
        assert finger.pad is not None
        assert (finger.wrench.sign, finger.pad.flip_x) == (-1, True)
        assert finger.wrench.mass_kg == pytest.approx(0.1, abs=0.005)
        assert finger.mu == pytest.approx(0.57, abs=0.02), "a low estimate of 0.6"
    assert sum("hides a slip at less than" in line for line in host.printed) == 1
    assert not [line for line in host.printed if "not counted" in line or "not measured" in line]
    left = {key for *_, key in marked_keys(found.text)}
    assert left == {"rate_hz", "rows", "cols", "pitch_m", "electrode_m"}


def test_readings_in_counts_are_remarked_on_every_finger_and_end_what_builds_on_them(tmp_path: Path) -> None:
    filled_in = {old: new for old, new in FILLED_IN.items() if "counts_per_n =" not in old}
    text = replaced(draft(PORTS, [], "rig.toml"), filled_in).replace("counts_per_n =", "period_ms = 10\ncounts_per_n =")
    read = config.parse(text, "read")
    true = config.parse(text.replace("counts_per_n = [1.0, 1.0, 1.0]", "counts_per_n = [20.0, 20.0, 20.0]"), "true")
    host = Person(EmulatedEngine(true, read, tmp_path), read.text, TOUCHES, {})
    assert not follow(Commission(read, ["left", "right"], 20.0, "restart").run(), host.respond)
    assert sum("about 5 N and the sensor reads 1" in line for line in host.printed) == 2
    assert "  left out: the forces of finger left, right are in another unit, see above" in host.printed
    assert host.text == read.text


LEFT_PAD = (
    "centre of the left pad with",
    "end of the left pad",
    "corner of the left pad",
    "left pad again, and push along +X",
    "left pad again, and push along +Y",
)
"""Words of the prompts for the left pad, in the order of ``TOUCHES``."""


@pytest.mark.parametrize("touched", [False, True])
def test_a_finger_that_nobody_touches_is_left_out_alone(touched: bool, tmp_path: Path) -> None:
    read = config.parse(replaced(draft(PORTS, [], "rig.toml"), FILLED_IN), "read")
    only = dict(zip(LEFT_PAD, TOUCHES.values(), strict=True)) if touched else {}
    host = Person(EmulatedEngine(read, read, tmp_path), read.text, only, {})
    assert not follow(Commission(read, ["left", "right"], 2.0, "restart").run(), host.respond)
    shown = [line for line in host.printed if "is left out; later" in line]
    assert ("  finger left is left out; later: slipd commission --finger left" in shown) == (not touched)
    assert "  finger right is left out; later: slipd commission --finger right" in shown
    assert ("  left out; later: slipd commission --from mounting" in host.printed) == (not touched)
