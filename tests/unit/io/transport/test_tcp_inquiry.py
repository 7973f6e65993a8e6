from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

import pytest

from slipd.devices import Inquiry
from slipd.errors import LinkError
from slipd.events import Bytes, LinkDown, LinkSpec, LinkUp
from slipd.io.transport import tcp_inquiry
from slipd.io.transport.tcp_inquiry import MAX_REPLY_BYTES, inquire

if TYPE_CHECKING:
    from conftest import Serving
    from loop_waits import Eventually

QUESTION = b"how many counts are a newton?"


@asynccontextmanager
async def host(*answer: bytes, hangs_up: bool = True) -> AsyncIterator[int]:
    """Answer the request in pieces; yield the port."""

    met: list[asyncio.Task[None] | None] = []

    async def meet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        met.append(asyncio.current_task())
        with contextlib.suppress(ConnectionError):
            assert await reader.readexactly(len(QUESTION)) == QUESTION
            for piece in answer:
                writer.write(piece)
                await asyncio.sleep(0.001)
            if not hangs_up:
                await reader.read()
        writer.close()

    server = await asyncio.start_server(meet, "127.0.0.1", 0)
    async with server:
        yield server.sockets[0].getsockname()[1]
    await asyncio.wait([task for task in met if task is not None])


async def test_an_answer_in_pieces_is_whole() -> None:
    async with host(b"one ", b"million", hangs_up=False) as port:
        assert await inquire("udp://127.0.0.1:1", Inquiry(port, QUESTION, 11)) == b"one million"


async def test_an_answer_may_end_with_the_connection() -> None:
    async with host(b"<xml>", b"1000000", b"</xml>") as port:
        assert await inquire("udp://localhost:1", Inquiry(port, QUESTION, 0)) == b"<xml>1000000</xml>"


async def why_not(port: int, reply_bytes: int) -> str:
    with pytest.raises(LinkError) as raised:
        await inquire("udp://127.0.0.1:1", Inquiry(port, QUESTION, reply_bytes))
    assert "switch the device on" in str(raised.value)
    assert f"TCP port {port}" in str(raised.value)
    return str(raised.value)


async def test_a_truncated_answer_is_refused() -> None:
    async with host(b"one") as port:
        assert "the answer must have 11 bytes, got 3" in await why_not(port, 11)


async def test_an_empty_answer_is_refused() -> None:
    async with host() as port:
        assert "without an answer" in await why_not(port, 0)


async def test_an_answer_beyond_all_measure_is_refused() -> None:
    async with host(bytes(MAX_REPLY_BYTES)) as port:
        assert len(await inquire("udp://127.0.0.1:1", Inquiry(port, QUESTION, 0))) == MAX_REPLY_BYTES
    async with host(bytes(MAX_REPLY_BYTES + 1)) as port:
        assert "more than" in await why_not(port, 0)


async def test_a_closed_port_is_reported(unused_tcp_port: int) -> None:
    assert "inquiry on TCP port" in await why_not(unused_tcp_port, 11)


async def test_a_host_that_never_answers_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tcp_inquiry, "TIMEOUT_S", 0.05)
    async with host(b"on", hangs_up=False) as port:
        assert "no answer within 0.05 s" in await why_not(port, 11)


async def test_an_answer_that_its_check_refuses_is_asked_for_again(
    serving: Serving, eventually: Eventually, quick: None
) -> None:
    def check(answer: bytes) -> str:
        return "" if answer == b"well" else f"{answer.decode()}, it says" if answer != b"boom" else [][1]

    answers = [b"busy", b"boom", b"well"]

    async def meet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readexactly(len(QUESTION))
        writer.write(answers.pop(0))
        writer.close()

    async with await asyncio.start_server(meet, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        spec = LinkSpec("left.wrench", "udp", "udp://127.0.0.1:9", inquiry=Inquiry(port, QUESTION, 4, check))
        async with serving(spec) as (_, events):
            await eventually(lambda: len(events) == 4)
    assert [type(event) for event in events] == [LinkDown, LinkDown, LinkUp, Bytes]
    assert "busy, it says; switch the device on" in events[0].reason
    assert "IndexError" in events[1].reason


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
    asked: list[bytes] = []
    wanted = [QUESTION, b"be fast", QUESTION][: len(answers)]

    async def meet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        asked.append(await reader.read(100))
        writer.write(answers.pop(0))
        writer.close()

    async with await asyncio.start_server(meet, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        inquiry = Inquiry(port, QUESTION, 0, change=lambda answer: b"be fast" if answer == b"slow" else b"")
        assert await inquire("udp://127.0.0.1:1", inquiry) == newest
    assert asked == wanted


async def test_the_answer_is_the_first_that_a_link_hands_on(serving: Serving, eventually: Eventually) -> None:
    async with host(b"one million", hangs_up=False) as port:
        spec = LinkSpec("left.wrench", "udp", "udp://127.0.0.1:9", inquiry=Inquiry(port, QUESTION, 11))
        async with serving(spec) as (_, events):
            await eventually(lambda: len(events) == 2)
    assert events == [LinkUp("left.wrench", spec.address), Bytes("left.wrench", b"one million")]


async def test_a_link_whose_question_is_not_answered_stays_down_and_asks_again(
    serving: Serving, eventually: Eventually, quick: None
) -> None:
    answers = [[b"one"], [b"one"], [b"one million"]]
    asked: list[bytes] = []

    async def meet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        asked.append(await reader.readexactly(len(QUESTION)))
        writer.writelines(answers.pop(0))
        writer.close()

    async with await asyncio.start_server(meet, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        spec = LinkSpec("left.wrench", "udp", "udp://127.0.0.1:9", inquiry=Inquiry(port, QUESTION, 11))
        async with serving(spec) as (_, events):
            await eventually(lambda: len(events) == 3)
    assert [type(event) for event in events] == [LinkDown, LinkUp, Bytes]
    assert asked == [QUESTION] * 3
