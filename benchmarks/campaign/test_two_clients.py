"""Two clients, a page, the reflex, faults, reloads and kills in any order: nothing moves by one without the lease."""

from __future__ import annotations

from typing import Any

import pytest
from campaign.two_clients import walk
from gripper_peers import PEERS, Peer

from slipd.gripper import grip_gate
from slipd.requests.handlers import RequestHandlers

pytestmark = pytest.mark.timeout(600)

EACH = pytest.mark.parametrize("jaws", PEERS.values(), ids=PEERS.keys())


@EACH
def test_A9_nothing_is_moved_by_a_client_without_the_lease_nor_above_step_and_rate(jaws: type[Peer]) -> None:
    assert walk(jaws, 0, 6.0)


@EACH
@pytest.mark.long
@pytest.mark.parametrize("seed", range(10))
def test_A9_nothing_is_moved_in_180_s(jaws: type[Peer], seed: int) -> None:
    done = walk(jaws, seed, 180.0)
    assert {"reflex needed", "raised", "friction.set no_lease"} <= set(done)
    assert done["reload"] + done["kill"] + done["kill that kept nothing"] > 0


@pytest.mark.long
@pytest.mark.parametrize(
    ("owner", "name", "broken", "what"),
    [
        (RequestHandlers, "_check_steering", lambda *_: None, "without a true cause"),
        (grip_gate, "TABLE", grip_gate.TABLE[1:], "without the lease"),
    ],
    ids=["what the reflex acts on", "the lease"],
)
def test_what_is_broken_is_found(
    monkeypatch: pytest.MonkeyPatch, owner: object, name: str, broken: Any, what: str
) -> None:
    monkeypatch.setattr(owner, name, broken)
    with pytest.raises(AssertionError, match=what):
        _walk_until_found()


def _walk_until_found() -> None:
    for seed in range(10):
        walk(PEERS["robotiq_2f"], seed, 60.0)
