"""Random and hostile requests at a daemon without sockets: nothing beyond the limits ever reaches the gripper.

A round is one seed: clients, devices, faults and clocks. The messages take the way of real ones, from their frames
through the request server's own judgement to the engine and the bytes for the gripper.
"""

from __future__ import annotations

import gc
import os
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import msgpack
import numpy as np
from fuzz.asking import MOST_CAPTURED, Ask, Asker, Captured
from fuzz.request_report import AGAIN, LOOKED_AT_NS, UNJUDGED, Found
from fuzz.request_world import RequestWorld

from slipd.events import Request
from slipd.io.bus.request_server import RequestServer
from slipd.io.zmtp.peer import Peer
from slipd_client.messages import ERROR_CODES, MESSAGE_LIMITS, MessageError, decode, encode

STRICT, ROUND = 1_000_000, 10_000
"""Messages of a strict run, and of one round."""

RESTART_EVERY = 2_500
"""Messages per run of the daemon; what was captured in one run is also sent to the next ones."""

NEVER_DONE = ("hello", "status")
"""Requests that change nothing, so that a repetition is harmless."""


class _Connection:
    """The part of a peer that the request server reads."""

    kind = b"DEALER"
    key = b""
    slot = 0
    account = SimpleNamespace(name=b"process")


class _Server(RequestServer):
    """The real request server without its socket and without its rate limit."""

    def __init__(self, on_request: Callable[[bytes, dict[str, Any]], None]) -> None:
        super().__init__("", on_request, per_second=1e12)
        self._peer = cast("Peer", _Connection())
        self.sent: list[tuple[bytes, bytes]] = []

    def reply(self, client: bytes, body: dict[str, Any]) -> None:
        """Pack a reply as it would be sent."""
        self.sent.append((client.partition(b"\0")[2], encode(body)))

    def take(self, client: bytes, frames: tuple[bytes, ...]) -> None:
        """Handle a message."""
        self._names = {self._peer: b"process\0" + client}
        self._on_message(self._peer, list(frames))


class _Run(RequestWorld):
    """One round while it is played."""

    def __init__(self, seed: int) -> None:
        self._server = _Server(self.ask)
        super().__init__(seed, self._server.reply)
        self.found = Found()
        self._asker = Asker(self.rng, self.seen)
        self.took_ns: list[int] = []
        self.kinds: list[str] = []
        self.restart()

    def play(self, count: int, until: str = "") -> None:
        """Send so many messages; end earlier at a fault whose text contains ``until``."""
        for number in range(count):
            self.pass_time()
            if number % RESTART_EVERY == RESTART_EVERY - 1:
                self.restart()
            elif self.rng.random() < 0.006:
                self.strike()
            self._look()
            self._send(self._asker.next(), number)
            if until and any(until in fault for fault in self.book.violations + self.found.bad):
                break

    def _send(self, ask: Ask, number: int) -> None:
        self.found.messages[ask.kind] += 1
        self._server.sent.clear()
        try:
            begun_ns = time.process_time_ns()
            self._server.take(ask.client, ask.frames)
            took_ns = time.process_time_ns() - begun_ns
        except Exception as error:
            self.found.faults.append(f"message {number} ({ask.kind}): {type(error).__name__}: {error}")
            took_ns = 0
        self.took_ns.append(took_ns)
        self.kinds.append(ask.kind)
        self._check(ask, number)
        self.deliver()

    def ask(self, client: bytes, body: dict[str, Any]) -> None:
        """Pass a request to the engine, as the service does; what it writes is checked after the message."""
        self.engage(Request(client, body))

    def _check(self, ask: Ask, number: int) -> None:
        """Check what the daemon answered."""
        if [client for client, _ in self._server.sent] != [ask.client]:
            self.found.faults.append(f"message {number} ({ask.kind}): {len(self._server.sent)} replies")
            return
        try:
            reply = decode(self._server.sent[0][1], MESSAGE_LIMITS)
        except MessageError as error:
            self.found.faults.append(f"message {number} ({ask.kind}): a reply that no client reads: {error}")
            return
        refusal = None if reply["ok"] is True else reply["error"]
        if refusal is not None and (refusal["code"] not in ERROR_CODES or not refusal["message"]):
            self.found.faults.append(f"message {number} ({ask.kind}): refused with {refusal}")
        if refusal is not None and refusal["code"] == "fault_latched":
            self.seen.faulty = True
        if ask.again is not None and not self._is_late(ask, ask.again, reply, number):
            return
        body = _body(ask.frames)
        if body is None:
            if reply["ok"] is not False:
                self.found.faults.append(f"message {number} ({ask.kind}): granted, and it is no request")
            return
        if reply["ok"]:
            self.book.grant(ask.client, body, self.seen.boot, reply["result"], self.now_ns)
            self.seen.faulty = self.seen.faulty and body.get("op") != "fault.ack"
        if body.get("op") not in NEVER_DONE:
            self.seen.captured.append(Captured(ask.client, ask.frames[0], reply))
            del self.seen.captured[:-MOST_CAPTURED]

    def _is_late(self, ask: Ask, old: Captured, reply: dict[str, Any], number: int) -> bool:
        """Return whether a captured request is carried out for the first time.

        It may be answered as before to whoever sent it first, and must not be done again.
        """
        self.found.replays += 1
        if not reply["ok"]:
            return False
        if ask.client == old.client and reply == old.reply:
            self.found.cached += 1
            return False
        first = old.reply.get("error", {}).get("code", "granted")
        if first in UNJUDGED:
            self.found.late += 1
            old.client, old.reply = ask.client, reply
            return True
        what = f"{_body(ask.frames)} of {old.client!r}, {first}, was granted to {ask.client!r}"
        self.found.accepted_replays.append(f"message {number}: {what}")
        return False

    def _look(self) -> None:
        """Update what clients can know."""
        seen, book = self.seen, self.book
        seen.now_ns, seen.holder = self.now_ns, book.holder_at(self.now_ns)
        seen.active, seen.holds = book.is_active, book.held
        seen.force_n = book.grip_n


