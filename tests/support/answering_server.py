"""A request server that answers every request with its own body, and clients of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest
import zmq

from slipd.io.bus.request_server import RequestServer
from slipd.io.zmtp.endpoint import USER_ALONE, Access
from slipd_client.messages import PROTOCOL_VERSION, decode, encode

if TYPE_CHECKING:
    from loop_waits import Eventually
    from zeromq_peers import Peer


HELLO = {"v": 1, "id": "1", "op": "hello"}


class Answering:
    """Answer every request with its own body."""

    def __init__(self, endpoint: str, access: Access = USER_ALONE, per_second: float = 1e6) -> None:
        self.requests: list[dict[str, Any]] = []
        self.clients: list[bytes] = []
        self.server = RequestServer(endpoint, self._on_request, access, per_second=per_second)

    def _on_request(self, client: bytes, body: dict[str, Any]) -> None:
        self.requests.append(body)
        self.clients.append(client)
        self.server.reply(client, {"v": PROTOCOL_VERSION, "id": body.get("id"), "ok": True, "result": {}})


@pytest.fixture
def answering(endpoint: str) -> Answering:
    return Answering(endpoint)


@pytest.fixture
def dealer(peer: Callable[..., Peer], endpoint: str) -> Callable[..., Peer]:
    return lambda **options: peer(zmq.DEALER, endpoint, **options)


def replies(client: Peer) -> list[dict[str, Any]]:
    return [decode(b"".join(frames)) for frames in client.got]


async def expect_service(client: Peer, eventually: Eventually) -> None:
    client.got.clear()
    client.socket.send(encode(HELLO | {"id": "still there?"}))
    await eventually(lambda: any(reply["id"] == "still there?" for reply in replies(client)))
