"""The end of the demo: its summary needs no daemon that still answers, and says where the machine was too busy."""

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

from slipd.tools import demo
from slipd.tools.demo_summary import Tally, print_summary
from slipd.tools.sim.robot_program import Change, Report
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


BEGIN: dict[str, Any] = {"t_s": 0.0, "t_ns": 0, "event": "begin"}
HOLD: dict[str, Any] = {"t_s": 10.0, "t_ns": 10**10, "event": "hold"}


def warned(*reasons: str, level: str = "warning") -> Change:
    return Change(1, 1, "left", level, rising=True, reasons=list(reasons), utilisation=0.9)


def test_a_scene_without_its_warnings_is_explained_by_what_the_machine_lost(capsys: pytest.CaptureFixture[str]) -> None:
    end = {"t_s": 18.0, "t_ns": 18 * 10**9, "event": "end", "dropped_bytes": {"left-pad": 300, "left-wrench": 12}}
    print_summary(Tally(missed=7), Report(refusals=["deadline_passed"]), [BEGIN, HOLD, end], {})
    told = capsys.readouterr().out
    assert "warnings: 0 (" in told
    assert "NOT AS EXPECTED: the rotation was not warned of\n" in told
    assert (
        "this machine was too busy: 312 bytes of the sensors were not read in time, 7 messages were missed, "
        "1 requests were too late or refused"
    ) in told
    assert "end other programs that compute, then run the demo again" in told
    slid = {"t_s": 13.0, "t_ns": 13 * 10**9, "event": "slide_begins"}
    print_summary(Tally(), Report(changes=[warned("rotation")]), [BEGIN, HOLD, slid], {})
    assert "NOT AS EXPECTED: the slip was not reported\n" in capsys.readouterr().out


def test_a_scene_that_went_as_it_should_or_ended_early_is_no_fault(capsys: pytest.CaptureFixture[str]) -> None:
    print_summary(Tally(missed=7), Report(changes=[warned("rotation")]), [BEGIN, HOLD], {})
    assert "NOT AS EXPECTED" not in capsys.readouterr().out
    print_summary(Tally(), Report(), [BEGIN], {})
    told = capsys.readouterr().out
    assert "ended before the box would turn: no warning is due yet" in told
    assert "busy" not in told
