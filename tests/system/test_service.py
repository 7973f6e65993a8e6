"""The whole daemon on real pseudo-terminals and real sockets."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from typing import Any

import pytest
from daemon_peers import PATIENCE_S, Device, until
from gripper_table import gripper_table
from service_rig import Rig, left_in, serving

from slipd import config, service
from slipd.devices.robotiq_2f import robotiq_registers
from slipd.devices.shared import modbus
from slipd.engine.engine import Engine
from slipd.events import LinkSpec
from slipd.io.transport import Links
from slipd.tools.sim import modbus_device as sim
from slipd.tools.sim.emulators import make_emulator
from slipd_client.errors import RequestRefused
from slipd_client.grip import GripClient
from slipd_client.keys import create, load
from slipd_client.messages import Health
from slipd_client.subscriber import Subscriber


async def test_a_reading_on_the_port_is_a_message_on_the_bus(rig: Rig) -> None:
    async with serving(rig.config) as client:
        body = (await until(lambda: client.hear("wrench.left"), rig.send))[0]
        assert body["force_n"] == pytest.approx([1.0, 0.0, -10.0])
        slip = (await until(lambda: [s for s in client.hear("slip.left") if s["level"] == "stable"], rig.send))[0]
        assert slip["utilisation"] == pytest.approx(0.2, rel=1e-4)
        assert slip["config_id"] == rig.config.config_id
        assert abs(slip["timestamp"] - time.time()) < PATIENCE_S
        assert abs(slip["t_ns"] - time.monotonic_ns()) < PATIENCE_S * 1e9
        await until(lambda: client.hear("warning"))
        await until(lambda: client.hear("tactile.left"), rig.send)


async def test_a_port_that_is_missing_is_reported_and_read_once_it_comes_and_the_others_are_read(rig: Rig) -> None:
    rig.pad.unplug()
    async with serving(rig.config) as client:
        await until(lambda: client.hear("wrench.left"), rig.wrench.send_wrench)
        await until(lambda: client.hear("status"))
        await until(lambda: client.newest("status")["streams"]["left.wrench"]["samples"] > 20, rig.wrench.send_wrench)
        streams = client.newest("status")["streams"]
        assert streams["left.pad"]["health"] == Health.ERROR
        assert "no such port" in streams["left.pad"]["message"]
        assert streams["left.wrench"]["hardware_id"]
        await until(lambda: client.newest("slip.left")["reasons"] == ["rotation_unobserved"], rig.wrench.send_wrench)
        rig.pad.plug()
        await until(lambda: client.hear("tactile.left"), rig.send)


async def test_over_tcp_each_key_may_do_what_its_list_permits(rig: Rig, tmp_path: Path, runtime: Path) -> None:
    keys = tmp_path / "keys"
    for name in ("daemon", "reader", "requester"):
        create(name, keys)
    for name in ("reader", "requester"):
        (tmp_path / f"{name}s").mkdir()
        (tmp_path / f"{name}s" / f"{name}.key").write_bytes((keys / f"{name}.key").read_bytes())
    bus = f"""
[bus]
publish = "tcp://127.0.0.1:*"
requests = "tcp://127.0.0.1:*"
secret_key = "{keys}/daemon.key_secret"
readers = "{tmp_path}/readers"
requesters = "{tmp_path}/requesters"
"""
    with_bus = config.parse(rig.file.read_text(encoding="utf-8") + bus, "rig.toml")

    def ask(endpoint: str, name: str) -> str:
        with GripClient(endpoint, keys=load(keys / f"{name}.key_secret", keys / "daemon.key")) as client:
            try:
                return str(client.status()["version"])
            except RequestRefused as refusal:
                return refusal.code

    def listen(endpoint: str) -> str:
        mine = load(keys / "reader.key_secret", keys / "daemon.key")
        with Subscriber(endpoint, ["status"], keys=mine) as subscriber:
            return next(iter(subscriber)).topic

    async with serving(with_bus) as keyless:
        assert await asyncio.to_thread(ask, keyless.endpoints.requests, "requester")
        assert await asyncio.to_thread(ask, keyless.endpoints.requests, "reader") == "read_only"
        assert await asyncio.to_thread(listen, keyless.endpoints.publish) == "status"
        assert not keyless.hear("status")
    assert left_in(runtime) is None, "its endpoints need no runtime directory"


async def test_P1_a_failure_of_the_engine_ends_the_run_and_is_raised(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    handle = Engine.handle
    calls = 0

    def fail(engine: Engine, event: Any, t_ns: int) -> Any:
        nonlocal calls
        calls += 1
        if calls == 5:
            raise ZeroDivisionError("what nobody thought of")
        return handle(engine, event, t_ns)

    monkeypatch.setattr(Engine, "handle", fail)
    with pytest.raises(ZeroDivisionError, match="what nobody thought of"):
        await asyncio.wait_for(service.serve(rig.config), PATIENCE_S)


async def test_the_end_of_a_run_stops_the_sensors_and_leaves_the_gripper_gripping(rig: Rig, tmp_path: Path) -> None:
    jaws = Device(tmp_path / "jaws")
    jaws.plug()
    gripper, sensor = make_emulator("robotiq_2f"), make_emulator("bota")
    commands = b""

    def talk() -> None:
        nonlocal commands
        heard = jaws.hear()
        commands += heard
        for reply in gripper.receive(heard, 0):
            jaws.send(reply)
        rig.send()

    text = rig.file.read_text(encoding="utf-8") + gripper_table(str(jaws.path))
    async with serving(config.parse(text, "rig.toml")) as client:
        await until(lambda: client.hear("wrench.left") and client.hear("gripper"), talk)
    sensor.opened(0)
    assert sensor.advance(10**9)
    sensor.receive(rig.wrench.hear(), 10**9)
    assert sensor.advance(2 * 10**9) == []
    requests, rest = sim.parse_requests(commands + jaws.hear(), robotiq_registers.UNIT)
    assert {request.function for request in requests} == {modbus.READ_INPUT}
    assert rest == b""
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
        await until(told)
        await asyncio.sleep(0.05)
        once = ["absent: 1 writes dropped, 0 datagrams lost before they were read so far"]
        assert told() == once
        monkeypatch.setattr(service, "LOSS_REPORT_S", PATIENCE_S)
        await asyncio.sleep(0.05)
        links.write("absent", b"x")
        reporter.cancel()
    assert told() == [*once, "absent: 2 writes dropped, 0 datagrams lost before they were read so far"]
