"""Hostile peers against the real daemon: a short share of ``python -m soak --only peers``."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from bench.child import Child
from project import MODULES
from soak import hostile, peers
from soak.peers import WANTED_MB, Served, memory_kb

pytestmark = pytest.mark.process

CONNECTIONS = 1000
PINGS = b"\x04\x07\x04PING\0\0" * 3
SHORT_S = "0.7"


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    with tempfile.TemporaryDirectory() as name:  # a short path: that of a socket has at most 107 bytes
        monkeypatch.setenv("SLIPD_RUNTIME_DIR", f"{name}/run")
        with peers.daemon(Path(name)) as served:
            yield served


def test_peers_that_ping_and_leave_do_not_end_the_daemon(served: Served) -> None:
    """More messages than were kept of one peer, pings behind them, and gone: libzmq 4.3.5 aborts the process there."""
    request = hostile.request(1)
    sent = {
        "publish": (b"SUB", b"\x00\x03\x01ab" * 250),
        "readings": (b"PUSH", b"\x00\x03abc" * 250),
        "requests": (b"DEALER", (bytes((0, len(request))) + request) * 250),
    }
    for endpoint, (kind, messages) in sent.items():
        for _ in range(CONNECTIONS):
            with contextlib.suppress(OSError), hostile.connected(served.endpoints[endpoint], kind) as peer:
                peer.sendall(messages + PINGS)
            served.process.check()


@pytest.mark.parametrize("kind", [kind for kind in hostile.KINDS if "message" in kind or "stock" in kind])
def test_a_peer_takes_no_memory_to_speak_of(kind: str, served: Served, tmp_path: Path) -> None:
    before_kb = memory_kb(served.process.pid, "VmHWM")
    endpoint = served.endpoints[kind.rpartition(" ")[2] if "message" in kind else "requests"]
    environment = os.environ | {"PYTHONPATH": MODULES}
    with Child([sys.executable, "-m", "soak.hostile", kind, endpoint, SHORT_S], tmp_path, env=environment) as harm:
        harm.told("ready")
        harm.told("done")
    served.process.check()
    assert memory_kb(served.process.pid, "VmHWM") - before_kb < WANTED_MB * 1024
