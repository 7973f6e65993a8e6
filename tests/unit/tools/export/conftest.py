"""One recorded run, with what the engine publishes for it, and its exports."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from replays import RECORDINGS

from slipd.recording.reader import open_recording
from slipd.recording.replay import replay_dated
from slipd.tools.cli_arguments import EXPORTS as FORMATS
from slipd.tools.export.export_command import export_command

Dated = list[tuple[int, str, dict[str, Any]]]

RUN = RECORDINGS / "demo.mcap"


@pytest.fixture(scope="session")
def dated() -> Dated:
    """Time of publication (ns since 1970), topic and body of every message."""
    recording = open_recording(RUN)
    offset_ns = recording.wall_minus_monotonic_ns
    return [(t_ns + offset_ns, topic, body) for t_ns, topic, body in replay_dated(recording)]


@pytest.fixture(scope="session")
def exported(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Export of the run in each format."""
    folder = tmp_path_factory.mktemp("exports")
    for to in FORMATS:
        assert export_command([RUN], folder / to, to=to, rate_hz=50 if to == "lerobot" else None)
    return {to: folder / to for to in FORMATS}
