"""Datagrams, addresses, the inquiry before a link, and what is special of a TCP port (test_streams has the rest)."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Iterator

import pytest
from link_ends import TcpDevice, downs, kinds, pieces, received, serving
from loop_waits import PATIENCE_S, eventually

from slipd.devices import Inquiry
from slipd.errors import LinkError
from slipd.events import Bytes, LinkDown, LinkSpec, LinkUp
from slipd.io.transport import link, sockets
from slipd.io.transport.link import MAX_REPLY_BYTES, inquire
from slipd.io.transport.link_connection import READ_BYTES
from slipd.io.transport.sockets import MAX_DATAGRAM_BYTES

pytestmark = pytest.mark.usefixtures("loop_faults")


@pytest.mark.parametrize("far", ["tcp"], indirect=True)
async def test_commands_leave_at_once_and_a_cut_cable_is_noticed(far: TcpDevice) -> None:
    connection = await sockets.open_tcp(far.spec, print)
    opened = connection._opened
    idle_s, probe_s, probes, unsent_ms, at_once = (
        opened.getsockopt(socket.IPPROTO_TCP, option)
        for option in (
            *(socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT),
            *(socket.TCP_USER_TIMEOUT, socket.TCP_NODELAY),
        )
    )
    assert (at_once, opened.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)) == (1, 1)
    assert idle_s + probe_s * probes <= 3
    assert unsent_ms <= 3000
    await connection.close()


async def test_a_device_that_does_not_answer_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sockets, "OPEN_TIMEOUT_S", 0.05)
    with socket.socket() as server, socket.socket() as queued, socket.socket() as queued_too:
        server.bind(("127.0.0.1", 0))
        server.listen(0)  # one visitor fills the queue, and the next is not answered
        queued.connect(server.getsockname())
        queued_too.setblocking(False)
        queued_too.connect_ex(server.getsockname())
        spec = LinkSpec("left.pad", "tcp", f"tcp://127.0.0.1:{server.getsockname()[1]}")
        async with serving(spec) as (_, events):
            assert "no answer within" in downs(events)[0]


class Sensor:
    """A datagram socket that answers the last sender."""

    def __init__(self, host: str) -> None:
        self.socket = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind((host, 0))
        self.socket.setblocking(False)
        self.heard: list[bytes] = []
        shown = f"[{host}]" if ":" in host else host
        self.spec = LinkSpec("left.wrench", "udp", f"udp://{shown}:{self.socket.getsockname()[1]}")

    def hears(self) -> list[bytes]:
        with contextlib.suppress(BlockingIOError):
            while True:
                data, self.peer = self.socket.recvfrom(2000)
                self.heard.append(data)
        return self.heard

    def send(self, data: bytes) -> None:
        self.socket.sendto(data, self.peer)


@pytest.fixture
def sensor(request: pytest.FixtureRequest) -> Iterator[Sensor]:
    try:
        sensor = Sensor(getattr(request, "param", "127.0.0.1"))
    except OSError as error:
        pytest.skip(f"no IPv6 here: {error}")
    yield sensor
    sensor.socket.close()


@pytest.mark.parametrize("sensor", ["127.0.0.1", "::1"], indirect=True)
async def test_each_datagram_is_one_piece_in_order_both_ways(sensor: Sensor) -> None:
    """Of a very long one only the beginning is delivered, and those of other senders are ignored."""
    sent = [b"", b"x", *(bytes([n % 256]) * n for n in range(1, 300)), bytes(MAX_DATAGRAM_BYTES)]
    async with serving(sensor.spec) as (links, events):
        assert links.write("left.wrench", b"one")
        assert links.write("left.wrench", b"two")
        await eventually(lambda: sensor.hears() == [b"one", b"two"])
        with socket.socket(sensor.socket.family, socket.SOCK_DGRAM) as stranger:
            stranger.sendto(b"not yours", sensor.peer)
        for data in [*sent, bytes(65_000), b"end"]:
            sensor.send(data)
        await eventually(lambda: pieces(events)[-1:] == [b"end"])
    assert events[0] == LinkUp("left.wrench", sensor.spec.address)
    assert pieces(events) == [*sent, bytes(MAX_DATAGRAM_BYTES), b"end"]


async def test_a_host_without_a_listener_is_reported_and_tried_again(sensor: Sensor) -> None:
    """A connected socket holds the port, so that no other program gets it, and receives nothing from the daemon."""
    sensor.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    sensor.socket.connect(sensor.socket.getsockname())
    async with serving(sensor.spec) as (links, events):
        links.write("left.wrench", b"start")
        await eventually(lambda: downs(events))
        assert "nothing listens on this port" in downs(events)[0]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as back:
            back.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            back.bind(sensor.socket.getsockname())
            back.settimeout(PATIENCE_S)
            await eventually(lambda: links.write("left.wrench", b"start"))
            assert back.recv(100) == b"start"


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("udp://", "no host; a valid one is udp://192.168.1.1:49152"),
        ("udp://127.0.0.1", "no port from 1 to 65535"),
        ("tcp://127.0.0.1:1", "cannot be reached (Connect call failed"),  # nothing listens there
        ("udp://127.0.0.1:70000", "not an address"),
        ("udp://[::1:80", "not an address"),
        ("udp://[fe80::1%no-such-interface]:49152", "cannot be reached"),  # which no name server is asked for
        ("udp://a..b:49152", "not an address"),
        (f"udp://{64 * 'a'}:49152", "not an address"),
    ],
)
async def test_an_address_that_cannot_be_reached_is_reported(address: str, words: str) -> None:
    async with serving(LinkSpec("left.wrench", address[:3], address)) as (_, events):
        assert kinds(events) == [LinkDown]
    assert downs(events)[0].startswith(f"{address}: ")
    assert words in downs(events)[0]


async def test_L9_what_the_kernel_drops_is_counted_over_all_connections(sensor: Sensor, quick: None) -> None:
    """A write that is longer than a datagram ends a connection."""
    async with serving(sensor.spec) as (links, events):
        links.write("left.wrench", b"start")
        await eventually(sensor.hears)
        for _ in range(20_000):  # the loop does not read meanwhile
            sensor.send(b"flood")
        await eventually(lambda: len(pieces(events)) + links.losses["left.wrench"][1] == 20_000)
        dropped = links.losses["left.wrench"][1]
        assert dropped > 0
        assert not links.write("left.wrench", bytes(70_000))
        await eventually(lambda: kinds(events)[-1] is LinkUp)
        assert "too long" in downs(events)[0]
        assert links.losses["left.wrench"][1] == dropped


async def test_L9_a_flood_leaves_the_loop_its_turn(sensor: Sensor) -> None:
    async with serving(sensor.spec) as (links, events):
        links.write("left.wrench", b"start")
        await eventually(sensor.hears)
        for size in (0, 128, 1500):
            for _ in range(100):
                sensor.send(bytes(size))
            before, most = len(events), 0
            while len(events) < before + 100:
                now = len(events)
                await asyncio.sleep(0)  # one turn of the loop
                most = max(most, len(events) - now)
            assert most <= min(sockets.DATAGRAMS_PER_WAKE, -(-READ_BYTES // max(size, 1)))


async def test_a_kernel_that_does_not_count_drops_is_borne(sensor: Sensor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sockets, "SO_MEMINFO", 9999)
    connection = await sockets.open_udp(sensor.spec, print)
    assert connection.overruns == 0
    await connection.close()


QUESTION = b"how many counts are a newton?"


@contextlib.asynccontextmanager
async def host(*answers: bytes, hangs_up: bool = True) -> AsyncIterator[tuple[int, list[bytes]]]:
    """Answer each connection in turn, in two pieces; yield the port and what was asked."""
    asked: list[bytes] = []
    met: list[asyncio.Task[None] | None] = []
    left = iter(answers)

    async def meet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        met.append(asyncio.current_task())
        with contextlib.suppress(ConnectionError):
            asked.append(await reader.read(100))
            answer = next(left, b"")
            for piece in (answer[:3], answer[3:]):
                writer.write(piece)
                await asyncio.sleep(0.001)
            if not hangs_up:
                await reader.read()
        writer.close()

    async with await asyncio.start_server(meet, "127.0.0.1", 0) as server:
        yield server.sockets[0].getsockname()[1], asked
    await asyncio.wait([task for task in met if task is not None])


@pytest.mark.parametrize(
    ("answer", "reply_bytes", "hangs_up", "fault"),
    [
        (b"one million", 11, False, ""),
        (b"<xml>1000000</xml>", 0, True, ""),
        (bytes(MAX_REPLY_BYTES), 0, True, ""),
        (b"one", 11, True, "the answer must have 11 bytes, got 3"),
        (b"", 0, True, "without an answer"),
        (bytes(MAX_REPLY_BYTES + 1), 0, True, "more than 65536 bytes"),
        (b"on", 11, False, "no answer within 0.05 s"),
    ],
)
async def test_an_answer_ends_at_its_length_or_with_the_connection_or_is_refused(
    answer: bytes, reply_bytes: int, hangs_up: bool, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link, "INQUIRY_TIMEOUT_S", 0.05 if fault.startswith("no answer") else PATIENCE_S)
    async with host(answer, hangs_up=hangs_up) as (port, asked):
        refused = pytest.raises(LinkError, match=f"TCP port {port} failed: .*{fault}; switch the device on")
        with refused if fault else contextlib.nullcontext():
            assert await inquire("udp://localhost:1", Inquiry(port, QUESTION, reply_bytes)) == answer
            assert asked == [QUESTION]


async def test_a_host_without_the_port_is_refused(unused_tcp_port: int) -> None:
    with pytest.raises(LinkError, match="inquiry on TCP port"):
        await inquire("udp://127.0.0.1:1", Inquiry(unused_tcp_port, QUESTION, 11))


async def test_a_link_stays_down_and_asks_again_until_the_answer_is_right_and_delivers_that_first(quick: None) -> None:
    def check(answer: bytes) -> str:
        return "" if answer == b"well" else f"{answer.decode()}, it says" if answer != b"boom" else [][1]

    async with host(b"bus", b"busy", b"boom", b"well") as (port, asked):
        spec = LinkSpec("left.wrench", "udp", "udp://127.0.0.1:9", inquiry=Inquiry(port, QUESTION, 4, check))
        async with serving(spec) as (_, events):
            await eventually(lambda: len(events) == 5)
    assert kinds(events) == [LinkDown, LinkDown, LinkDown, LinkUp, Bytes]
    faults = ("must have 4 bytes", "busy, it says; switch the device on", "IndexError")
    assert [fault in reason for fault, reason in zip(faults, downs(events), strict=True)] == [True] * 3
    assert (received(events), asked) == (b"well", [QUESTION] * 4)


@pytest.mark.parametrize(
    ("answers", "newest"),
    [
        ([b"slow", b"ok", b"fast"], b"fast"),
        ([b"slow", b"", b"fast"], b"fast"),
        ([b"slow", b"refused", b"slow"], b"slow"),
        ([b"slow", b"ok", b""], b"slow"),
        ([b"fast"], b"fast"),
    ],
)
async def test_a_change_is_made_before_the_link_is_up_and_the_newest_answer_counts(
    answers: list[bytes], newest: bytes
) -> None:
    async with host(*answers) as (port, asked):
        inquiry = Inquiry(port, QUESTION, 0, change=lambda answer: b"be fast" if answer == b"slow" else b"")
        assert await inquire("udp://127.0.0.1:1", inquiry) == newest
    assert asked == [QUESTION, b"be fast", QUESTION][: len(answers)]
