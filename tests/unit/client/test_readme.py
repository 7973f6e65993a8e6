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

if TYPE_CHECKING:
    from conftest import Daemon, Publisher

EXAMPLES = {
    f"{place}-{number}": code
    for place in ("README.md", "clients/README.md", "docs/clients.md")
    for number, code in enumerate(re.findall(r"```python\n(.*?)```", (ROOT / place).read_text("utf-8"), re.DOTALL))
    if "slipd_client" in code
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_hears_and_steers_until_the_daemon_falls_silent(
    name: str,
    tmp_path: Path,
    publisher: Publisher,
    daemon: Daemon,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path))
    for client in (GripClient, AsyncGripClient):  # a lease that no stall of this machine ends
        monkeypatch.setattr(client.lease.__wrapped__, "__defaults__", (60_000,))
    monkeypatch.setattr("time.sleep", end_instead_of_the_next_try)
    refusal = {"code": "rate", "message": "raise_n_per_s", "field": "delta_n"}
    daemon.handlers["grip.adjust"] = lambda _: {"error": refusal} if "RequestRefused" in code else {}
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
    if "RequestRefused" in code:
        assert "gravity.set" in daemon.ops
        assert "refused, and nothing moved: rate: delta_n: raise_n_per_s" in capsys.readouterr().out


def end_instead_of_the_next_try(_: float) -> None:
    raise Silence("the example ends here")
