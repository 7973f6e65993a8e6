"""A named object with the whole daemon on real lines."""

from __future__ import annotations

from pathlib import Path

import pytest
from daemon_peers import until
from patient_client import PatientClient
from service_rig import Rig, serving

from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd_client.aio import AsyncLease
from slipd_client.errors import RequestRefused
from slipd_client.messages import encode


async def test_a_named_object_is_kept_shown_and_replayed(rig: Rig, tmp_path: Path) -> None:
    async with (
        serving(rig.config, record=tmp_path / "run.mcap") as daemon,
        PatientClient(daemon.endpoints.requests) as client,
        PatientClient(daemon.endpoints.requests) as other,
    ):
        await until(lambda: daemon.hear("slip.left"), rig.send)

        async def name_it(_: AsyncLease) -> None:
            reply = await client.object_set("mug")
            assert (reply.object_name, reply.fingers["left"].mu_source) == ("mug", "config")
            assert reply.fingers["left"].mu == 0.5
            with pytest.raises(RequestRefused, match="no_lease"):
                await other.object_set("box")

        await client.holding(name_it)
        assert (await other.object_set("mug")).object_name == "mug", "the same name is no change"
        assert (await client.status()).object_name == "mug"
        with pytest.raises(RequestRefused, match="name must have 1 to 64 letters"):
            await client.object_set("a mug")
        await until(lambda: [body for body in daemon.hear("status") if body["object_name"] == "mug"], rig.send)
    recording = open_recording(tmp_path / "run.mcap")
    replayed = list(replay(recording))
    assert [(topic, encode(body)) for topic, body in replayed] == list(open_recording(tmp_path / "run.mcap").messages())
    assert replayed[-1][1].get("object_name", "mug") == "mug"
    assert any(body.get("object_name") == "mug" for topic, body in replayed if topic == "status")
