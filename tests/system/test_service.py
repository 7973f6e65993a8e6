"""The whole daemon on real pseudo-terminals and real sockets."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import resource
import signal
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from daemon_peers import PATIENCE_S, Client, Device, until

from slipd import config, service
from slipd.devices.robotiq_2f import robotiq_registers
from slipd.devices.shared import modbus
from slipd.engine.engine import Engine
from slipd.errors import LinkError, RecordingError
from slipd.events import LinkSpec
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd.service import Endpoints
from slipd.sim.emulators import make_emulator
from slipd.transport import Links
from slipd_client.errors import RequestRefused
from slipd_client.grip import GripClient
from slipd_client.keys import create, load
from slipd_client.messages import Health, encode
from slipd_client.subscriber import Subscriber

SLIPD = str(Path(sys.executable).with_name("slipd"))

RIG = """
[finger.left]
mu = 0.5

[finger.left.wrench]
device = "bota"
port = "{wrench}"
rate_hz = 100.0

[finger.left.pad]
device = "pvdf"
port = "{pad}"
rate_hz = 100.0
rows = 4
cols = 4
pitch_m = 0.004
electrode_m = 0.002
axis_scale = [0.01]
threshold = 0.05

[rates]
status_hz = 50.0
"""


class Rig:
    """Two devices on ptys, and the config of the daemon that reads them."""

    def __init__(self, folder: Path) -> None:
        self.wrench, self.pad = Device(folder / "wrench"), Device(folder / "pad")
        self.wrench.plug()
        self.pad.plug()
        self.file = folder / "rig.toml"
        self.file.write_text(RIG.format(wrench=self.wrench.path, pad=self.pad.path), encoding="utf-8")

    @property
    def config(self) -> config.Config:
        return config.load(self.file)

    def send(self) -> None:
        """Send one reading of each device, the image first."""
        self.pad.send_image()
        self.wrench.send_wrench()


def left_in(folder: Path) -> list[str] | None:
    """Return the names of the files in a folder; None if there is no folder."""
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else None


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path / "run"))
    return tmp_path / "run"


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    rig = Rig(tmp_path)
    yield rig
    rig.wrench.unplug()
    rig.pad.unplug()


@asynccontextmanager
async def serving(rig: config.Config, **options: Any) -> AsyncIterator[Client]:
    """Run the daemon in this loop for the duration of ``with``; yield a client."""
    ready: asyncio.Future[Endpoints] = asyncio.get_running_loop().create_future()
    stop = asyncio.Event()
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(service.serve(rig, on_ready=ready.set_result, stop=stop, **options))
        client = Client(await asyncio.wait_for(ready, PATIENCE_S))
        try:
            yield client
        finally:
            client.close()
            stop.set()


async def test_a_reading_on_the_port_is_a_message_on_the_bus(rig: Rig) -> None:
    async with serving(rig.config) as client:
        body = (await until(lambda: client.hear("wrench.left"), rig.send))[0]
        assert body["force_n"] == pytest.approx([1.0, 0.0, -10.0])
        slip = (await until(lambda: [s for s in client.hear("slip.left") if s["level"] == "stable"], rig.send))[0]
        assert slip["utilisation"] == pytest.approx(0.2, rel=1e-4)
        assert slip["config_id"] == rig.config.config_id
        assert abs(slip["timestamp"] - time.time()) < PATIENCE_S
        assert abs(slip["t_ns"] - time.monotonic_ns()) < PATIENCE_S * 1e9
        assert client.hear("warning")
        await until(lambda: client.hear("tactile.left"), rig.send)


async def test_a_port_that_is_missing_is_reported_and_the_others_are_read(rig: Rig) -> None:
    rig.pad.unplug()
    async with serving(rig.config) as client:
        await until(lambda: client.hear("wrench.left"), rig.wrench.send_wrench)
        streams = (await until(lambda: client.hear("status")))[-1]["streams"]
        assert streams["left.pad"]["health"] == Health.ERROR
        assert "no such port" in streams["left.pad"]["message"]
        assert streams["left.wrench"]["hardware_id"]
        await until(lambda: client.hear("status")[-1]["streams"]["left.wrench"]["samples"] > 20, rig.wrench.send_wrench)
        assert client.hear("slip.left")[-1]["reasons"] == ["rotation_unobserved"]


async def test_a_port_that_comes_later_is_read_from_then_on(rig: Rig) -> None:
    rig.pad.unplug()
    async with serving(rig.config) as client:
        await until(lambda: client.hear("wrench.left"), rig.wrench.send_wrench)
        rig.pad.plug()
        await until(lambda: client.hear("tactile.left"), rig.send)


async def test_garbage_on_a_line_is_counted_and_what_follows_is_read(rig: Rig) -> None:
    garbage = np.random.default_rng(7).bytes(300)

    def noise() -> None:
        rig.wrench.send(garbage)
        rig.pad.send(garbage)

    def counted() -> bool:
        streams = client.hear("status")[-1]["streams"] if client.hear("status") else {}
        return bool(streams) and all(stream["bad_bytes"] > 1000 for stream in streams.values())

    async with serving(rig.config) as client:
        await until(counted, noise)
        assert client.hear("wrench.left") == []
        await until(lambda: client.hear("wrench.left"), rig.send)
        await until(lambda: client.hear("tactile.left"), rig.send)


async def test_a_sensor_that_is_unplugged_makes_its_finger_unknown_until_it_is_back(rig: Rig) -> None:
    async with serving(rig.config) as client:
        await until(lambda: [s for s in client.hear("slip.left") if s["level"] == "stable"], rig.send)
        rig.wrench.unplug()
        await until(lambda: client.hear("warning")[-1]["reasons"] == ["stale"])
        rig.wrench.plug()
        await until(lambda: client.hear("warning")[-1]["level"] == "stable", rig.send)
        assert client.hear("status")[-1]["streams"]["left.wrench"]["reconnects"] == 1


async def test_requests_are_answered(rig: Rig) -> None:
    async with serving(rig.config) as client:
        client.ask(op="hello")
        hello = await until(client.answer)
        assert hello["ok"]
        assert hello["result"]["fingers"] == ["left"]
        envelope = {"boot": hello["result"]["boot"], "deadline_ns": hello["result"]["t_ns"] + 400_000_000}
        client.ask(op="grip.hold", **envelope)
        assert (await until(client.answer))["error"]["code"] in ("no_gripper", "deadline_passed")
        client.ask(op="lease.acquire", ttl_ms=100, **envelope | {"boot": "another"})
        assert (await until(client.answer))["error"]["code"] == "wrong_boot"


async def test_what_was_recorded_replays_as_it_was_published(rig: Rig, tmp_path: Path) -> None:
    async with serving(rig.config, record=tmp_path / "run.mcap") as client:
        await until(lambda: len(client.hear("slip.left")) > 10, rig.send)
        rig.wrench.unplug()
        client.ask(op="status")
        await until(client.answer)
        await until(lambda: client.hear("warning")[-1]["reasons"] == ["stale"])
        live = [(topic, body) for topic, body in client.heard]
    recording = open_recording(tmp_path / "run.mcap")
    replayed = list(replay(recording))
    assert recording.complete
    assert [(topic, encode(body)) for topic, body in replayed] == list(open_recording(tmp_path / "run.mcap").messages())
    heard = {(topic, body["seq"]): body for topic, body in live}
    assert all(body == heard.get((topic, body["seq"]), body) for topic, body in replayed)
    assert {(topic, body["seq"]) for topic, body in replayed} >= set(heard)


async def test_a_recording_that_a_client_asks_for_holds_what_it_was_sent(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLIPD_STATE_DIR", str(tmp_path / "state"))
    async with serving(rig.config) as client:
        await until(lambda: client.hear("slip.left"), rig.send)
        client.ask(op="hello")
        hello = (await until(client.answer))["result"]
        envelope = {"boot": hello["boot"], "deadline_ns": time.monotonic_ns() + 400_000_000}
        client.ask(op="record.start", **envelope)
        result = (await until(client.answer))["result"]
        name, path = result["name"], str(tmp_path / "state" / result["name"])
        assert result["path"] == path
        begun = len(client.hear("slip.left"))
        await until(lambda: len(client.hear("slip.left")) > begun + 5, rig.send)
        client.ask(op="status")
        recording = (await until(client.answer))["result"]["recording"]
        assert recording == {
            "name": name,
            "path": path,
            "state": "running",
            "running": True,
            "failure": None,
            "lost": 0,
        }
        heard = [encode(body) for body in client.hear("slip.left")[begun + 1 :]]
    recorded = open_recording(tmp_path / "state" / name)
    told = [payload for topic, payload in recorded.messages() if topic == "slip.left"]
    assert recorded.complete
    assert set(heard) <= set(told)
    assert len(list(replay(recorded))) > 10, "its links are open, so its readings are heard"


async def test_a_recording_is_never_overwritten(rig: Rig, tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_bytes(b"precious")
    with pytest.raises(RecordingError):
        await service.serve(rig.config, record=tmp_path / "run.mcap")
    assert (tmp_path / "run.mcap").read_bytes() == b"precious"


@pytest.mark.parametrize("scheme", ["ipc", "tcp"])
async def test_a_run_whose_endpoint_is_in_use_leaves_no_recording_and_compiles_nothing(
    rig: Rig, tmp_path: Path, scheme: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    endpoint = f"ipc://{tmp_path}/requests" if scheme == "ipc" else f"tcp://127.0.0.1:{port}"
    bus = f'[bus]\npublish = "ipc://{tmp_path}/{{}}"\nrequests = "{endpoint}"\nallow_local_tcp = true\n'
    text = rig.file.read_text(encoding="utf-8")
    first, second = (config.parse(text + bus.format(name), "rig.toml") for name in ("first", "second"))
    async with serving(first):
        with monkeypatch.context() as patch:
            patch.setattr(service, "warm_up", lambda: pytest.fail("the kernels are compiled"))
            with pytest.raises(LinkError, match=f"{endpoint}: "):
                await service.serve(second, record=tmp_path / "run.mcap")
        assert not (tmp_path / "run.mcap").exists()
    async with serving(second, record=tmp_path / "run.mcap"):
        pass
    assert open_recording(tmp_path / "run.mcap").complete


async def test_a_run_that_fails_while_it_starts_leaves_no_recording(rig: Rig, tmp_path: Path) -> None:
    def fail(_: Endpoints) -> None:
        raise BrokenPipeError("nobody reads where it serves")

    with pytest.raises(BaseExceptionGroup):
        await service.serve(rig.config, record=tmp_path / "run.mcap", on_ready=fail)
    assert not (tmp_path / "run.mcap").exists()


@pytest.mark.parametrize("record", ["run.mcap", "nowhere/run.mcap"])
async def test_a_recording_that_cannot_be_created_is_refused_before_the_kernels_are_compiled(
    rig: Rig, tmp_path: Path, record: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run.mcap").write_bytes(b"precious")
    monkeypatch.setattr(service, "warm_up", lambda: pytest.fail("the kernels are compiled"))
    with pytest.raises(RecordingError, match=rf"{record}: (exists already|cannot be created: there is no folder)"):
        await service.serve(rig.config, record=tmp_path / record)


async def asked(client: Client, op: str) -> dict[str, Any]:
    """Return the reply to a request with a valid envelope."""
    client.ask(op="hello")
    hello = (await until(client.answer))["result"]
    client.ask(op=op, id=hello["t_ns"], boot=hello["boot"], deadline_ns=time.monotonic_ns() + 400_000_000)
    return await until(client.answer)


async def test_a_recording_on_request_that_cannot_be_created_fails_in_its_reply(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLIPD_STATE_DIR", "/proc/slipd")
    async with serving(rig.config) as client:
        error = (await asked(client, "record.start"))["error"]
        assert error["code"] == "record_failed"
        assert error["message"] == "/proc/slipd: cannot be created: No such file or directory"
        client.ask(op="status")
        recording = (await until(client.answer))["result"]["recording"]
        assert (recording["state"], recording["failure"]) == ("failed", error["message"])


async def test_recordings_on_request_are_limited_in_number_and_size(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLIPD_STATE_DIR", str(tmp_path / "state"))
    text = rig.file.read_text(encoding="utf-8")
    limits = "[recording]\nmax_bytes = 1_000_000\nmax_files = 1\nmin_free_bytes = 0\n"

    def limited() -> dict[str, Any] | None:
        recording = client.hear("status")[-1]["recording"]
        return recording if recording["state"] == "limited" else None

    async with serving(config.parse(text + limits, "rig.toml")) as client:
        await until(lambda: client.hear("wrench.left"), rig.send)
        path = Path((await asked(client, "record.start"))["result"]["path"])
        recording = await until(limited, lambda: rig.wrench.send(os.urandom(3000)))
        assert recording["failure"] == f"{path}: the recording reached recording.max_bytes, 1000000"
        await until(lambda: open_recording(path).closed)
        recorded = open_recording(path)
        assert sum(1 for _ in recorded.entries()) > 100
        assert recorded.complete
        refused = (await asked(client, "record.start"))["error"]
        assert refused["code"] == "no_room"
        assert "holds 1 recordings, and recording.max_files is 1: move or delete some" in refused["message"]
        await asyncio.to_thread(path.unlink)
        assert (await asked(client, "record.start"))["ok"]


async def test_a_disk_that_is_too_full_is_left_alone(rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLIPD_STATE_DIR", str(tmp_path / "state"))
    text = rig.file.read_text(encoding="utf-8") + f"[recording]\nmin_free_bytes = {2**62}\n"
    async with serving(config.parse(text, "rig.toml")) as client:
        refused = (await asked(client, "record.start"))["error"]
        assert refused["code"] == "no_room"
        assert "free bytes, less than recording.min_free_bytes" in refused["message"]
        assert left_in(tmp_path / "state") == []


async def test_two_daemons_do_not_share_a_runtime_directory(rig: Rig, runtime: Path) -> None:
    async with serving(rig.config):
        with pytest.raises(LinkError, match=rf"{runtime}: another slipd uses this directory \(process {os.getpid()}\)"):
            await service.serve(rig.config)
    async with serving(rig.config):
        pass  # once the first has ended, there is room for another


async def test_endpoints_of_the_config_need_no_runtime_directory(rig: Rig, runtime: Path) -> None:
    bus = '[bus]\npublish = "tcp://127.0.0.1:*"\nrequests = "tcp://127.0.0.1:*"\nallow_local_tcp = true\n'
    with_bus = config.parse(rig.file.read_text(encoding="utf-8") + bus, "rig.toml")
    async with serving(with_bus) as client:
        await until(lambda: client.hear("wrench.left"), rig.send)
    assert left_in(runtime) is None


async def test_over_tcp_each_key_may_do_what_its_list_permits(rig: Rig, tmp_path: Path) -> None:
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


GRIPPER = """
[gripper]
device = "robotiq_2f"
port = "{port}"
rate_hz = 50.0
force_table = [[0, 3.0], [255, 30.0]]
width_table = [[0.0, 0.085], [1.0, 0.0]]
max_force_n = 25.0
"""


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

    text = rig.file.read_text(encoding="utf-8") + GRIPPER.format(port=jaws.path)
    async with serving(config.parse(text, "rig.toml")) as client:
        await until(lambda: client.hear("wrench.left") and client.hear("gripper"), talk)
    sensor.opened(0)
    assert sensor.advance(10**9)
    sensor.receive(rig.wrench.hear(), 10**9)
    assert sensor.advance(2 * 10**9) == []
    requests, rest = modbus.parse_requests(commands + jaws.hear(), robotiq_registers.UNIT)
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


async def test_the_end_of_a_run_gives_the_signals_back(rig: Rig) -> None:
    async with serving(rig.config):
        assert signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@contextlib.contextmanager
def start(rig: Path, *arguments: str, before: Sequence[str] = (), **options: Any) -> Iterator[subprocess.Popen[str]]:
    """Start a daemon process, which ends even if the test fails."""
    command = [*before, SLIPD, "run", "--config", str(rig), *arguments]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, text=True, **(pipes | options)) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()


def client_of(process: subprocess.Popen[str]) -> Client:
    """Return a client of a daemon that has just been started."""
    assert process.stdout is not None
    lines = [process.stdout.readline().strip() for _ in range(2)]
    return Client(Endpoints(*(line.partition(": ")[2] for line in lines)))


@pytest.mark.process
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
async def test_P4_a_signal_ends_the_process_well(
    rig: Rig, runtime: Path, tmp_path: Path, number: signal.Signals
) -> None:
    with start(rig.file, "--record", str(tmp_path / "run.mcap")) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        client = client_of(process)
        assert client.endpoints == Endpoints(f"ipc://{runtime}/publish", f"ipc://{runtime}/requests")
        await until(lambda: client.hear("wrench.left"), rig.send)
        assert client.hear("status")[-1]["run_recording"]["path"] == str(tmp_path / "run.mcap")
        client.close()
        process.send_signal(number)
        assert process.wait(PATIENCE_S) == 0
        assert process.stdout.read() == ""
        assert "Traceback" not in process.stderr.read()
    recorded = open_recording(tmp_path / "run.mcap")
    assert recorded.closed
    assert sum(1 for _ in recorded.entries()) > 0
    assert recorded.complete


@pytest.mark.process
async def test_a_daemon_under_nohup_outlives_its_terminal(rig: Rig) -> None:
    with start(rig.file, before=["nohup"]) as process:
        client = client_of(process)
        process.send_signal(signal.SIGHUP)
        heard = len(client.hear("status"))
        await until(lambda: len(client.hear("status")) > heard + 5)
        client.close()
        process.terminate()
        assert process.wait(PATIENCE_S) == 0


@pytest.mark.process
async def test_K1_a_full_disk_ends_the_recording_and_says_so_and_the_run_goes_on(rig: Rig, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"

    def stopped() -> dict[str, Any] | None:
        recording = client.hear("status")[-1]["run_recording"] if client.hear("status") else None
        return recording if recording and recording["state"] == "failed" else None

    def send() -> None:
        rig.send()
        rig.wrench.send(os.urandom(1000))

    with start(rig.file, "--record", str(path)) as process:
        assert process.stderr is not None
        client = client_of(process)
        await until(lambda: sum(1 for _ in open_recording(path).entries()) > 10, rig.send)
        most = open_recording(path).path.stat().st_size + 3000
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (most, most))  # no file of it may be longer
        recording = await until(stopped, send)
        reason = f"{path}: the recording stopped: File too large"
        assert (recording["path"], recording["failure"]) == (str(path), reason)
        assert recording["lost"] > 0
        heard = len(client.hear("wrench.left"))
        await until(lambda: len(client.hear("wrench.left")) > heard + 10, rig.send)
        assert process.poll() is None
        client.close()
        process.terminate()
        assert process.wait(PATIENCE_S) == 1
        errors = process.stderr.read()
    assert f"ERROR slipd.recording.recorder_watch: {reason}\n" in errors
    assert re.search(rf"\nslipd: {reason}; (\d+) entries are missing\n$", errors)
    recorded = open_recording(path)
    assert sum(1 for _ in recorded.entries()) > 0
    assert recorded.closed
    assert recorded.lost > recording["lost"]
    assert "stopped before the run did (File too large)" in str(recorded.fault)


@pytest.mark.process
def test_K1_a_disk_that_is_full_from_the_start_is_reported_at_once(rig: Rig) -> None:
    with start(rig.file, "--record", "/dev/full") as process:
        out, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, out) == (1, "")
    assert errors.endswith("slipd: /dev/full: cannot be written: No space left on device\n")


@pytest.mark.process
async def test_a_second_process_is_refused_in_words(rig: Rig, runtime: Path) -> None:
    async with serving(rig.config) as client:
        process = await asyncio.create_subprocess_exec(
            *(SLIPD, "run", "--config", str(rig.file)),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        out, err = await asyncio.wait_for(process.communicate(), PATIENCE_S)
        assert process.returncode == 1
        assert out == b""
        assert f"slipd: {runtime}: another slipd uses this directory (process {os.getpid()})" in err.decode()
        assert b"Traceback" not in err
        await until(lambda: client.hear("wrench.left"), rig.send)  # the first one serves on


@pytest.mark.process
def test_a_process_with_a_bad_config_reports_the_line(rig: Rig) -> None:
    text = rig.file.read_text(encoding="utf-8").replace("rows = 4", "rows = 4.5")
    rig.file.write_text(text, encoding="utf-8")
    line = text.splitlines().index("rows = 4.5") + 1
    done = subprocess.run(
        [SLIPD, "run", "--config", str(rig.file)], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith(f"{rig.file}:{line}: finger.left.pad.rows: ")
