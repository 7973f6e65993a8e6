"""No test of this room depends on how long a thread or process of it stands still."""

from __future__ import annotations

import pytest
from loop_waits import PATIENCE_S, loop_faults
from zeromq_peers import clients, endpoint, peer, plain

__all__ = ["clients", "endpoint", "loop_faults", "peer", "plain"]  # fixtures

PATIENT = (
    "transport.sockets.OPEN_TIMEOUT_S",
    "transport.link.INQUIRY_TIMEOUT_S",
    "transport.websocket.OPEN_TIMEOUT_S",
    "zmtp.listener.HANDSHAKE_S",
    "run_signals.READ_LIMIT_S",
)


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give every peer as long as the test waits; a test of a limit sets its own."""
    for name in PATIENT:
        monkeypatch.setattr(f"slipd.io.{name}", PATIENCE_S)
