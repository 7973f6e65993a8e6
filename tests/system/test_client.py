"""The client's own rules against a whole daemon on real lines: who holds the lease, and why a tare was given up."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from daemon_peers import PATIENCE_S, Device
from patient_client import PatientClient

from slipd import config, service
from slipd.service_run import Endpoints
from slipd_client.aio import AsyncGripClient, AsyncLease
from slipd_client.errors import LeaseInUse, RequestRefused, TareGivenUp

RIG = """
[finger.left]
mu = 0.5

[finger.left.wrench]
device = "bota"
port = "{port}"
rate_hz = 100.0
"""


@pytest.fixture
def sensor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Device]:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path / "run"))
    device = Device(tmp_path / "wrench")
    device.plug()
    yield device
    device.unplug()


@asynccontextmanager
async def serving(sensor: Device) -> AsyncIterator[str]:
    """The daemon in this loop, until the block ends; the endpoint of its requests."""
    ready: asyncio.Future[Endpoints] = asyncio.get_running_loop().create_future()
    stop = asyncio.Event()
    rig = config.parse(RIG.format(port=sensor.path), "rig.toml")
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(service.serve(rig, on_ready=ready.set_result, stop=stop))
        try:
            yield (await asyncio.wait_for(ready, PATIENCE_S)).requests
        finally:
            stop.set()


class Feeder:
    """Sends a reading of the sensor every 5 ms: of ``normal_n``, or none at all where that is None."""

    def __init__(self, sensor: Device) -> None:
        self.normal_n: float | None = 0.0
        self._sensor = sensor

    async def run(self) -> None:
        while True:
            if self.normal_n is not None:
                self._sensor.send_wrench(self.normal_n)
            await asyncio.sleep(0.005)


async def take(client: AsyncGripClient, seconds: float) -> int:
    """Tare the finger, once there are fresh readings."""
    while True:
        try:
            return (await client.tare("left", seconds)).tares["wrench"].tare_id
        except TareGivenUp:
            raise
        except RequestRefused:
            await asyncio.sleep(0.05)


async def given_up(client: AsyncGripClient, end: Callable[[], object]) -> TareGivenUp:
    """Begin a tare, let something end it once it is in progress, and return the error of the client."""
    async with asyncio.timeout(PATIENCE_S):
        tare = asyncio.create_task(take(client, 10.0))
        while True:
            if (await client.tare_get("left")).busy:
                break
            await asyncio.sleep(0.05)
        ended = end()
        if asyncio.iscoroutine(ended):
            await ended
        with pytest.raises(TareGivenUp) as caught:
            await tare
    return caught.value


async def test_a_tare_that_was_given_up_is_reported_as_what_it_was(sensor: Device) -> None:
    feeder = Feeder(sensor)
    async with serving(sensor) as endpoint, PatientClient(endpoint) as client:
        feeding = asyncio.create_task(feeder.run())
        try:
            assert await take(client, 0.1) == 1
            undone = await given_up(client, lambda: client.tare_undo("left"))
            assert (undone.code, undone.reason) == ("not_ready", "undone")
            touched = await given_up(client, lambda: setattr(feeder, "normal_n", 10.0))
            assert (touched.code, touched.reason) == ("in_contact", "contact")
            feeder.normal_n = 0.0
            silent = await given_up(client, lambda: setattr(feeder, "normal_n", None))
            assert (silent.code, silent.reason) == ("not_ready", "silent")
            assert "fell silent" in str(silent)
            feeder.normal_n = 0.0
            ended = await given_up(client, sensor.unplug)
            assert (ended.code, ended.reason) == ("not_ready", "ended")
        finally:
            feeding.cancel()
            await asyncio.wait([feeding])


async def test_a_task_without_the_lease_is_refused_as_another_client_is(sensor: Device) -> None:
    """One client, two tasks: the one that does not hold the lease may not loosen verdicts, nor end the lease."""
    held, checked = asyncio.Event(), asyncio.Event()

    async with serving(sensor) as endpoint, PatientClient(endpoint) as client, PatientClient(endpoint) as other:

        async def hold(lease: AsyncLease) -> float | None:
            held.set()
            while not checked.is_set():
                await lease.wait(0.01)
            return (await client.friction_set("left", 0.6)).mu

        holder = asyncio.create_task(client.holding(hold))
        await held.wait()
        with pytest.raises(LeaseInUse):
            await client.friction_set("left", 0.9)
        with pytest.raises(LeaseInUse):
            await client.request("lease.release")
        with pytest.raises(LeaseInUse):
            async with client.lease():
                pytest.fail("the block ran")
        with pytest.raises(RequestRefused, match="no_lease"):
            await other.friction_set("left", 0.9)
        async with asyncio.timeout(PATIENCE_S):
            while not (await client.status()).lease.held:
                pass
        checked.set()
        assert await holder == 0.6
        assert (await client.status()).fingers["left"].mu == 0.6
