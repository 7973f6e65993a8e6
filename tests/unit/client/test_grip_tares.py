"""Tares as a client takes them: each waits until the daemon has its readings, or names why it gave up."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import pytest

from slipd_client.errors import CallError, NoAnswer, RequestRefused, TareGivenUp
from slipd_client.grip import GripClient

if TYPE_CHECKING:
    from conftest import Daemon


def test_a_tare_is_waited_for_until_it_is_taken(daemon: Daemon) -> None:
    looks = iter([{"busy": True, "tare_id": 1}, {"busy": True, "tare_id": 1}, {"busy": False, "tare_id": 2}])
    daemon.handlers["tare"] = lambda _: {"verified": True, "tare_id": 1}
    daemon.handlers["tare.get"] = lambda _: next(looks)
    with GripClient(daemon.endpoint) as client:
        assert client.tare("left", 0.4) == {"busy": False, "tare_id": 2, "verified": True}
    assert daemon.asked_ops == ["tare", *["tare.get"] * 3]
    assert daemon.asked[0]["seconds"] == 0.4


def test_a_tare_of_one_stream_is_waited_for_by_its_name(daemon: Daemon) -> None:
    daemon.handlers["tare"] = lambda _: {"verified": True, "tare_id": 0, "tare_ids": {"pad": 0}}
    daemon.handlers["tare.get"] = lambda request: {"busy": False, "tare_id": 1, "stream": request["stream"]}
    with GripClient(daemon.endpoint) as client:
        assert client.tare("left", "pad", 0.1)["stream"] == "pad"
    assert [request.get("stream") for request in daemon.asked] == ["pad", "pad"]


def test_a_tare_of_all_streams_is_waited_for_in_each(daemon: Daemon) -> None:
    ids = iter([4, 2])
    daemon.handlers["tare"] = lambda _: {"verified": False, "tare_id": 3, "tare_ids": {"wrench": 3, "pad": 1}}
    daemon.handlers["tare.get"] = lambda request: {"busy": False, "tare_id": next(ids), "stream": request["stream"]}
    with GripClient(daemon.endpoint) as client:
        taken = client.tare("left", "all")
    assert taken == {
        "finger": "left",
        "verified": False,
        "streams": {
            "wrench": {"busy": False, "tare_id": 4, "stream": "wrench"},
            "pad": {"busy": False, "tare_id": 2, "stream": "pad"},
        },
    }
    daemon.handlers["tare.get"] = lambda request: {"busy": False, "tare_id": {"wrench": 4, "pad": 1}[request["stream"]]}
    with GripClient(daemon.endpoint) as client, pytest.raises(RequestRefused, match="tare of left pad was given up"):
        client.tare("left", "all")


@pytest.mark.parametrize(
    ("given_up", "reason", "code"),
    [
        ("a contact began", "contact", "in_contact"),
        ("the stream fell silent", "silent", "not_ready"),
        ("the finger was turned", "turned", "not_ready"),
        ("the readings moved: hold still", "later_reason", "not_ready"),
        ("of an older daemon", None, "not_ready"),
    ],
)
def test_a_tare_that_was_given_up_is_reported_as_what_it_was(
    daemon: Daemon, given_up: str, reason: str | None, code: str
) -> None:
    daemon.handlers["tare"] = lambda _: {"verified": True, "tare_id": 1}
    state = {"busy": False, "tare_id": 1, "given_up": given_up, "given_up_reason": reason}
    daemon.handlers["tare.get"] = lambda _: state
    with GripClient(daemon.endpoint) as client, pytest.raises(TareGivenUp) as caught:
        client.tare("left", 0.1)
    assert isinstance(caught.value, RequestRefused)
    assert (caught.value.code, caught.value.reason) == (code, reason or "")
    assert str(caught.value) == f"{code}: the tare of left was given up: {given_up}"


def test_a_tare_that_was_taken_and_undone_at_once_is_reported_as_undone(daemon: Daemon) -> None:
    daemon.handlers["tare"] = lambda _: {"verified": True, "tare_id": 1}
    daemon.handlers["tare.get"] = lambda _: {"busy": False, "tare_id": 1, "given_up": None, "given_up_reason": None}
    with GripClient(daemon.endpoint) as client, pytest.raises(TareGivenUp, match=r"tare\.undo") as caught:
        client.tare("left", 0.1)
    assert (caught.value.code, caught.value.reason) == ("not_ready", "undone")


def test_a_tare_without_readings_is_told(daemon: Daemon, monkeypatch: pytest.MonkeyPatch) -> None:
    waited_ns = 0

    def busy(_: Any) -> dict[str, Any]:
        nonlocal waited_ns
        waited_ns += 10**9
        return {"busy": True, "tare_id": 1}

    daemon.handlers["tare.get"] = busy
    with GripClient(daemon.endpoint, timeout_s=2.0) as client:
        monkeypatch.setattr(client._protocol, "_now_ns", lambda: time.monotonic_ns() + waited_ns)
        with pytest.raises(NoAnswer, match="too few readings"):
            client.tare("left", 0.1)
    assert daemon.ops.count("tare.get") >= 2


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf")])
def test_a_tare_over_no_time_is_a_bad_call(requests: str, seconds: float) -> None:
    with GripClient(requests) as client, pytest.raises(ValueError, match="positive time"):
        client.tare("left", seconds)


def test_seconds_before_the_stream_are_a_bad_call(daemon: Daemon) -> None:
    with GripClient(daemon.endpoint) as client, pytest.raises(CallError, match=r"call tare\(finger, stream, seconds\)"):
        client.tare("left", 0.5, "pad")  # type: ignore[arg-type]
