"""Two daemons of one user share a state folder: neither touches what is the other's."""

from __future__ import annotations

from pathlib import Path

import pytest
from loop_waits import PATIENCE_S, eventually
from service_rig import Rig, started

from slipd.gripper.stored_state import rig_of
from slipd.recording.reader import open_recording

pytestmark = pytest.mark.process

CONTINUOUS = """
[recording]
min_free_bytes = 0

[recording.continuous]
enabled = true
file_s = 1.0
keep_files = 2
"""


async def test_two_daemons_keep_their_own_recordings_and_states(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The one that begins new files deletes none of the other's, which goes on writing the same file."""
    state = tmp_path / "state"
    monkeypatch.setenv("SLIPD_STATE_DIR", str(state))
    rigs = {}
    for name in ("busy", "calm"):
        folder = tmp_path / name
        (folder / "run").mkdir(parents=True, mode=0o700)
        rigs[name] = rig = Rig(folder)
        text = rig.file.read_text(encoding="utf-8") + CONTINUOUS
        rig.file.write_text(text if name == "busy" else text.replace("file_s = 1.0", "file_s = 600.0"))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "calm" / "run"))

    def send() -> None:
        rigs["busy"].send()
        rigs["calm"].send()

    with started(rigs["calm"].file) as (calm, _):
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "busy" / "run"))
        with started(rigs["busy"].file) as (busy, _):
            (first,) = await eventually(lambda: [*state.glob("run-*000001*.mcap")], send)
            await eventually(lambda: any(int(path.name.split("-")[1]) >= 4 for path in state.glob("run-*.mcap")), send)
            assert first.exists(), "of the calm one, the oldest of all"
            for process in (busy, calm):
                process.terminate()
                assert process.wait(PATIENCE_S) == 0
    boots = [open_recording(path).boot for path in sorted(state.glob("run-*.mcap"))]
    assert (len(boots), len(set(boots))) == (3, 2), "one of the calm, and two that the busy one may keep"
    assert open_recording(first).complete
    assert {path.name for path in state.glob("state-*.json")} >= {
        f"state-{rig_of(rig.config)}.json" for rig in rigs.values()
    }
