"""What clients ask: sensible requests, nonsense, and what was made to hurt.

Everything is drawn from one seed. Ops and fields are those of the schema; names and values that it forbids are added.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random
from typing import Any

import msgpack
from fuzz.bombs import BOMBS, LONGEST_BYTES, packed_map

from slipd_client.messages.schema.ops import OPS

MS = 1_000_000
CLIENTS = (b"alpha", b"beta", b"gamma", b"\x00del\xff")

FINGERS = ("left", "right")
OBJECTS = ("mug", "box-2", None)
MOST_CAPTURED = 400
"""Requests kept to be sent again: those of some seconds, so that many are still within their deadline."""

READY_NS = 150 * MS
"""An activation takes some time; asked for again meanwhile, it would never end."""

FIELDS: dict[str, tuple[str, ...]] = {name: tuple(op.fields) for name, op in OPS.items()}
"""Every op and its fields."""

_NUMBERS: tuple[Any, ...] = (
    *(math.nan, math.inf, -math.inf, -0.0, 0.0, 0, 5e-324, 1e308, -1e308, 1e-9, -1.0, 1.0),
    *(2.999999, 3.0, 24.999999, 25.0, 25.0000001, 30.0, 255, 256, 1000, -1, 2**31, 2**63, 2**64 - 1, -(2**63)),
)
_OTHERS: tuple[Any, ...] = (
    *(None, True, False, "", "12", "nan", "left", b"", b"12", b"\x00" * 1024, [], {}, [1.0], [0.0, 0.0, -9.81]),
    *([math.nan] * 3, {"force_n": 5}, [[[[[1]]]]], "x" * 1024, "\n\x1b[2J\u2028", "\x00"),
)
_NAMES = ("force", "force_N", "forceN", "clamp", "v2", "", "boot ", "\x00", "x" * 200, "__class__", "drop", "unit")


@dataclass(frozen=True, slots=True)
class Ask:
    """One message on its way to the daemon.

    Attributes:
        kind: How it was made, for people.
        client: Who sends it.
        frames: Its frames.
        again: The captured message that it repeats; None where it is new.
    """

    kind: str
    client: bytes
    frames: tuple[bytes, ...]
    again: Captured | None = None


@dataclass(slots=True)
class Captured:
    """A request that was answered: who sent it, its bytes, and the reply."""

    client: bytes
    data: bytes
    reply: dict[str, Any]


@dataclass(slots=True)
class Seen:
    """What a client can know of the daemon; whoever sends the messages keeps it up.

    Attributes:
        now_ns: The daemon's clock.
        boot: Its run.
        holder: Who holds the lease.
        active: The gripper is active, and reports no fault.
        faulty: A fault is latched: something was refused because of it.
        holds: It holds something.
        force_n: The force in force; None where there is none.
    """

    now_ns: int = 0
    boot: str = ""
    holder: bytes | None = None
    active: bool = False
    faulty: bool = False
    holds: bool = False
    force_n: float | None = None
    captured: list[Captured] = field(default_factory=list)


class Asker:
    """Makes messages.

    Args:
        rng: Of every choice.
        seen: What can be known.
    """

    def __init__(self, rng: Random, seen: Seen) -> None:
        self._rng, self._seen = rng, seen
        self._number = 0
        self._ready_ns = 0
        self._kinds: list[tuple[str, Callable[[], tuple[bytes, tuple[bytes, ...]]], float]] = [
            ("sensible", self._sensible, 38),
            ("any values", self._any_values, 18),
            ("mutated", self._mutated, 14),
            ("damaged bytes", self._damaged, 8),
            ("random bytes", self._random, 2),
            ("bomb", self._bomb, 3),
            ("frames", self._frames, 1),
        ]
        self._weights = [weight for _, _, weight in self._kinds]
        self._again = 16 / (16 + sum(self._weights))

    def next(self) -> Ask:
        """The next message."""
        rng = self._rng
        if self._seen.captured and rng.random() < self._again:
            old = rng.choice(self._seen.captured[-20:] if rng.random() < 0.5 else self._seen.captured)
            client = old.client if rng.random() < 0.5 else rng.choice(CLIENTS)
            return Ask("replay", client, (old.data,), old)
        kind, make, _ = rng.choices(self._kinds, self._weights)[0]
        client, frames = make()
        return Ask(kind, client, frames)

    # -- well formed

    def _sensible(self) -> tuple[bytes, tuple[bytes, ...]]:
        """What a program that means well would ask now."""
        rng, seen = self._rng, self._seen
        client = seen.holder or rng.choice(CLIENTS)
        if rng.random() < 0.05:
            client = rng.choice(CLIENTS)
        if seen.holder is None:
            op, fields = "lease.acquire", {"ttl_ms": rng.choice((50, 100, 200))}
        elif rng.random() < 0.2:
            op, fields = "lease.renew", {}
        elif seen.faulty and rng.random() < 0.7:
            op, fields = "fault.ack", {}
        elif not seen.active and seen.now_ns > self._ready_ns:
            op, fields = "gripper.activate", rng.choice(({}, {"drop": True}))
            self._ready_ns = seen.now_ns + READY_NS
        elif not seen.holds and rng.random() < 0.6:
            op, fields = "gripper.close", {"force_n": self._force()}
        else:
            op, fields = self._gripping()
        return client, (self._packed(self._envelope(op) | fields),)

    def _gripping(self) -> tuple[str, dict[str, Any]]:
        rng = self._rng
        op = rng.choices(
            ("grip.set", "grip.adjust", "grip.hold", "gripper.close", "gripper.open", "gripper.stop", "lease.release",
             "tare", "tare.get", "friction.set", "object.set", "gravity.set", "status", "hello", "gripper.activate"),
            (30, 15, 3, 10, 4, 2, 1, 1, 1, 2, 2, 1, 1, 1, 1),
        )[0]  # fmt: skip
        fields: dict[str, Any] = {
            "grip.set": {"force_n": self._force()},
            "grip.adjust": {"delta_n": self._change()},
            "gripper.close": {"force_n": self._force()} | rng.choice(({}, {"width_m": 0.01})),
            "gripper.open": rng.choice(({"drop": True}, {}, {"drop": False}, {"width_m": 0.05, "drop": True})),
            "tare": {"finger": rng.choice(FINGERS), "seconds": 0.1},
            "tare.get": {"finger": rng.choice(FINGERS)},
            "friction.set": {"finger": rng.choice(FINGERS), "mu_s": 0.6, "mu_d": 0.5},
            "object.set": {"name": rng.choice(OBJECTS)},
            "gravity.set": {"finger": rng.choice(FINGERS), "gravity_mps2": [0.0, 0.0, -9.81]},
        }.get(op, {})
        return op, fields

    def _force(self) -> float:
        """One that may be granted: the first of a grasp, or a change of it."""
        force_n = self._seen.force_n
        return self._rng.uniform(3.0, 23.0) if force_n is None else force_n + self._change()

    def _change(self) -> float:
        rng = self._rng
        return rng.choice((rng.uniform(-2.0, 2.0), rng.uniform(-0.3, 0.3), rng.uniform(-6.0, 6.0), 2.0, -2.0))

    def _any_values(self) -> tuple[bytes, tuple[bytes, ...]]:
        """Any op with the fields it has, whatever they say."""
        rng = self._rng
        op = rng.choice(list(FIELDS))
        body = self._envelope(op) | {name: self._value(name) for name in FIELDS[op] if rng.random() < 0.85}
        return self._someone(), (self._packed(body),)

    def _mutated(self) -> tuple[bytes, tuple[bytes, ...]]:
        """A sensible one of which one thing is wrong."""
        rng = self._rng
        client, (data,) = self._sensible()
        body = msgpack.unpackb(data)
        name = rng.choice(list(body))
        mutation = rng.randrange(7)
        if mutation == 0:
            body[name] = rng.choice(_NUMBERS + _OTHERS)
        elif mutation == 1:
            del body[name]
        elif mutation == 2:
            body[rng.choice(_NAMES)] = rng.choice(_NUMBERS + _OTHERS)
        elif mutation == 3:
            body["deadline_ns"] = self._deadline()
        elif mutation == 4:
            body["id"] = rng.choice((self._number - 1, rng.randrange(max(1, self._number)), True, None, 1.5, 2**64 - 1))
        elif mutation == 5:
            body[rng.choice(("v", "boot", "op"))] = rng.choice((0, 2, "1", 1.0, True, "", "grip", "older", None))
        else:
            return client, (self._twisted(body),)
        return client, (self._packed(body),)

    def _twisted(self, body: dict[str, Any]) -> bytes:
        """What a dictionary cannot hold: a key that stands twice or is no string, a value of an extension type."""
        rng = self._rng
        pairs = [msgpack.packb(key) + msgpack.packb(value) for key, value in body.items()]
        name = rng.choice(list(body))
        twist = rng.randrange(5)
        if twist == 0:
            pairs.insert(rng.randrange(len(pairs) + 1), msgpack.packb(name) + msgpack.packb(rng.choice(_NUMBERS)))
        elif twist == 1:
            pairs.append(msgpack.packb(rng.choice((1, None, b"force_n", 2.5))) + msgpack.packb(1))
        elif twist == 2:
            pairs.append(msgpack.packb("force_n") + msgpack.packb(msgpack.ExtType(rng.choice((5, 127)), b"1234")))
        elif twist == 3:
            pairs.append(msgpack.packb("t") + msgpack.packb(msgpack.Timestamp(1, 2)))
        else:
            return packed_map(pairs) + rng.choice((b"\x00", b"\xc0", b"\x80" * 3))
        return packed_map(pairs)

    # -- bytes

    def _damaged(self) -> tuple[bytes, tuple[bytes, ...]]:
        rng = self._rng
        client, (data,) = self._sensible()
        at = rng.randrange(len(data))
        how = rng.randrange(5)
        if how == 0:
            data = data[:at]
        elif how == 1:
            data = data[:at] + bytes((data[at] ^ 1 << rng.randrange(8),)) + data[at + 1 :]
        elif how == 2:
            data = data[:at] + rng.randbytes(rng.randint(1, 8)) + data[at:]
        elif how == 3:
            data = data[:at] + data[at + rng.randint(1, 4) :]
        else:
            data = (
                data[:at] + rng.choice((b"\xc1", b"\xdd\xff\xff\xff\xff", b"\xdf\xff\xff\xff\xff", b"\xc9")) + data[at:]
            )
        return client, (data,)

    def _random(self) -> tuple[bytes, tuple[bytes, ...]]:
        return self._someone(), (self._rng.randbytes(self._rng.choice((0, 1, 3, 40, 400, LONGEST_BYTES))),)

    def _bomb(self) -> tuple[bytes, tuple[bytes, ...]]:
        return self._someone(), (self._rng.choice(BOMBS),)

    def _frames(self) -> tuple[bytes, tuple[bytes, ...]]:
        client, frames = self._sensible()
        return client, self._rng.choice(((), frames * 2, (b"", *frames), (*frames, b""), frames * 50))

    # -- parts

    def _envelope(self, op: str) -> dict[str, Any]:
        self._number += 1
        ahead_ns = round(self._rng.uniform(20.0, 480.0)) * MS
        number = self._number if self._rng.random() < 0.7 else f"n{self._number}"
        return {"v": 1, "id": number, "op": op, "boot": self._seen.boot, "deadline_ns": self._seen.now_ns + ahead_ns}

    def _deadline(self) -> Any:
        """What the clock of a client may make of it."""
        rng, now_ns = self._rng, self._seen.now_ns
        near = now_ns + rng.choice((-1, 0, 1, 500 * MS, 500 * MS + 1, rng.randint(-50 * MS, 600 * MS)))
        return rng.choice((near, near, -1, 0, 2**63, 2**64 - 1, float(now_ns + MS), math.nan, str(now_ns), None, True))

    def _value(self, name: str) -> Any:
        rng = self._rng
        right: Any = {
            "finger": rng.choice(FINGERS),
            "name": rng.choice(OBJECTS),
            "drop": rng.random() < 0.5,
            "unloaded": rng.random() < 0.5,
            "ttl_ms": rng.choice((0, 1, 50, 199, 200, 201, 1000, -200)),
            "gravity_mps2": [rng.uniform(-10.0, 10.0) for _ in range(3)],
            "width_m": rng.uniform(-0.01, 0.1),
            "speed_mps": rng.uniform(0.0, 0.2),
            "delta_n": rng.uniform(-4.0, 4.0),
            "seconds": rng.uniform(-0.1, 12.0),
        }.get(name, rng.uniform(0.0, 30.0))
        choice = rng.random()
        return right if choice < 0.5 else rng.choice(_NUMBERS) if choice < 0.8 else rng.choice(_OTHERS)

    def _someone(self) -> bytes:
        holder = self._seen.holder
        return holder if holder is not None and self._rng.random() < 0.7 else self._rng.choice(CLIENTS)

    def _packed(self, body: dict[str, Any]) -> bytes:
        data: bytes = msgpack.packb(body)
        return data
