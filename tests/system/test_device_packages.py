"""Devices of other packages in a fresh environment: installed, listed, emulated, read, recorded, replayed, removed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from fresh_environment import OFFLINE, PATIENCE_S, Environment
from project import ROOT
from rig_parts import wait_for

from slipd_client.messages.typed import Slip
from slipd_client.subscriber import Subscriber

pytestmark = [pytest.mark.process, pytest.mark.long, pytest.mark.timeout(1800)]

PACKAGES = ROOT / "clients" / "examples" / "devices"

RIG = """
[finger.left]
mu = 0.5

[finger.left.wrench]
device = "paxini"
package = "slipd-paxini"
port = "/dev/serial/by-id/paxini"
rate_hz = 100.0
stale_s = 0.1
range_n = 25.4
pad_from_sensor = { xyz_m = [0.0, 0.0, 0.0], quat_xyzw = [1.0, 0.0, 0.0, 0.0] }

[finger.left.pad]
device = "anyskin"
package = "slipd-anyskin"
port = "/dev/serial/by-id/anyskin"
rate_hz = 100.0
stale_s = 0.1
rows = 1
cols = 5
pitch_m = 0.007
electrode_m = 0.007
axis_scale = [1.0, 1.0, 1.0]
"""


def test_a_device_of_another_package_from_its_installation_to_its_removal(tmp_path: Path) -> None:
    rig, recording = tmp_path / "rig.toml", tmp_path / "run.mcap"
    rig.write_text(RIG, encoding="utf-8")
    environment = Environment(tmp_path)
    environment.pip(*OFFLINE, PACKAGES / "anyskin", PACKAGES / "paxini")
    listed = environment.slipd("devices").stdout
    assert "slipd-anyskin 0.1.0  maker's driver" in listed
    assert "bota" in listed
    assert 'package = "slipd-paxini"' in environment.slipd("devices", "paxini").stdout
    with environment.running("config:", "emulate", rig, "--dir", tmp_path / "emulated") as copy:
        with environment.running("publish:", "run", copy, "--record", recording) as endpoint:
            tare = ("tare", "take", "left")  # again where a busy machine lost readings meanwhile
            wait_for(lambda: environment.slipd(*tare, module="slipd_client.slipctl").returncode == 0, PATIENCE_S)
            assert environment.slipd("touch", tmp_path / "emulated", "press left 8 N at 0 0 mm").returncode == 0
            with Subscriber(endpoint, topics=("slip.left",)) as messages:
                seen = next(each for each in messages if isinstance(each, Slip) and (each.normal_n or 0.0) > 5.0)
        assert environment.slipd("touch", tmp_path / "emulated", "show").returncode == 0
    assert seen.level.name.lower() in ("unknown", "caution", "warning"), "without torque it is never stable"
    printed = environment.slipd("replay", recording, "--speed", "max", "--json").stdout
    replayed = [json.loads(line) for line in printed.splitlines()]
    (same,) = (each for each in replayed if each["topic"] == "slip.left" and each["seq"] == seen.seq)
    assert same["normal_n"] == seen.normal_n
    pads = [each for each in replayed if each["topic"] == "tactile.left"]
    assert pads
    assert all({"raw", "stale"} & {*each["image_reasons"]} for each in pads), "no conclusion from the field"
    environment.pip("uninstall", "--quiet", "--yes", "slipd-paxini")
    left = environment.slipd("devices").stdout
    assert "slipd-anyskin" in left
    assert "paxini" not in left
    for command in (("check", rig), ("run", rig), ("replay", recording, "--speed", "max")):
        refused = environment.slipd(*command)
        assert refused.returncode != 0
        assert "slipd-paxini" in refused.stdout + refused.stderr, "the error names the package that the config needs"
        assert "Traceback" not in refused.stderr
