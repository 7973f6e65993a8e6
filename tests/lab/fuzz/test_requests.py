"""A share of the fuzzing of requests, and that its oracle finds what it is made to find.

A failure prints the call that repeats it:
``PYTHONPATH=tests/support:tests/lab python -m fuzz --only requests --seed S --rounds 1``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from random import Random
from typing import Any

import msgpack
import pytest
from fuzz import requests
from fuzz.asking import Asker, Captured, Seen
from fuzz.bombs import BOMBS, LONGEST_BYTES
from fuzz.hand import FORCE_TABLE, Hand, newtons
from fuzz.request_report import Found, tables, verdicts
from fuzz.requests import fuzz
from permits import activate, move

from slipd.devices.robotiq_2f import Session
from slipd.finger.finger import Finger
from slipd.gripper import motion_gate
from slipd.requests.handlers import RequestHandlers
from slipd.requests.idempotency import IdempotencyCache
from slipd.types.permit import Permit

SEED = 20261122  # the same every time; `python -m fuzz` draws others
AGAIN = f"PYTHONPATH=tests/support:tests/lab python -m fuzz --only requests --seed {SEED} --rounds 1"
SHARE, BROKEN = 5_000, 2_500
BROKEN_SEEDS = (5, 9, 7, 11, 1, 2)
"""One of these rounds must find what is broken; the first that find most stand first."""


@pytest.fixture(autouse=True)
def once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is timed again: no test looks at times."""
    monkeypatch.setattr(requests, "AGAIN", 0)


def test_A1_A2_A3_no_request_breaks_a_limit_or_is_done_twice() -> None:
    found = fuzz(SEED, SHARE)
    assert found.bad == [], AGAIN
    assert found.commands > 0
    assert found.replays > 100
    assert sum(found.messages.values()) == len(found.took_ns) == SHARE


def test_the_same_seed_is_the_same_round() -> None:
    one, other = fuzz(SEED, 600), fuzz(SEED, 600)
    assert (one.messages, one.granted, one.replays, one.commands) == (
        other.messages,
        other.granted,
        other.replays,
        other.commands,
    )


def nothing(*_: Any, **__: Any) -> None:
    """Refuse nothing."""


def always(*_: Any) -> bool:
    return True


def without(*rules: str) -> object:
    """The gate's table, but for some rules."""
    table = tuple(row for row in motion_gate.TABLE if row[0].__name__ not in rules)
    assert len(table) == len(motion_gate.TABLE) - len(rules)
    return table


CHANGES = ("change_is_within_a_step", "raises_stay_within_the_budget", "change_is_slow_enough")


def failing(*_: Any, **__: Any) -> None:
    raise RuntimeError("broken")


def harder(self: Session, permit: Permit, now_ns: int, *, execute: Callable[..., bool] = Session.execute) -> bool:
    changed = permit.kind == "set_force" and permit.force_n is not None
    return execute(self, replace(permit, force_n=permit.force_n + 1.0) if changed else permit, now_ns)


@pytest.mark.parametrize(
    ("owner", "name", "broken", "what"),
    [
        (motion_gate, "TABLE", without("client_holds_the_lease"), "holds no lease"),
        (motion_gate, "TABLE", without(*CHANGES), "in one step"),
        (motion_gate, "TABLE", without("force_is_within_limits", *CHANGES), "N asked for"),
        (motion_gate, "TABLE", without("no_fault_is_latched"), "a fault stands"),
        (Finger, "is_trusted_for_raise", always, "good False"),
        (Session, "execute", harder, "N applied"),
        (IdempotencyCache, "seen", nothing, "was granted to"),
        (RequestHandlers, "answer", failing, "RuntimeError: broken"),
    ],
    ids=lambda value: value.replace(" ", "_") if isinstance(value, str) else "",
)
def test_what_is_broken_is_found(
    monkeypatch: pytest.MonkeyPatch, owner: object, name: str, broken: object, what: str
) -> None:
    monkeypatch.setattr(owner, name, broken)
    assert any(what in fault for seed in BROKEN_SEEDS for fault in fuzz(seed, BROKEN, until=what).bad)


def test_what_is_asked_is_of_every_kind_and_mostly_within_the_size_that_is_read() -> None:
    seen = Seen(now_ns=10**12, boot="b", holder=b"alpha", active=True, holds=True)
    seen.captured.append(Captured(b"alpha", msgpack.packb({"op": "grip.set"}), {"ok": True}))
    asker = Asker(Random(SEED), seen)
    asks = [asker.next() for _ in range(4_000)]
    assert len({ask.kind for ask in asks}) == 8
    assert max(len(ask.frames) for ask in asks) > 2
    assert all(len(bomb) <= 1.3 * LONGEST_BYTES for bomb in BOMBS)
    assert any(len(bomb) > LONGEST_BYTES for bomb in BOMBS)


def test_the_hand_understands_the_session_and_reads_its_forces_alike() -> None:
    hand = Hand(Random(SEED))
    session = Session(
        force_table=[list(row) for row in FORCE_TABLE], width_table=[[0.0, 0.085], [1.0, 0.0]], speed_table=None
    )
    said, now_ns = session.start(0), 0
    activate(session, 0)
    for _ in range(60):
        now_ns += 10_000_000
        if said:
            session.receive(hand.receive(said, now_ns), now_ns)
        hand.advance(now_ns)
        said = session.on_time(now_ns)
    assert hand.bad_frames == 0
    hand.told.clear()
    applied_n = move(session, 0.0, None, 11.3)
    while not hand.told:
        now_ns += 10_000_000
        session.receive(hand.receive(said, now_ns) if said else b"", now_ns)
        said = session.on_time(now_ns)
    (told,) = hand.told
    assert told.goes
    assert told.position == 255
    assert newtons(told.force) == pytest.approx(applied_n)


def test_a_report_lists_what_was_found() -> None:
    found = Found()
    for seed in (SEED, SEED + 1):
        found.add(fuzz(seed, 300))
    sent, figures = tables(found, 600)
    assert sum(int(row[1]) for row in sent.rows) == 600
    assert [row[3] for row in figures.rows[:4]] == ["yes"] * 4
    found.violations.append("too much")
    assert verdicts(found)[0] == "requests: 1 faults"
    assert tables(found, 1000)[1].rows[1][3] == "no"
