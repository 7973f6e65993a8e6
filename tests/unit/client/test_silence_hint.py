from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from slipd_client import paths
from slipd_client.paths import hint_for

NOBODY = 65534
root_alone = pytest.mark.skipif(os.geteuid() != 0, reason="only root becomes another user")
"""Root may enter every directory, so another user has to ask."""


@pytest.fixture
def directory() -> Iterator[Path]:
    """A directory in a folder that every user may enter, which those of pytest are not."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        made = Path(name) / "slipd"
        made.mkdir()
        yield made


def test_a_user_whose_variable_is_not_set_is_told_where_the_service_is(
    directory: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(paths, "SERVICE_DIR", tmp_path / "no service")
    missing = f"ipc://{tmp_path}/missing/publish"
    assert hint_for(missing) == "Is slipd running?"
    monkeypatch.setattr(paths, "SERVICE_DIR", directory)
    assert hint_for(missing).endswith(f"A service uses {directory}: for that one set SLIPD_RUNTIME_DIR={directory}")


@root_alone
def test_a_user_outside_the_group_is_told_to_join_it(directory: Path) -> None:
    os.chown(directory, 0, 1)
    directory.chmod(0o750)
    want = f"Only the group daemon may enter {directory}: sudo usermod -aG daemon $USER, then log in again"
    assert asked_by_nobody(directory) == want


def asked_by_nobody(directory: Path) -> str:
    """Return the hint for the user ``nobody``. Modules are imported first, because it may not read those of Python."""
    code = (
        "import grp, os, pwd, sys; from slipd_client.paths import hint_for;"
        f" os.setgroups([]); os.setgid({NOBODY}); os.setuid({NOBODY}); print(hint_for(sys.argv[1]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, f"ipc://{directory}/publish"], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()
