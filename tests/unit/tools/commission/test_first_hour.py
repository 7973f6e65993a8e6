"""From what `slipd init` writes for serial force sensors, charge pads and a WSG to a first grasp, in simulated time."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from commission_person import TOUCHES
from emulated_engine import EmulatedEngine
from guided_engine import GuidedEngine

from slipd import config
from slipd.tools.commission.commission_guide import Commission
from slipd.tools.commission.dialogue import Prompt, Say, follow
from slipd.tools.discovery.config_draft import draft
from slipd.tools.discovery.port_probe import Found, SerialPort

FOUND = {"wrench": Found("optoforce", 100.0), "pad": Found("pvdf", 50.0, taxels=128, rows=8)}
PORTS = [(SerialPort(Path(f"/dev/{name}-{kind}")), FOUND[kind]) for name in ("left", "right") for kind in FOUND]
FILLED_IN = {
    "rate_hz = 1000.0": "rate_hz = 100.0",
    "counts_per_n = [1.0, 1.0, 1.0]  # MEASURE": "period_ms = 10\ncounts_per_n = [20.0, 20.0, 20.0]  #",
    "counts_per_nm = [1.0, 1.0, 1.0]  # MEASURE": "counts_per_nm = [1000.0, 1000.0, 1000.0]  #",
    "axis_scale = [1.0]  # MEASURE": "axis_scale = [0.0005]  #",
    "threshold = 0.0  # MEASURE": "threshold = 0.005  #",
    "charge_tau_s = 2.0  # MEASURE": "charge_tau_s = 2.0  #",
}
"""What a person fills in after ``slipd init``, from data sheets and drawings."""


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
    text = re.sub(" +# MEASURE", "  # MEASURE", text)
    for old, new in changed.items():
        assert old in text, old
        text = text.replace(old, new)
    return text


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
    assert ("  finger left is left out; later: slipd commission FILE --finger left" in shown) == (not touched)
    assert "  finger right is left out; later: slipd commission FILE --finger right" in shown
    assert ("  left out; later: slipd commission FILE --from mounting" in host.printed) == (not touched)
