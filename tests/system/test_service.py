"""The whole daemon on real pseudo-terminals and real sockets."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from typing import Any

import pytest
from daemon_peers import Device
from gripper_registers import read_requests
from gripper_table import gripper_table
from loop_waits import PATIENCE_S, eventually
from service_rig import Rig, serving

from slipd import config, service
from slipd.devices.shared import modbus
from slipd.engine.engine import Engine
from slipd.errors import RecordingError
from slipd.events import LinkSpec
from slipd.io.transport import Links
from slipd.recording.run_recordings import RunRecordings
from slipd.tools.sim.emulators import make_emulator
from slipd_client.messages import Health


async def test_a_reading_on_a_port_is_a_message_on_the_bus_also_where_the_port_comes_later(rig: Rig) -> None:
    rig.pad.unplug()
    async with serving(rig.config) as client:
        body = (await eventually(lambda: client.hear("wrench.left"), rig.send))[0]
        assert body["force_n"] == pytest.approx([1.0, 0.0, -10.0])
        await eventually(lambda: client.newest("slip.left").get("reasons") == ["rotation_unobserved"], rig.send)
        streams = (await eventually(lambda: client.newest("status")))["streams"]
        assert streams["left.pad"]["health"] == Health.ERROR
        assert "no such port" in streams["left.pad"]["message"]
        rig.pad.plug()
        slip = (await eventually(lambda: [s for s in client.hear("slip.left") if s["level"] == "stable"], rig.send))[0]
        assert slip["utilisation"] == pytest.approx(0.2, rel=1e-4)
        assert slip["config_id"] == rig.config.config_id
        assert abs(slip["timestamp"] - time.time()) < PATIENCE_S
        assert abs(slip["t_ns"] - time.monotonic_ns()) < PATIENCE_S * 1e9
        await eventually(lambda: client.hear("warning") and client.hear("tactile.left"), rig.send)


async def test_P1_a_failure_of_the_engine_ends_the_run_and_is_raised(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    handle = Engine.handle
    calls = 0

    def fail(engine: Engine, event: Any, t_ns: int) -> Any:
        nonlocal calls
        calls += 1
        if calls == 5:
            raise ZeroDivisionError("what nobody thought of")
        return handle(engine, event, t_ns)

    def is_full(_: RunRecordings) -> None:
        raise RecordingError("the disk is full")

    monkeypatch.setattr(Engine, "handle", fail)
    monkeypatch.setattr(RunRecordings, "close", is_full)
    with pytest.raises(ZeroDivisionError, match="what nobody thought of"):
        await asyncio.wait_for(service.serve(rig.config), PATIENCE_S)


async def test_the_end_of_a_run_stops_the_sensors_and_leaves_the_gripper_gripping(rig: Rig, tmp_path: Path) -> None:
    jaws = Device(tmp_path / "jaws")
    gripper, sensor = make_emulator("robotiq_2f"), make_emulator("bota")
    commands = b""

    def talk() -> None:
        nonlocal commands
        heard = jaws.read()
        commands += heard
        for reply in gripper.receive(heard, 0):
            jaws.send(reply)
        rig.send()

    text = rig.file.read_text(encoding="utf-8") + gripper_table(str(jaws.path))
    async with serving(config.parse(text, "rig.toml")) as client:
        await eventually(lambda: client.hear("wrench.left") and client.hear("gripper"), talk)
    sensor.opened(0)
    assert sensor.advance(10**9)
    sensor.receive(rig.wrench.read(), 10**9)
    assert sensor.advance(2 * 10**9) == []
    assert {request.function for request in read_requests(commands + jaws.read())} == {modbus.READ_INPUT}
    jaws.unplug()


async def test_what_was_lost_on_this_host_is_logged_when_it_grows_and_at_the_end(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def told() -> list[str]:
        return [record.message for record in caplog.records if record.name == "slipd.service"]

    monkeypatch.setattr(service, "LOSS_REPORT_S", 0.01)
    specs = [LinkSpec(name, "serial", str(tmp_path / name)) for name in ("absent", "unused")]
    async with asyncio.TaskGroup() as tasks, Links(tasks, specs, lambda _: None) as links:
        reporter = tasks.create_task(service._report_losses(links))
        links.write("absent", b"x")
        await eventually(told)
        await asyncio.sleep(0.05)
        once = ["absent: 1 commands not sent (line down, or not read), 0 datagrams lost so far"]
        assert told() == once
        links.write("absent", b"x")
        reporter.cancel()
    assert told() == [
        *once,
        "absent: 2 commands not sent (line down, or not read), 0 datagrams lost so far",
    ]
