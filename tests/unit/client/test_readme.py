"""The examples for people run as they stand."""

from __future__ import annotations

import contextlib
import re
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from project import ROOT

from slipd_client.aio import AsyncGripClient
from slipd_client.errors import Silence
from slipd_client.grip import GripClient
from slipd_client.subscriber import SubscriberBase

if TYPE_CHECKING:
    from conftest import Daemon, Publisher

EXAMPLES = {
    f"{place}-{number}": code
    for place in ("README.md", "clients/README.md")
    for number, code in enumerate(re.findall(r"```python\n(.*?)```", (ROOT / place).read_text("utf-8"), re.DOTALL))
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_hears_and_steers_until_the_daemon_falls_silent(
    name: str, tmp_path: Path, publisher: Publisher, daemon: Daemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setitem(SubscriberBase.__init__.__kwdefaults__, "silence_s", 1.0)
    for client in (GripClient, AsyncGripClient):  # a lease that no stall of this machine ends
        monkeypatch.setattr(client.lease.__wrapped__, "__defaults__", (60_000,))
    code = EXAMPLES[name]

    def send() -> None:
        publisher.wait_for_subscriber()
        publisher.wait_for_subscriber()
        publisher.send("slip.left", 1, level="warning")
        publisher.send("warning", 1, level="warning", previous="stable", rising=True, reasons=["rotation"])

    thread = threading.Thread(target=send)
    if "Subscriber" in code:
        thread.start()
    with contextlib.suppress(Silence):
        exec(compile(code, name, "exec"), {"__name__": "example"})
    if "Subscriber" in code:
        thread.join()
    if "adjust" in code:
        assert "grip.adjust" in daemon.ops
