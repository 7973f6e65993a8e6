"""The end of the demo: its summary does not depend on a daemon that still answers."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import zmq

from slipd import demo
from slipd_client.messages import decode, encode


@contextmanager
def refusing(endpoint: str) -> Iterator[None]:
    """Refuse every request as a busy daemon does."""
    ended = threading.Event()

    def serve() -> None:
        with zmq.Context() as context, context.socket(zmq.ROUTER) as router:
            router.setsockopt(zmq.LINGER, 0)
            router.bind(endpoint)
            bound.set()
            while not ended.is_set():
                if router.poll(10):
                    client, data = router.recv_multipart()
                    error = {"code": "busy", "message": "too many requests", "field": None}
                    reply = {"v": 1, "id": decode(data)["id"], "t_ns": 1, "ok": False, "error": error}
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
