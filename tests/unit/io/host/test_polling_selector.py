from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from selectors import EVENT_READ

import pytest

from slipd.io.host.polling_selector import PollingSelector

BYTES = 60


@pytest.fixture(params=[False, True], ids=["sleeps", "polls"])
def selector(request: pytest.FixtureRequest) -> Iterator[PollingSelector]:
    with PollingSelector() as made:
        made.polls = request.param
        yield made


@pytest.fixture
def pipe(selector: PollingSelector) -> Iterator[tuple[int, int]]:
    reading, writing = os.pipe()
    selector.register(reading, EVENT_READ)
    yield reading, writing
    os.close(reading)
    os.close(writing)


@pytest.mark.parametrize("timeout_s", [None, 30.0])
def test_every_event_of_another_thread_ends_a_wait(
    selector: PollingSelector, pipe: tuple[int, int], timeout_s: float | None
) -> None:
    reading, writing = pipe

    def feed() -> None:
        for _ in range(BYTES):
            time.sleep(0.001)
            os.write(writing, b"x")

    thread = threading.Thread(target=feed)
    thread.start()
    got = 0
    while got < BYTES:
        [(key, events)] = selector.select(timeout_s)
        assert (key.fd, events) == (reading, EVENT_READ)
        got += len(os.read(reading, BYTES))
    thread.join()
    assert selector.select(0) == []


@pytest.mark.parametrize("timeout_s", [-1.0, 0.0, 0.02])
def test_a_wait_without_an_event_lasts_as_long_as_it_may(
    selector: PollingSelector, pipe: tuple[int, int], timeout_s: float
) -> None:
    before_s = time.monotonic()
    assert selector.select(timeout_s) == []
    assert time.monotonic() - before_s >= timeout_s
