"""Parts of a rig as processes, with the runtime directory of a folder, and a wait for what they do."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from slipd.service_run import Endpoints
from slipd_client.errors import ClientError

T = TypeVar("T")
ENDS_S = 10.0
PATIENCE_S = 60.0


@contextmanager
def part(folder: Path, name: str, *arguments: str, **variables: str) -> Iterator[subprocess.Popen[str]]:
    """Run a module until the block ends; it starts beside what follows, and `first_line` waits for it."""
    with subprocess.Popen(
        [sys.executable, "-m", name, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"SLIPD_RUNTIME_DIR": str(folder / "run")} | variables,
    ) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGCONT)
            process.terminate()
            try:
                process.wait(ENDS_S)
            except subprocess.TimeoutExpired:
                process.kill()


@contextmanager
def emulating(folder: Path, text: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Emulate the devices of a config in ``folder/emulated``; yield the process, and the config with its addresses."""
    rig, emulated = folder / "true.toml", folder / "emulated"
    rig.write_text(text, encoding="utf-8")
    with part(folder, "slipd", "emulate", str(rig), "--dir", str(emulated)) as process:
        first_line(process)
        yield process, (emulated / rig.name).read_text(encoding="utf-8")


def first_line(process: subprocess.Popen[str]) -> str:
    """Wait for the first line that a part prints, and return it."""
    assert process.stdout is not None
    line = process.stdout.readline().strip()
    assert line, f"{process.args} ended at its start"
    return line


def endpoints_of(daemon: subprocess.Popen[str]) -> Endpoints:
    """Wait until a daemon serves, which has just been started or told to read its config again."""
    return Endpoints(*(first_line(daemon).partition(": ")[2] for _ in range(2)))


def wait_for(condition: Callable[[], T], patience_s: float = PATIENCE_S) -> T:
    """Wait until something holds, and return it; a busy machine is late, and a request that fails is tried again."""
    until_s = time.monotonic() + patience_s
    while True:
        failed: ClientError | None = None
        try:
            if found := condition():
                return found
        except ClientError as error:
            failed = error
        assert time.monotonic() < until_s, f"it never came: {failed}"
        time.sleep(0.02)
