"""Why a request of the guide was not carried out, for people: what to do, and no word of the protocol."""

from __future__ import annotations

import pytest

from slipd.tools.commission.daemon_link import TARES, reason_of
from slipd_client.errors import ClientError, NoAnswer, RequestRefused, TareGivenUp
from slipd_client.messages import TARE_REASONS

DEADLINE = "deadline_ns must not have passed: it passed 12 ms ago"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (RequestRefused("deadline_passed", DEADLINE, "deadline_ns"), "the machine was too busy to answer in time"),
        (RequestRefused("lease_held", "another client holds the lease"), "end that program"),
        (RequestRefused("in_contact", "finger left is in contact", "finger"), "take away whatever touches the finger"),
        (RequestRefused("new_code", "of a newer daemon"), "of a newer daemon"),
        (TareGivenUp("moved", "the tare of left was given up"), "hold the gripper still"),
        (TareGivenUp("", "the tare of left was given up"), "given up"),
        (NoAnswer("no answer within 1 s"), "no answer within 1 s"),
    ],
)
def test_a_refusal_says_what_to_do(error: ClientError, words: str) -> None:
    assert words in reason_of(error)


def test_every_reason_of_a_tare_has_words() -> None:
    assert set(TARES) == set(TARE_REASONS)
