"""Recordings of the whole daemon, of a run and on request."""

from __future__ import annotations

from pathlib import Path

import pytest
from loop_waits import eventually
from mcap.writer import MCAP0_MAGIC
from own_address import free_port, own_host
from service_rig import Rig, asked, serving

from slipd import config, service
from slipd.errors import LinkError, RecordingError
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd.service_run import Endpoints
from slipd_client.messages import decode, encode


async def test_every_recording_of_a_run_is_complete_and_replays_as_it_was_published(rig: Rig, tmp_path: Path) -> None:
    """That of the run, one that a client asks for, and what happened before a warning."""
    folder = tmp_path / "kept"
    limits = f'[recording]\ndirectory = "{folder}"\n[recording.incidents]\nenabled = true\nafter_s = 0.2\n'

    def slide() -> None:
        rig.pad.send_image()
        rig.wrench.send_wrench(2.1)

    def saved() -> list[Path]:
        """Incidents that are closed: several where readings came late, and the finger was stale in between."""
        found = ((path, path.read_bytes()) for path in folder.glob("incident-*-left-*.mcap"))
        return [path for path, data in found if len(data) > 1000 and data.endswith(MCAP0_MAGIC)]

    settings = config.parse(rig.file.read_text(encoding="utf-8") + limits, "rig.toml")
    async with serving(settings, record=tmp_path / "run.mcap") as client:
        await eventually(lambda: len(client.hear("slip.left")) > 10, rig.send)
        requested = (await asked(client, "record.start"))["result"]
        recording = (await asked(client, "status"))["result"]["recording"]
        assert recording == requested | {"state": "running", "running": True, "failure": None, "lost": 0}
        await eventually(saved, slide)
        heard = {(topic, encode(body)) for topic, body in client.heard}
        boot = client.newest("status")["boot"]
    recorded = {path: open_recording(path) for path in (tmp_path / "run.mcap", folder / requested["name"], *saved())}
    assert all(recording.complete for recording in recorded.values())
    run, asked_for, *incidents = (list(recording.messages()) for recording in recorded.values())
    assert heard <= {*run}
    for published in (asked_for, *incidents):
        begin = run.index(published[0])
        assert run[begin : begin + len(published)] == published, "a part of the run"
    for path, published in zip(saved(), incidents, strict=True):
        warnings = [decode(payload) for topic, payload in published if topic == "warning"]
        assert boot in path.name
        assert any(body["level"] == path.stem.rpartition("-")[2] for body in warnings)
    replayed = [(topic, encode(body)) for topic, body in replay(recorded[tmp_path / "run.mcap"])]
    assert replayed == run, "nothing was dropped"


@pytest.fixture
def nothing_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(service, "compile_kernels", lambda: pytest.fail("the kernels are compiled"))


@pytest.mark.parametrize("scheme", ["ipc", "tcp"])
async def test_a_run_whose_endpoint_is_in_use_leaves_no_recording_and_compiles_nothing(
    rig: Rig, tmp_path: Path, scheme: str, request: pytest.FixtureRequest
) -> None:
    endpoint = f"ipc://{tmp_path}/requests" if scheme == "ipc" else f"tcp://{own_host()}:{free_port()}"
    bus = f'[bus]\npublish = "ipc://{tmp_path}/{{}}"\nrequests = "{endpoint}"\nallow_local_tcp = true\n'
    text = rig.file.read_text(encoding="utf-8")
    first, second = (config.parse(text + bus.format(name), "rig.toml") for name in ("first", "second"))
    async with serving(first):
        request.getfixturevalue("nothing_is_compiled")
        with pytest.raises(LinkError, match=f"{endpoint}: "):
            await service.serve(second, record=tmp_path / "run.mcap")
    assert not (tmp_path / "run.mcap").exists()


async def test_a_run_that_fails_while_it_starts_leaves_no_recording(rig: Rig, tmp_path: Path) -> None:
    def fail(_: Endpoints) -> None:
        raise BrokenPipeError("nobody reads where it serves")

    with pytest.raises(BaseExceptionGroup):
        await service.serve(rig.config, record=tmp_path / "run.mcap", on_ready=fail)
    assert not (tmp_path / "run.mcap").exists()


@pytest.mark.usefixtures("nothing_is_compiled")
@pytest.mark.parametrize("record", ["run.mcap", "nowhere/run.mcap"])
async def test_a_recording_that_cannot_be_created_is_refused_before_the_kernels_are_compiled(
    rig: Rig, tmp_path: Path, record: str
) -> None:
    (tmp_path / "run.mcap").write_bytes(b"precious")
    with pytest.raises(RecordingError, match=rf"{record}: (exists already|cannot be created: there is no folder)"):
        await service.serve(rig.config, record=tmp_path / record)
    assert (tmp_path / "run.mcap").read_bytes() == b"precious"
