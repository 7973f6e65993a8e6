"""Recordings of the whole daemon, of a run and on request."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from daemon_peers import until
from mcap.writer import MCAP0_MAGIC
from own_address import free_port, own_host
from service_rig import Rig, asked, serving

from slipd import config, service
from slipd.errors import LinkError, RecordingError
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd.service_run import Endpoints
from slipd_client.messages import decode, encode


async def test_what_was_recorded_replays_as_it_was_published(rig: Rig, tmp_path: Path) -> None:
    async with serving(rig.config, record=tmp_path / "run.mcap") as client:
        await until(lambda: len(client.hear("slip.left")) > 10, rig.send)
        rig.wrench.unplug()
        client.ask(op="status")
        await until(client.answer)
        await until(lambda: client.newest("warning").get("reasons") == ["stale"])
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
        result = (await asked(client, "record.start"))["result"]
        name, path = result["name"], str(tmp_path / "state" / result["name"])
        assert result["path"] == path
        begun_ns = (await asked(client, "hello"))["result"]["t_ns"]

        def recorded_slips() -> list[dict[str, Any]]:
            """What was published since the reply; some of what was published before it arrives later."""
            return [body for body in client.hear("slip.left") if body["t_ns"] > begun_ns]

        await until(lambda: len(recorded_slips()) > 5, rig.send)
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
        heard = [encode(body) for body in recorded_slips()]
    recorded = open_recording(tmp_path / "state" / name)
    told = [payload for topic, payload in recorded.messages() if topic == "slip.left"]
    assert recorded.complete
    assert set(heard) <= set(told)
    assert len(list(replay(recorded))) > 10, "its links are open, so its readings are heard"


@pytest.mark.parametrize("scheme", ["ipc", "tcp"])
async def test_a_run_whose_endpoint_is_in_use_leaves_no_recording_and_compiles_nothing(
    rig: Rig, tmp_path: Path, scheme: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    endpoint = f"ipc://{tmp_path}/requests" if scheme == "ipc" else f"tcp://{own_host()}:{free_port()}"
    bus = f'[bus]\npublish = "ipc://{tmp_path}/{{}}"\nrequests = "{endpoint}"\nallow_local_tcp = true\n'
    text = rig.file.read_text(encoding="utf-8")
    first, second = (config.parse(text + bus.format(name), "rig.toml") for name in ("first", "second"))
    async with serving(first):
        with monkeypatch.context() as patch:
            patch.setattr(service, "compile_kernels", lambda: pytest.fail("the kernels are compiled"))
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
    monkeypatch.setattr(service, "compile_kernels", lambda: pytest.fail("the kernels are compiled"))
    with pytest.raises(RecordingError, match=rf"{record}: (exists already|cannot be created: there is no folder)"):
        await service.serve(rig.config, record=tmp_path / record)
    assert (tmp_path / "run.mcap").read_bytes() == b"precious"


async def test_what_happened_before_a_warning_is_saved_and_replays(rig: Rig, tmp_path: Path) -> None:
    folder = tmp_path / "kept"
    limits = f'[recording]\ndirectory = "{folder}"\n[recording.incidents]\nenabled = true\nafter_s = 0.2\n'

    def slide() -> None:
        rig.pad.send_image()
        rig.wrench.send_wrench(2.1)

    def saved() -> list[Path]:
        found = ((path, path.read_bytes()) for path in folder.glob("incident-*-left-*.mcap"))
        return [path for path, data in found if len(data) > 1000 and data.endswith(MCAP0_MAGIC)]

    async with serving(config.parse(rig.file.read_text(encoding="utf-8") + limits, "rig.toml")) as client:
        await until(lambda: len(client.hear("slip.left")) > 10, rig.send)
        await until(saved, slide)
        boot = client.hear("status")[-1]["boot"]
    for path in saved():  # more than one where the readings came late, and the finger was stale in between
        level = path.stem.rpartition("-")[2]
        assert boot in path.name
        recording = open_recording(path)
        published = list(recording.messages())
        assert recording.complete
        warnings = [decode(payload) for topic, payload in published if topic == "warning"]
        assert any(body["level"] == level for body in warnings)
        replayed = [(topic, encode(body)) for topic, body in replay(open_recording(path))]
        assert replayed == published, "nothing was dropped"
