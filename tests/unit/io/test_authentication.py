"""Which keys are admitted where, with real sockets and keys."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import zmq
from loop_waits import PATIENCE_S, eventually
from zeromq_peers import Clients, Peer

from slipd.config import Bus
from slipd.errors import LinkError
from slipd.io.access import guard
from slipd.io.publisher import Publisher
from slipd.io.request_server import RequestServer
from slipd.io.zmtp.endpoint import Access
from slipd_client.keys import Keys, create, load
from slipd_client.messages import decode, encode

pytestmark = pytest.mark.usefixtures("loop_faults")

HANDSHAKE_S = 0.3
"""Long enough for any client here that is let in; one that is not is refused for ever."""


class Cell:
    """A bus that needs keys, and the keys of its clients."""

    def __init__(self, folder: Path, address: str) -> None:
        self.folder = folder
        for name in ("readers", "requesters", "keys"):
            (folder / name).mkdir()
        self.server_public, secret = create("server", folder / "keys")
        self.bus = Bus(
            publish=address.format(folder, "p"),
            requests=address.format(folder, "r"),
            secret_key=str(secret),
            readers=str(folder / "readers"),
            requesters=str(folder / "requesters"),
        )

    def client(self, name: str, *lists: str) -> Keys:
        public, secret = create(name, self.folder / "keys")
        for each in lists:
            (self.folder / each / public.name).write_bytes(public.read_bytes())
        return load(secret, self.server_public)

    def serve(self, stack: ExitStack) -> tuple[Publisher, RequestServer]:
        def answer(client: bytes, body: dict[str, Any]) -> None:
            server.reply(client, {"id": body["id"], "ok": True, "result": {"client": client}})

        may = guard(self.bus)
        server = RequestServer(str(self.bus.requests), answer, may.requests, requesters=may.requesters)
        return stack.enter_context(Publisher(str(self.bus.publish), may.publish)), stack.enter_context(server)


@pytest.fixture(params=["tcp://127.0.0.1:*", "ipc://{0}/{1}"], ids=["tcp", "ipc"])
def cell(request: pytest.FixtureRequest, tmp_path: Path) -> Cell:
    return Cell(tmp_path, request.param)


async def happens(condition: Callable[[], object], *, expected: bool) -> bool:
    """Wait for a condition, and long enough if it is not expected."""
    try:
        async with asyncio.timeout(PATIENCE_S if expected else HANDSHAKE_S):
            await eventually(condition)
    except TimeoutError:
        return False
    return True


async def ask(client: Peer, *, expected: bool = True) -> dict[str, Any] | None:
    """Return the reply to one request; None if there was none."""
    client.socket.send(encode({"v": 1, "id": "7", "op": "hello"}))
    return decode(client.got[0][0]) if await happens(lambda: client.got, expected=expected) else None


async def test_each_key_is_admitted_only_where_it_is_listed_and_a_refused_one_is_logged(
    cell: Cell, peer: Clients, caplog: pytest.LogCaptureFixture
) -> None:
    both, reader = cell.client("both", "readers", "requesters"), cell.client("reader", "readers")
    requester, unknown = cell.client("requester", "requesters"), cell.client("unknown")
    with ExitStack() as stack:
        publisher, server = cell.serve(stack)
        for keys, may_read, answer in (
            (both, True, "ok"),
            (reader, True, "read_only"),
            (requester, False, "ok"),
            (unknown, False, None),
            (None, False, None),
        ):
            subscriber = peer(zmq.SUB, publisher.endpoint, keys, SUBSCRIBE=b"")
            assert may_read == await happens(
                lambda: publisher.publish("status", b"") or subscriber.got,  # noqa: B023
                expected=may_read,
            )
            reply = await ask(peer(zmq.DEALER, server.endpoint, keys), expected=answer is not None)
            assert answer == (reply and reply.get("error", {"code": "ok"})["code"])
    assert f" ended: key {unknown.public.decode()} is not allowed" in caplog.text


async def test_Z5_the_name_that_a_client_chose_makes_it_nobody_else(cell: Cell, peer: Clients) -> None:
    victim, thief = cell.client("victim", "requesters"), cell.client("thief", "requesters")
    told = []
    with ExitStack() as stack:
        _, server = cell.serve(stack)
        for keys in (victim, thief):
            client = peer(zmq.DEALER, server.endpoint, keys, ROUTING_ID=b"name")
            reply = await ask(client)
            assert reply is not None
            told.append(reply["result"]["client"])
            client.socket.close()
            await eventually(lambda: not server.peers)
    assert told == [victim.public + b"\0name", thief.public + b"\0name"]


async def test_a_secret_key_without_a_list_admits_nobody(cell: Cell, peer: Clients) -> None:
    keys = cell.client("robot", "requesters")
    with RequestServer(str(cell.bus.requests), print, Access(secret=guard(cell.bus).requests.secret)) as server:
        client = peer(zmq.DEALER, server.endpoint, keys, IMMEDIATE=1)
        assert not await happens(client.can_send, expected=False)


def test_a_key_file_that_cannot_be_used_keeps_the_daemon_from_starting(cell: Cell) -> None:
    Path(str(cell.bus.secret_key)).chmod(0o644)
    with pytest.raises(LinkError, match="chmod 600"):
        guard(cell.bus)


def test_missing_keys_are_named_with_the_commands_that_create_them(tmp_path: Path) -> None:
    bus = Bus(secret_key=str(tmp_path / "rig.key_secret"), readers=str(tmp_path / "readers"), requesters=str(tmp_path))
    with pytest.raises(LinkError, match=r"slipctl keys new rig --dir .* leave \[bus\] out") as error:
        guard(bus)
    missing = [text.partition(" does not exist")[0] for text in str(error.value).split("; ")]
    assert missing == [f"bus.secret_key: {bus.secret_key}", f"bus.readers: {bus.readers}"]


def test_each_endpoint_needs_keys_only_if_it_has_a_list(cell: Cell) -> None:
    may = guard(Bus())
    assert (may.publish.secret, may.requests.secret, may.requesters) == (None, None, None)
    public = cell.client("reader", "readers").public
    may = guard(cell.bus.model_copy(update={"requesters": None}))
    assert (may.publish.keys, may.requests.keys) == ({public}, frozenset())
    assert may.publish.secret is not None
    assert may.requests.secret is None


def test_a_secret_is_not_shown_with_what_it_opens() -> None:
    secret = bytes(range(32))
    assert repr(secret) not in repr(Access(secret=secret))
