"""A shipped config of force sensors behind pads on a gripper runs in the engine, on emulated devices."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from emulated_engine import EmulatedEngine

from slipd import config
from slipd.tools.sim import touched_devices
from slipd_client.messages.schema.topics import Slip

GRAVITY = (9.80665, 0.0, 0.0)


def test_bota_and_xela_on_a_robotiq_grip_an_object(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(touched_devices, "BIAS", np.zeros(6))
    rig = config.load(config.shipped("bota_xela.toml"))
    engine = EmulatedEngine(rig, rig, tmp_path)
    newest: dict[str, Slip] = {}

    def listen(messages: int) -> None:
        for _ in range(messages):
            if isinstance(message := engine.receive(), Slip):
                newest[message.finger] = message

    def tell_gravity() -> None:
        for finger in rig.finger:
            engine.ask("gravity.set", finger=finger, gravity_mps2=list(GRAVITY))

    listen(200)
    for finger in rig.finger:
        for stream in ("pad", "wrench"):
            tell_gravity()
            engine.ask("tare", finger=finger, seconds=0.1, stream=stream, unloaded=True)
            listen(150)
    tell_gravity()
    listen(20)
    assert {name: slip.level for name, slip in newest.items()} == {"left": "no_contact", "right": "no_contact"}
    engine.ask("lease.acquire", ttl_ms=200)
    engine.ask("gripper.activate", drop=True)
    while not engine.ask("status").gripper.active:  # type: ignore[attr-defined]
        listen(100)
    engine.touch("object 40 mm")
    engine.ask("lease.acquire", ttl_ms=200)
    engine.ask("gripper.close", force_n=20.0)
    for _ in range(6):
        tell_gravity()
        listen(100)
    for slip in newest.values():
        assert (slip.level, slip.reasons) == ("stable", ())
        assert slip.normal_n is not None
        assert abs(slip.normal_n - 20.0) < 1.0
