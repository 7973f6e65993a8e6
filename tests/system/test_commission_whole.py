"""All four steps of ``slipd commission`` in one run, as a person does them: each part is a process of its own."""

from __future__ import annotations

from pathlib import Path

import pytest
from commission_person import TOUCHES
from commission_rig import PRESSES, TRUE, commission_rig
from commission_terminal import CommissionTerminal

from slipd import config

pytestmark = [pytest.mark.process, pytest.mark.long, pytest.mark.timeout(600)]

WRONG = {
    "quat_xyzw = [0.0, 0.0, 0.0, 1.0]": "quat_xyzw = [1.0, 0.0, 0.0, 0.0]",
    "mass_kg = 0.08": "mass_kg = 0.0",
    "com_m = [0.0, 0.0, -0.012]": "com_m = [0.0, 0.0, 0.0]",
    "flip_y = false": "flip_y = true",
}


def test_all_steps_lead_from_a_wrong_config_to_a_first_grasp_in_one_run(tmp_path: Path) -> None:
    with CommissionTerminal(tmp_path, commission_rig().text, WRONG, TOUCHES | PRESSES) as person:
        before = person.config.read_text(encoding="utf-8")
        code = person.follow()
        found = config.load(person.config)
    said = "\n".join(person.lines)
    assert code == 0, said
    assert person.lines[-1] == "Done."
    finger = found.finger["left"]
    assert finger.wrench is not None
    assert finger.pad is not None
    assert finger.wrench.pad_from_sensor.quat_xyzw == TRUE["quat"]
    assert finger.pad.flip_y is False
    assert finger.wrench.mass_kg == pytest.approx(TRUE["mass"], abs=0.002)
    assert finger.wrench.com_m == pytest.approx([0.0, 0.0, TRUE["com_z"]], abs=0.002)
    assert finger.mu == pytest.approx(0.55, abs=0.08), "a low estimate of 0.6"
    assert person.lines.count("Let go of it.") >= 2, "between three pulls"
    assert any(line.startswith("  left stable") for line in person.lines), said
    assert (tmp_path / "rig.toml.previous").read_text(encoding="utf-8") == before
