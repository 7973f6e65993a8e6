"""Loop time of one peer, with an injected clock where time matters."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any

import pytest
from loop_waits import eventually

from slipd.io.zmtp.peer import BURST_S, MOST_ACCOUNTS, TimeAccount, TimeAccounts

SHARE = 0.25


def test_an_account_gets_its_share_for_long_and_a_burst_at_once() -> None:
    account, now_s, took_s = TimeAccount(b"a", SHARE), 100.0, 0.0
    for _ in range(40_000):  # a second, looked at every 25 µs; it always wants more
        if account.has_time(now_s):
            account.charge(50e-6)
            took_s += 50e-6
        now_s += 25e-6
    assert took_s == pytest.approx(SHARE + BURST_S, abs=100e-6)
    account.has_time(now_s + 1000.0)
    assert account._left_s == BURST_S


async def test_those_that_wait_have_their_turns_in_order_when_there_is_time() -> None:
    account, turns = TimeAccount(b"a", SHARE), []

    def turn(number: int) -> None:
        turns.append(number)
        account.charge(0.002)

    assert account.has_time(asyncio.get_running_loop().time())
    account.charge(BURST_S + 0.001)
    for number in range(5):
        account.wait(partial(turn, number))
    assert turns == []
    await eventually(lambda: turns == [0, 1, 2, 3, 4])


async def test_a_turn_that_fails_reaches_the_loop_and_the_next_has_its_own(loop_faults: list[dict[str, Any]]) -> None:
    def fail() -> None:
        raise ArithmeticError("a fault of ours")

    account, done = TimeAccount(b"a", SHARE), asyncio.Event()
    account.wait(fail)
    account.wait(done.set)
    await eventually(done.is_set)
    assert [str(fault["exception"]) for fault in loop_faults] == ["a fault of ours"]
    loop_faults.clear()


def test_a_connection_takes_the_place_of_one_that_is_gone() -> None:
    account = TimeAccount(b"a")
    assert [account.enter() for _ in range(3)] == [0, 1, 2]
    account.slots.discard(1)
    assert len(account.slots) == 2
    assert [account.enter(), account.enter()] == [1, 3]


def test_an_account_is_the_same_after_its_peer_came_back_and_the_idle_are_forgotten_first() -> None:
    accounts = TimeAccounts()
    here = accounts.of(b"here")
    slot = here.enter()
    gone = accounts.of(b"gone")
    for number in range(MOST_ACCOUNTS):
        accounts.of(b"%d" % number)
    assert accounts.of(b"here") is here
    assert accounts.of(b"gone") is not gone
    here.slots.discard(slot)
    assert len(accounts._accounts) <= MOST_ACCOUNTS
