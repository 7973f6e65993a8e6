"""``slipd commission`` as a person uses it: in a terminal, with a daemon on emulated devices, each a process."""

from __future__ import annotations

from pathlib import Path

import pytest
from commission_person import TOUCHES
from commission_rig import PRESSES, TRUE, commission_rig
from commission_terminal import CommissionTerminal
from own_address import free_port, own_host
from viewed_rig import make_keys

from slipd import config

pytestmark = pytest.mark.process

RIG = """# One finger.
[finger.left]
min_normal_n = 1.5  # more than the bias of the emulated sensor

[finger.left.wrench]
device = "bota"
port = "/dev/serial/by-id/left"
rate_hz = 100.0
sign = -1
stale_s = 0.5
pad_from_sensor = { xyz_m = [0.004, -0.002, -0.025], quat_xyzw = [0.9659258, 0.2588190, 0.0, 0.0] }
"""


def test_what_is_found_is_written_with_a_backup_where_the_daemon_admits_only_keys(tmp_path: Path) -> None:
    bus = make_keys(tmp_path)
    for _ in range(2):
        bus = bus.replace("127.0.0.1:*", f"{own_host()}:{free_port()}", 1)
    changes = {"# One finger.": bus, "sign = -1": "sign = 1  # MEASURE"}
    with CommissionTerminal(tmp_path, RIG, changes, TOUCHES) as person:
        before, there = person.config.read_text(encoding="utf-8"), {*tmp_path.iterdir()}
        code = person.follow("--key", f"{tmp_path}/keys/requester.key_secret", until="Now restart the daemon")
        assert code == 130, "\n".join(person.lines)
        previous = tmp_path / "rig.toml.previous"
        assert {*tmp_path.iterdir()} - there == {previous}
        assert previous.read_text(encoding="utf-8") == before
        found = before.replace("sign = 1  # MEASURE", "sign = -1  # slipd commission")
        assert person.config.read_text(encoding="utf-8") == found


WRONG = {
    "quat_xyzw = [0.0, 0.0, 0.0, 1.0]": "quat_xyzw = [1.0, 0.0, 0.0, 0.0]",
    "mass_kg = 0.08": "mass_kg = 0.0",
    "com_m = [0.0, 0.0, -0.012]": "com_m = [0.0, 0.0, 0.0]",
    "flip_y = false": "flip_y = true",
}


@pytest.mark.long
@pytest.mark.timeout(600)
def test_all_steps_lead_from_a_wrong_config_to_a_first_grasp_in_one_run(tmp_path: Path) -> None:
    with CommissionTerminal(tmp_path, commission_rig().text, WRONG, TOUCHES | PRESSES) as person:
        before = person.config.read_text(encoding="utf-8")
        code = person.follow()
        found = config.load(person.config)
    said = "\n".join(person.lines)
    assert code == 0, said
    assert person.lines[-1] == "Done."
    finger = found.finger["left"].model_dump()
    wrench = finger["wrench"]
    assert (wrench["pad_from_sensor"]["quat_xyzw"], finger["pad"]["flip_y"]) == (TRUE["quat"], False)
    assert (wrench["mass_kg"], *wrench["com_m"]) == pytest.approx((TRUE["mass"], 0.0, 0.0, TRUE["com_z"]), abs=0.002)
    assert finger["mu"] == pytest.approx(0.55, abs=0.08), "a low estimate of 0.6"
    assert person.lines.count("Let go of it.") >= 2, "between three pulls"
    assert any(line.startswith("  left stable") for line in person.lines), said
    assert (tmp_path / "rig.toml.previous").read_text(encoding="utf-8") == before
