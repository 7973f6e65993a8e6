"""Whatever the client raises on purpose has one base."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from slipd_client import keys
from slipd_client.errors import CallError, ClientError, ConnectionClosed, NoAnswer, RequestRefused, SlipdClientError
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


def test_a_refusal_and_a_missing_reply_are_of_the_base(daemon: Daemon) -> None:
    daemon.handlers["grip.set"] = lambda _: {"error": {"code": "no_lease", "message": "no"}}
    daemon.handlers["status"] = lambda _: None
    with GripClient(daemon.endpoint) as client:
        with pytest.raises(SlipdClientError) as refusal:
            client.grip_set(5.0)
        client.timeout_s = 0.05
        with pytest.raises(SlipdClientError) as silence:
            client.status()
    assert (type(refusal.value), type(silence.value)) == (RequestRefused, NoAnswer)


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


@pytest.mark.parametrize("value", [1j, {1.0}, object(), 2**64])
def test_a_value_that_no_message_can_carry_is_named_with_its_field(daemon: Daemon, value: object) -> None:
    with GripClient(daemon.endpoint) as client:
        with pytest.raises(CallError, match=r"^force_n of grip.set must be a plain number"):
            client.grip_set(value)  # type: ignore[arg-type]
        with pytest.raises(CallError, match=r"^gravity_mps2 of gravity.set must be .* list"):
            client.gravity_set("left", [0.0, 0.0, value])  # type: ignore[list-item]
    assert set(daemon.ops) == {"hello"}


@pytest.mark.parametrize("seconds", [0, -1.0, float("nan"), float("inf"), "1"])
def test_a_duration_must_be_a_positive_time(seconds: float) -> None:
    with pytest.raises(CallError, match=r"^timeout_s must be a positive time in seconds, e.g. 1, got"):
        GripClient("ipc:///run/slipd-test/none", timeout_s=seconds)
    with pytest.raises(CallError, match=r"^silence_s must be a positive time in seconds, e.g. 3, got"):
        Subscriber("ipc:///run/slipd-test/none", silence_s=seconds)


@pytest.mark.parametrize("topics", [b"slip", (b"slip",), None, 1])
def test_topics_that_are_no_strings_are_a_wrong_call(topics: object) -> None:
    with pytest.raises(CallError, match=r"^topics must be a sequence of strings, e.g. "):
        Subscriber("ipc:///run/slipd-test/none", topics=topics)  # type: ignore[arg-type]


@pytest.mark.parametrize("topic", ["slips", "slip.Left", "sli.left", "warning.left", "status.", "Slip", "slip left"])
def test_a_topic_that_does_not_exist_is_a_wrong_call(topic: str) -> None:
    with pytest.raises(CallError) as caught:
        Subscriber("ipc:///run/slipd-test/none", topics=("slip", topic))
    assert str(caught.value) == (
        "topics must be beginnings of slip.FINGER, warning, wrench.FINGER, tactile.FINGER, grasp, gripper, status, "
        f'or "" for everything, got {topic!r}'
    )


@pytest.mark.parametrize("topic", ["", "s", "slip", "slip.", "slip.left", "tactile.f2", "grasp"])
def test_a_beginning_of_a_topic_can_be_subscribed_to(topic: str, tmp_path: Path) -> None:
    Subscriber(f"ipc://{tmp_path}/none", topics=(topic,)).close()


def test_an_endpoint_of_another_type_is_a_wrong_call() -> None:
    with pytest.raises(CallError, match=r"^endpoint must be of the form .*, got 3"):
        GripClient(3)  # type: ignore[arg-type]