def _body(frames: tuple[bytes, ...]) -> dict[str, Any] | None:
    """Return the map of a request, decoded as leniently as msgpack allows; None if it is no map."""
    try:
        body = msgpack.unpackb(frames[0], strict_map_key=False) if len(frames) == 1 else None
    except Exception:
        return None
    return body if isinstance(body, dict) else None


def fuzz(seed: int, count: int = ROUND, until: str = "") -> Found:
    """Play one round; its slow messages are timed again by playing the same round once more.

    Args:
        seed: Of the round.
        count: Number of messages.
        until: Part of the words of a fault that ends the round.
    """
    run = _Run(seed)
    gc.collect()
    gc.freeze()  # as in the service
    run.play(count, until)
    took_ns = np.array(run.took_ns)
    kinds = run.kinds
    for _ in range(AGAIN):
        if took_ns.max() <= LOOKED_AT_NS:
            break
        other = _Run(seed)
        other.play(int(np.flatnonzero(took_ns > LOOKED_AT_NS)[-1]) + 1)
        again_ns = np.array(other.took_ns)
        took_ns[: len(again_ns)] = np.minimum(took_ns[: len(again_ns)], again_ns)
    gc.unfreeze()
    found = run.found
    found.took_ns = took_ns
    found.slowest = [(int(took_ns[n]), kinds[n], seed, int(n)) for n in np.argsort(took_ns)[-3:]]
    found.violations = [f"seed {seed}: {what}" for what in run.book.violations]
    found.accepted_replays = [f"seed {seed}: {what}" for what in found.accepted_replays]
    found.faults = [f"seed {seed}: {what}" for what in found.faults]
    if run.hand.bad_frames:
        found.faults.append(f"seed {seed}: the gripper got {run.hand.bad_frames} frames that are none")
    found.granted = Counter(run.book.granted)
    found.commands, found.acts = run.book.commands, run.book.acts
    del run
    gc.collect()
    found.memory_kb = {os.getpid(): (_memory_kb(),) * 2}
    return found


def _memory_kb() -> int:
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1])
    raise RuntimeError("the kernel does not report the memory of a process")
