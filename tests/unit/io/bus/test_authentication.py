"""Which keys are admitted where, with real sockets and keys, and with a list that fails."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import zmq
from zmq.utils import z85

from slipd.config import Bus
from slipd.errors import LinkError
from slipd.io.bus.authentication import AllowList, guard
from slipd.io.bus.publisher import Publisher
from slipd.io.bus.request_server import RequestServer
from slipd.io.zmtp.endpoint import Access
from slipd_client.keys import Keys, create, load
from slipd_client.messages import decode, encode

if TYPE_CHECKING:
    from zeromq_peers import Context

pytestmark = pytest.mark.usefixtures("loop_faults")

HANDSHAKE_S = 0.3
"""Long enough for any client here that is let in; one that is not is refused for ever."""

ADDRESSES = ("tcp://127.0.0.1:*", "ipc://{0}/{1}")


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
        may = guard(self.bus)
        assert self.bus.publish is not None
        assert self.bus.requests is not None
        publisher = stack.enter_context(Publisher(self.bus.publish, may.publish))

        def answer(client: bytes, body: dict[str, Any]) -> None:
            server.reply(client, {"id": body["id"], "ok": True, "result": {"client": client}})

        server = RequestServer(self.bus.requests, answer, may.requests, requesters=may.requesters)
        stack.enter_context(server)
        return publisher, server


@pytest.fixture(params=ADDRESSES, ids=["tcp", "ipc"])
def cell(request: pytest.FixtureRequest, tmp_path: Path) -> Cell:
    return Cell(tmp_path, request.param)


@pytest.fixture
def connect(clients: Context) -> Iterator[Callable[..., zmq.Socket[bytes]]]:
    opened: list[zmq.Socket[bytes]] = []

    def open_socket(kind: int, endpoint: str, keys: Keys | None = None, **options: int | bytes) -> zmq.Socket[bytes]:
        socket = clients.socket(kind)
        opened.append(socket)
        socket.setsockopt(zmq.LINGER, 0)
        for name, value in options.items():
            socket.setsockopt(getattr(zmq, name), value)
        if keys is not None:
            keys.apply(socket)
        socket.connect(endpoint.replace("0.0.0.0", "127.0.0.1"))
        return socket

    yield open_socket
    for socket in opened:
        socket.close()


Connect = Callable[..., "zmq.Socket[bytes]"]


async def ask(socket: zmq.Socket[bytes], number: str, seconds: float) -> dict[str, Any] | None:
    """Return the reply to one request; None if there was none."""
    socket.send(encode({"v": 1, "id": number, "op": "hello"}))
    try:
        async with asyncio.timeout(seconds):
            while not socket.poll(0):  # noqa: ASYNC110 - another thread fills it
                await asyncio.sleep(0.001)
    except TimeoutError:
        return None
    return decode(socket.recv())


async def hears(publisher: Publisher, socket: zmq.Socket[bytes], seconds: float) -> bool:
    socket.setsockopt(zmq.SUBSCRIBE, b"")
    try:
        async with asyncio.timeout(seconds):
            while not socket.poll(0):
                publisher.publish("status", b"")
                await asyncio.sleep(0.001)
    except TimeoutError:
        return False
    return True


async def test_each_key_is_admitted_only_where_it_is_listed(cell: Cell, connect: Connect) -> None:
    both, reader, requester = (
        cell.client("both", "readers", "requesters"),
        cell.client("reader", "readers"),
        cell.client("requester", "requesters"),
    )
    unknown = cell.client("unknown")
    with ExitStack() as stack:
        publisher, server = cell.serve(stack)
        for keys, may_read, may_request in (
            (both, True, True),
            (reader, True, False),
            (requester, False, True),
            (unknown, False, False),
            (None, False, False),
        ):
            subscriber = connect(zmq.SUB, publisher.endpoint, keys)
            assert await hears(publisher, subscriber, 30 if may_read else HANDSHAKE_S) == may_read, keys
            dealer = connect(zmq.DEALER, server.endpoint, keys)
            reply = await ask(dealer, "7", 30 if keys in (both, reader, requester) else HANDSHAKE_S)
            assert (reply is not None and reply["ok"]) == may_request, keys
            if keys is reader:
                assert reply is not None
                assert (reply["id"], reply["error"]["code"]) == ("7", "read_only")


async def test_Z5_the_name_that_a_client_chose_makes_it_nobody_else(cell: Cell, connect: Connect) -> None:
    victim, thief = cell.client("victim", "requesters"), cell.client("thief", "requesters")
    with ExitStack() as stack:
        _, server = cell.serve(stack)
        first = connect(zmq.DEALER, server.endpoint, victim, ROUTING_ID=b"name")
        reply = await ask(first, "1", 30)
        first.close()
        await asyncio.sleep(0.05)
        stolen = await ask(connect(zmq.DEALER, server.endpoint, thief, ROUTING_ID=b"name"), "2", 30)
    assert reply is not None
    assert stolen is not None
    assert reply["result"]["client"] == victim.public + b"\0name"
    assert stolen["result"]["client"] == thief.public + b"\0name"


class Raising(frozenset[bytes]):
    """A list of keys that fails."""

    def __contains__(self, key: object) -> bool:
        raise ZeroDivisionError("what nobody thought of")


def test_a_key_that_is_not_listed_or_whose_list_fails_is_refused_and_logged(caplog: pytest.LogCaptureFixture) -> None:
    good, unknown = z85.encode(bytes(range(32))), z85.encode(bytes(32))
    assert AllowList("requests", frozenset([good])).admits(good)
    assert caplog.messages == []
    assert not AllowList("requests", frozenset([good])).admits(unknown)
    assert caplog.messages == [f"requests: key {unknown.decode()} is not allowed and was refused"]
    assert not AllowList("requests", Raising([good])).admits(good)
    assert "what nobody thought of" in caplog.text


async def test_a_secret_key_without_a_list_admits_nobody(cell: Cell, connect: Connect) -> None:
    keys = cell.client("robot", "requesters")
    assert cell.bus.requests is not None
    with RequestServer(cell.bus.requests, lambda *_: None, Access(guard(cell.bus).requests.secret)) as server:
        dealer = connect(zmq.DEALER, server.endpoint, keys, IMMEDIATE=1)
        await asyncio.sleep(HANDSHAKE_S)
        assert not dealer.poll(0, zmq.POLLOUT)


def test_a_key_file_that_cannot_be_used_keeps_the_daemon_from_starting(cell: Cell) -> None:
    assert cell.bus.secret_key is not None
    Path(cell.bus.secret_key).chmod(0o644)
    with pytest.raises(LinkError, match="chmod 600"):
        guard(cell.bus)


def test_missing_keys_are_named_with_the_commands_that_create_them(tmp_path: Path) -> None:
    bus = Bus(secret_key=str(tmp_path / "rig.key_secret"), readers=str(tmp_path / "readers"), requesters=str(tmp_path))
    with pytest.raises(LinkError) as error:
        guard(bus)
    assert f"slipctl keys new rig --dir {tmp_path}. For clients of this machine alone, leave [bus] out" in str(
        error.value
    )
    assert f"bus.readers: {tmp_path}/readers does not exist" in str(error.value)
    assert "bus.requesters" not in str(error.value)


def test_without_keys_in_the_config_none_are_asked_for() -> None:
    may = guard(Bus())
    assert (may.publish.secret, may.requests.secret, may.requesters) == (None, None, None)


def test_one_endpoint_may_need_keys_and_the_other_not(cell: Cell) -> None:
    keys = cell.client("reader", "readers")
    may = guard(cell.bus.model_copy(update={"requesters": None}))
    assert may.publish.secret is not None
    assert may.requests.secret is None
    assert may.publish.admits(keys.public)
    assert not may.requests.admits(keys.public)


def test_a_secret_is_not_shown_with_what_it_opens() -> None:
    secret = bytes(range(32))
    assert repr(secret) not in repr(Access(secret))
