"""The end of the demo: its summary does not depend on a daemon that still answers."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zmq

from slipd import demo
from slipd_client.messages import decode, encode

STREAMS = {"left.wrench": {"health": 0, "samples": 9, "bad": 0, "lost": 0}}


@contextmanager
def refusing(endpoint: str, most: float = math.inf) -> Iterator[None]:
    """Refuse every request as a busy daemon does, but grant those after some."""
    ended = threading.Event()

    def serve() -> None:
        refused = 0
        with zmq.Context() as context, context.socket(zmq.ROUTER) as router:
            router.setsockopt(zmq.LINGER, 0)
            router.bind(endpoint)
            bound.set()
            while not ended.is_set():
                if router.poll(10):
                    client, data = router.recv_multipart()
                    error = {"code": "busy", "message": "too many requests", "field": None}
                    reply: dict[str, Any] = {"v": 1, "id": decode(data)["id"], "t_ns": 1}
                    refused += 1
                    if refused <= most:
                        reply |= {"ok": False, "error": error}
                    else:
                        reply |= {"ok": True, "result": {"boot": "b", "t_ns": time.monotonic_ns(), "streams": STREAMS}}
                    router.send_multipart([client, encode(reply)])

    bound = threading.Event()
    thread = threading.Thread(target=serve)
    thread.start()
    bound.wait()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def test_a_daemon_that_refuses_its_status_at_the_end_costs_the_streams_of_the_summary_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    endpoint = f"ipc://{tmp_path}/requests"
    with refusing(endpoint):
        assert demo._final_streams(endpoint) == {}
    assert "the daemon does not report its status at the end: busy: too many requests" in capsys.readouterr().err


def test_a_status_that_is_refused_once_is_asked_for_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    endpoint = f"ipc://{tmp_path}/requests"
    with refusing(endpoint, most=1):
        assert demo._final_streams(endpoint) == STREAMS
    assert capsys.readouterr().err == ""
