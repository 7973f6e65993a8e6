"""Whatever the client raises on purpose has one base."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from slipd_client import keys
from slipd_client.errors import CallError, ClientError, ConnectionClosed, SlipdClientError
from slipd_client.grip import GripClient
from slipd_client.messages import decode
from slipd_client.messages.codec import read
from slipd_client.subscriber import Subscriber

if TYPE_CHECKING:
    from conftest import Daemon


def with_client(call: Callable[[GripClient], object]) -> None:
    with GripClient("ipc:///run/slipd-test/no-daemon", timeout_s=0.01) as client:
        call(client)


@pytest.mark.parametrize(
    "call",
    [
        lambda: GripClient("tcp://robot"),
        lambda: Subscriber("nowhere"),
        lambda: Subscriber("ipc:///run/slipd-test/none", topics="slip"),
        lambda: with_client(lambda client: client.tare("left", 0.0)),
        lambda: with_client(lambda client: client.status()),
        lambda: decode(b""),
        lambda: read([b"slip.left"]),
        lambda: keys.load_public(Path("/no/such.key")),
        lambda: keys.create("no name", Path("/tmp")),
    ],
)
def test_whatever_goes_wrong_is_of_the_base_and_a_wrong_call_is_a_value_error(call: Callable[[], object]) -> None:
    with pytest.raises(SlipdClientError) as caught:
        call()
    assert isinstance(caught.value, ValueError) != isinstance(caught.value, ClientError)


def test_a_client_that_was_closed_says_so(daemon: Daemon) -> None:
    client, subscriber = GripClient(daemon.endpoint), Subscriber(daemon.endpoint)
    client.disconnect()
    subscriber.close()
    for call in (client.status, subscriber.receive):
        with pytest.raises(ConnectionClosed, match=f"connection to {daemon.endpoint} was closed"):
            call()


def test_a_wrong_call_names_the_argument_the_rule_and_the_value() -> None:
    with pytest.raises(CallError, match=r"^endpoint must be of the form .*, got 'nowhere'"):
        Subscriber("nowhere")
    with pytest.raises(CallError, match=r"^topics must be a sequence of strings, .*got 'slip'"):
        Subscriber("ipc:///run/slipd-test/none", topics="slip")
    with (
        GripClient("ipc:///run/slipd-test/no-daemon") as client,
        pytest.raises(CallError, match=r"^seconds must be .*, got -1"),
    ):
        client.tare("left", -1.0)


@pytest.mark.parametrize("seconds", [0, -1.0, float("nan"), float("inf"), "1"])
def test_a_duration_must_be_a_positive_time(seconds: float) -> None:
    with pytest.raises(CallError, match=r"^timeout_s must be a positive time in seconds, e.g. 1, got"):
        GripClient("ipc:///run/slipd-test/none", timeout_s=seconds)
    with pytest.raises(CallError, match=r"^silence_s must be a positive time in seconds, e.g. 3, got"):
        Subscriber("ipc:///run/slipd-test/none", silence_s=seconds)


@pytest.mark.parametrize("topic", ["slips", "slip.Left", "sli.left", "warning.left", "status.", "Slip", "slip left"])
def test_a_topic_that_does_not_exist_is_a_wrong_call(topic: str) -> None:
    with pytest.raises(CallError) as caught:
        Subscriber("ipc:///run/slipd-test/none", topics=("slip", topic))
    assert str(caught.value) == (
        "topics must be beginnings of slip.FINGER, warning, wrench.FINGER, tactile.FINGER, grasp, motion, gripper, "
        f'status, or "" for everything, got {topic!r}'
    )
