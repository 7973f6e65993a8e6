"""The examples for people run as they stand."""

from __future__ import annotations

import contextlib
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from client_peers import Daemon, Publisher, refuse
from project import ROOT

from slipd_client.errors import Silence
from slipd_client.subscriber import SubscriberBase

EXAMPLES = {
    f"{place}-{number}": code
    for place in ("README.md", "clients/README.md", "docs/clients.md")
    for number, code in enumerate(re.findall(r"```python\n(.*?)```", (ROOT / place).read_text("utf-8"), re.DOTALL))
    if "slipd_client" in code
}


def end(*_: object) -> None:
    """End an example where it would try again, and not by the silence of three seconds."""
    raise Silence("the example ends here")


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_hears_and_steers_until_the_daemon_falls_silent(
    name: str,
    tmp_path: Path,
    publisher: Publisher,
    daemon: Daemon,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    accept = SubscriberBase._accept
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr("time.sleep", end)
    monkeypatch.setattr(SubscriberBase, "_accept", lambda *of: end() if of[1][0] == b"status" else accept(*of))
    code = EXAMPLES[name]
    if "RequestRefused" in code:
        daemon.handlers["grip.adjust"] = refuse("rate", "raise_n_per_s", "delta_n")

    def send() -> None:
        publisher.wait_for(b"status")
        publisher.send("slip.left", 1, level="warning")
        publisher.send("warning", 1, level="warning", previous="stable", rising=True, reasons=["rotation"])
        publisher.send("status", 1)

    with ThreadPoolExecutor() as threads, contextlib.suppress(Silence):
        if "Subscriber" in code:
            threads.submit(send)
        exec(compile(code, name, "exec"), {"__name__": "example"})
    assert ("adjust" in code) <= ("grip.adjust" in daemon.ops)
    if "RequestRefused" in code:
        assert "gravity.set" in daemon.ops
        assert "refused, and nothing moved: rate: delta_n: raise_n_per_s" in capsys.readouterr().out
