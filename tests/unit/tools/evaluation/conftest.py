from collections.abc import Callable
from pathlib import Path

import pytest
from replays import RECORDINGS

from slipd.recording.reader import open_recording


@pytest.fixture(autouse=True)
def cache_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """No test sees the results of another, or those of the user."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def config_file(tmp_path: Path) -> Callable[..., Path]:
    """Write the config of a recording, with some texts replaced."""

    def write(recording: str, name: str, *changes: tuple[str, str]) -> Path:
        text = open_recording(RECORDINGS / f"{recording}.mcap").config_text
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write
