from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import zmq

from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.io.transport.push_socket import MAX_MESSAGE_BYTES

if TYPE_CHECKING:
    from conftest import Serving
    from loop_waits import Eventually

Pusher = Callable[[], zmq.Socket[bytes]]


@pytest.fixture
def spec(tmp_path: Path) -> LinkSpec:
    return LinkSpec("left.wrench", "external", f"ipc://{tmp_path}/readings")


@pytest.fixture
def pusher(spec: LinkSpec) -> Iterator[Pusher]:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    all_made = []

    def connect() -> zmq.Socket[bytes]:
        made = context.socket(zmq.PUSH)
        made.setsockopt(zmq.LINGER, 0)
        made.connect(spec.address)
        all_made.append(made)
        return made

    yield connect
    for made in all_made:
        made.close()
    context.term()


def received(events: list[Event]) -> list[bytes]:
    return [event.data for event in events if isinstance(event, Bytes)]


async def test_each_message_is_delivered_as_one_piece(
    spec: LinkSpec, pusher: Pusher, serving: Serving, eventually: Eventually
) -> None:
    sent = [bytes([n % 256]) * n for n in range(500)]
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
        first = pusher()
        for data in sent:
            first.send(data)
        await eventually(lambda: len(received(events)) == len(sent))
        pusher().send(b"of another")
        await eventually(lambda: len(received(events)) > len(sent))
    assert events[0] == LinkUp("left.wrench", spec.address)
    assert received(events) == [*sent, b"of another"]


async def test_a_pusher_that_waits_for_the_daemon_is_read_when_it_comes(
    spec: LinkSpec, pusher: Pusher, serving: Serving, eventually: Eventually
) -> None:
    pusher().send(b"early")
    for _ in range(2):
        async with serving(spec) as (_, events):
            await eventually(lambda: received(events))
        pusher().send(b"between two runs")


async def test_a_message_that_is_too_long_is_refused_and_others_are_delivered(
    spec: LinkSpec, pusher: Pusher, serving: Serving, eventually: Eventually
) -> None:
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
        pusher().send(bytes(MAX_MESSAGE_BYTES + 1))
        pusher().send(bytes(MAX_MESSAGE_BYTES))
        await eventually(lambda: received(events))
    assert [len(data) for data in received(events)] == [MAX_MESSAGE_BYTES]


async def test_of_a_message_in_many_parts_no_more_than_two_are_judged(
    spec: LinkSpec, pusher: Pusher, serving: Serving, eventually: Eventually
) -> None:
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
        push = pusher()
        push.send_multipart([b"part"] * 1000)
        push.send(b"whole")
        await eventually(lambda: b"whole" in received(events))
    assert received(events) == [b"part", b"part", b"whole"]


async def test_a_second_binder_is_refused_and_the_first_is_not_disturbed(
    spec: LinkSpec, pusher: Pusher, serving: Serving, eventually: Eventually
) -> None:
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
        async with serving(spec) as (_, others):
            await eventually(lambda: others)
            assert isinstance(others[0], LinkDown)
            assert "another program serves this endpoint" in others[0].reason
        pusher().send(b"to the first")
        await eventually(lambda: received(events) == [b"to the first"])


async def test_the_end_of_a_link_frees_its_place(spec: LinkSpec, serving: Serving, eventually: Eventually) -> None:
    for _ in range(3):
        async with serving(spec) as (_, events):
            await eventually(lambda: events)
            assert isinstance(events[0], LinkUp)


async def test_a_missing_directory_is_reported(serving: Serving, eventually: Eventually, tmp_path: Path) -> None:
    spec = LinkSpec("left.wrench", "external", f"ipc://{tmp_path}/none/readings")
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
        assert f"there is no directory {tmp_path}/none" in events[0].reason
        (tmp_path / "none").mkdir()
        await eventually(lambda: isinstance(events[-1], LinkUp))


@pytest.fixture
def notes(spec: LinkSpec) -> Iterator[None]:
    file = Path(spec.address.removeprefix("ipc://"))
    file.write_text("not a socket")
    yield
    assert file.read_text() == "not a socket"


@pytest.mark.usefixtures("notes")
async def test_a_file_of_somebody_is_not_deleted(spec: LinkSpec, serving: Serving, eventually: Eventually) -> None:
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
    assert "binding would delete it" in events[0].reason


async def test_a_write_is_refused_and_counted(spec: LinkSpec, serving: Serving, eventually: Eventually) -> None:
    async with serving(spec) as (links, events):
        await eventually(lambda: events)
        assert not links.write("left.wrench", b"zero")
        assert links.refused_writes == {"left.wrench": 1}


async def test_an_exception_of_the_consumer_ends_the_group(
    spec: LinkSpec, pusher: Pusher, serving: Serving, eventually: Eventually
) -> None:
    def fail(event: Event) -> None:
        if type(event) is Bytes:
            raise ArithmeticError("a fault of ours")

    push = pusher()
    for n in range(20):
        push.send(b"%d" % n)
    with pytest.raises(ExceptionGroup) as raised:
        async with serving(spec, on_event=fail) as (_, events):
            await eventually(lambda: False)
    assert [str(error) for error in raised.value.exceptions] == ["a fault of ours"]
    assert received(events) == [b"0"]
