"""The robot program of a shift: jobs with pauses and breaks, requests as a real program makes them.

A program is a generator that yields how long it waits, s; nothing here knows a clock.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from random import Random
from typing import Any

from shifts.slow_rig import FINGERS, MU_S, SlowRig

from slipd_client.messages import Health

Ask = Callable[..., dict[str, Any]]
Waits = Iterator[float]

ACTS = ("calm", "sway", "pour", "turn", "slip", "drop")
GRIP_N = 8.0
WEIGHT_N = 1.5
"""Tangential load on each pad by the box."""

OBJECTS = 40
RECORDED_EVERY = 12
PATIENCE_S = 90.0
"""Longest wait for streams that work: the longest fault, the next one, and the start of a sensor."""

OFF_SHARE = 0.7
"""Share of the breaks in which the cell is switched off; the daemon runs on."""

JOBS = (6, 15)
PAUSES_S = (1.0, 20.0)
BREAKS_S = (100.0, 600.0)
"""Jobs of a block, the pauses between them, and the break behind a block."""


class Newest:
    """The newest messages, as a program keeps them."""

    def __init__(self) -> None:
        self.gripper: dict[str, Any] = {}
        self.status: dict[str, Any] = {}
        self.levels = dict.fromkeys(FINGERS, "unknown")

    @property
    def streams_work(self) -> bool:
        """Every stream is healthy, or nearly so."""
        streams = self.status.get("streams", {})
        fits = {"gripper": Health.ERROR}  # a latched fault, which the next job acknowledges
        return bool(streams) and all(s["health"] <= fits.get(name, Health.WARN) for name, s in streams.items())


class ShiftProgram:
    """One shift.

    Args:
        rig: Where the box is put and loaded.
        newest: The newest messages.
        ask: Sends a request: client, op, fields; returns the reply.
        switch: Switches the devices on or off.
        now_ns: The time since the start.
        rng: Chooses what happens.

    Attributes:
        jobs: Number of jobs by what they were.
        breaks: Number of breaks with devices on and off.
        refusals: Number of refused requests by op and code.
        not_ready: Number of times that the streams did not work within `PATIENCE_S`.
        holder: The client that holds the lease and renews it; b"" if none.
    """

    def __init__(
        self,
        rig: SlowRig,
        newest: Newest,
        ask: Ask,
        switch: Callable[[bool], None],
        now_ns: Callable[[], int],
        rng: Random,
    ) -> None:
        self.jobs: Counter[str] = Counter()
        self.refusals: Counter[str] = Counter()
        self.requests = self.not_ready = self.count = 0
        self.breaks: Counter[str] = Counter()
        self.holder = b""
        self._switch = switch
        self._rig, self._newest, self._send, self._now_ns, self._rng = rig, newest, ask, now_ns, rng

    def run(self) -> Waits:
        """Work for ever."""
        while True:
            for _ in range(self._rng.randint(*JOBS)):
                yield from self._job()
                yield self._rng.uniform(*PAUSES_S)
            off = self._rng.random() < OFF_SHARE
            self._switch(not off)
            yield self._rng.uniform(*BREAKS_S)
            self._switch(True)
            self.breaks["off" if off else "on"] += 1

    def ask(self, op: str, **fields: Any) -> bool:
        """Send a request; return whether it was granted."""
        reply = self._send(self.holder or b"robot", op, **fields)
        self.requests += 1
        if not reply["ok"]:
            self.refusals[f"{op} {reply['error']['code']}"] += 1
        return bool(reply["ok"])

    def _job(self) -> Waits:
        self.count += 1
        yield from self._wait_for(lambda: self._newest.streams_work, PATIENCE_S)
        if not self._newest.streams_work:
            self.not_ready += 1
            return
        act = self._rng.choice(ACTS)
        self.holder = b"robot %d" % self.count
        if self.count % RECORDED_EVERY == 1:
            self.ask("record.start")
        if self.ask("lease.acquire", ttl_ms=200):
            done = yield from self._grip_and_hold(act)
            self.jobs[act if done else "ended early"] += 1
            yield from self._let_go()
        if self.count % RECORDED_EVERY == 1:
            self.ask("record.stop")
        self.holder = b""

    def _grip_and_hold(self, act: str) -> Iterator[float]:
        rng = self._rng
        yield from self._make_ready()
        if self.count % 3 == 0:
            for finger in FINGERS:
                self.ask("tare", finger=finger, seconds=0.2)
            yield 0.5
        if self.count % 2 == 0:
            self.ask("object.set", name=f"part-{rng.randrange(OBJECTS)}")
        self._rig.put_part(there=True)
        if not self.ask("gripper.close", force_n=GRIP_N, speed_mps=0.1):
            return False
        yield from self._wait_for(lambda: self._newest.gripper.get("object") == "contact_closing", 2.0)
        yield 0.5
        self._rig.load(WEIGHT_N * rng.uniform(0.5, 1.2), 0.5, self._now_ns())
        yield rng.uniform(1.0, 3.0)
        yield from self._act(act)
        self._rig.load(0.0, 0.5, self._now_ns())
        yield 0.6
        return True

    def _act(self, act: str) -> Waits:
        rig, rng = self._rig, self._rng
        if act == "sway":
            rig.sway_n = 0.5
            yield rng.uniform(2.0, 6.0)
        elif act == "pour":
            rig.load(rng.uniform(3.5, 6.0), 4.0, self._now_ns())
            for _ in range(8):
                yield 0.5
                if "warning" in self._newest.levels.values():
                    self.ask("grip.adjust", delta_n=1.0)
            yield rng.uniform(0.5, 3.0)
        elif act == "turn":
            rig.spin_nm = rng.uniform(0.01, 0.04)
            yield rng.uniform(1.0, 3.0)
        elif act in ("slip", "drop"):
            rig.drops_next = act == "drop"
            rig.load(1.5 * MU_S * 22.0, rng.uniform(0.5, 2.0), self._now_ns())
            yield rng.uniform(2.5, 4.0)
        else:
            yield rng.uniform(1.0, 5.0)
        rig.sway_n = rig.spin_nm = 0.0

    def _make_ready(self) -> Waits:
        gripper = self._newest.gripper
        if gripper.get("latched_fault"):
            self.ask("fault.ack")
        if not gripper.get("active"):
            self.ask("gripper.activate", drop=True)
            yield from self._wait_for(lambda: bool(self._newest.gripper.get("active")), 3.0)
        if (gripper.get("width_m") or 0.0) < 0.08:
            self.ask("gripper.open", drop=True)
            yield 1.0

    def _let_go(self) -> Waits:
        self.ask("gripper.open", drop=True)
        yield 0.8
        self._rig.put_part(there=False)
        self._rig.drops_next = False
        self._rig.load(0.0, 0.1, self._now_ns())
        yield 0.2
        self.ask("lease.release")

    def _wait_for(self, met: Callable[[], bool], most_s: float) -> Waits:
        waited_s = 0.0
        while not met() and waited_s < most_s:
            yield 0.1
            waited_s += 0.1
