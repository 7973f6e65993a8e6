"""Progress of a listener: connections that are greeted, and messages for clients that read."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from typing import TYPE_CHECKING

import pytest

from slipd.io.zmtp.listener import Listener
from slipd.io.zmtp.listener_progress import ListenerProgress
from slipd.io.zmtp.peer_rules import PeerRules
from slipd.io.zmtp.wire import COMMAND, encode_command, encode_frame, encode_greeting, encode_metadata

if TYPE_CHECKING:
    from loop_waits import Eventually

pytestmark = pytest.mark.usefixtures("loop_faults")

PATIENCE_S = 30.0
READY = encode_command(b"READY", encode_metadata({b"Socket-Type": b"SUB"}))
INTRODUCTION = encode_greeting(b"NULL", as_server=False) + encode_frame(READY, COMMAND)
RULES = PeerRules(kind=b"XPUB", serves=frozenset({b"SUB"}), max_bytes=100, most_queued=1000, drops_oldest=True)


class Stalled:
    """A listener, and a client for which more messages wait than the kernel takes."""

    def __init__(self, listener: Listener, client: socket.socket) -> None:
        self.client, self.progress = client, ListenerProgress(listener)
        (self.peer,) = listener.peers

    async def look(self) -> str:
        return await self.progress.stall(PATIENCE_S)

    def read_all(self) -> None:
        """Read what the kernel has."""
        try:
            while self.client.recv(65536):
                pass
        except BlockingIOError:
            pass


@pytest.fixture
async def stalled(endpoint: str, eventually: Eventually) -> AsyncIterator[Stalled]:
    listener = Listener(endpoint, RULES, lambda *_: None)
    with listener, socket.socket(socket.AF_UNIX) as client:
        client.connect(endpoint.removeprefix("ipc://"))
        client.sendall(INTRODUCTION)
        client.setblocking(False)
        await eventually(lambda: listener.peers)
        found = Stalled(listener, client)
        for _ in range(900):
            found.peer.send((bytes(50_000),))
        assert found.peer.waiting > 500
        yield found


async def test_P2_a_client_that_does_not_read_is_no_stall(stalled: Stalled) -> None:
    assert [await stalled.look() for _ in range(3)] == [""] * 3


async def test_P2_a_client_that_reads_is_no_stall_while_messages_wait(stalled: Stalled) -> None:
    for _ in range(5):
        stalled.read_all()
        assert not await stalled.look()
    assert stalled.peer.waiting


async def test_P2_messages_that_are_not_sent_to_a_client_that_reads_are_a_stall(
    stalled: Stalled, eventually: Eventually
) -> None:
    loop = asyncio.get_running_loop()
    loop.remove_writer(stalled.peer.fileno)
    stalled.read_all()
    assert [await stalled.look(), await stalled.look()] == ["", "messages are not sent to clients that read (1)"]
    loop.add_writer(stalled.peer.fileno, stalled.peer.flush)
    sent_bytes = stalled.peer.sent_bytes
    await eventually(lambda: stalled.peer.sent_bytes > sent_bytes)
    assert not await stalled.look()


async def test_P2_a_greeting_that_is_late_is_no_stall_while_connections_are_accepted(stalled: Stalled) -> None:
    assert not await stalled.progress.stall(0.0)
