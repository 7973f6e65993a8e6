"""The lines between the devices and the daemon, and the faults that befall them: one after another, seeded."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable
from random import Random

from shifts.slow_rig import MS, SECOND, STEP_NS, SlowRig
from simulation.edits import pad, wrench
from simulation.faults import Bunch, Bursts, Chain, Delay, Drop, Edit, Flood, Garbage, Noise, Split, Text, Trickle
from simulation.line import Fault

from slipd.events import Bytes, Event, LinkDown, LinkUp

Make = Callable[[Random, str], Fault]

CLOCK_SPAN_US = 1 << 32
KINDS: dict[str, Make] = {
    "silent": lambda rng, _: Drop(rng),
    "damaged": lambda rng, _: Noise(rng, per_thousand=10.0 ** rng.uniform(-1.0, 2.0)),
    "noisy": lambda rng, _: Flood(rng),
    "in bursts": lambda rng, _: Bursts(rng, mean_ns=round(rng.uniform(10, 200)) * MS),
    "losses": lambda rng, _: Drop(rng, share=rng.random()),
    "garbage": lambda rng, _: Garbage(rng),
    "split": lambda rng, _: Split(rng, most=rng.choice((1, 8, 64))),
    "bunches": lambda rng, _: Chain([Bunch(period_ns=50 * MS), Split(rng, most=256)]),
    "late": lambda rng, _: Delay(round(rng.uniform(1, 30)) * MS),
    "trickle": lambda _, __: Trickle(period_ns=200 * MS),
    "boot text": lambda _, __: Text(),
    "clock jumps": lambda rng, link: _clock_jump(rng, link),
    "status bits": lambda rng, link: Edit(wrench(status=rng.choice((2, 4, 8)))) if "wrench" in link else Drop(rng),
    "not numbers": lambda rng, link: _not_a_number(rng) if "wrench" in link else Garbage(rng),
}
OF_HOST = ("unplugged", "all stalled", "suspended")
LINES = ("left.wrench", "left.pad", "right.wrench", "right.pad", "gripper")
WEIGHTS = (6, 6, 6, 6, 2)
"""A gripper that fails ends the job."""

SHORTEST_S, LONGEST_S = 0.02, 3.0
LONG_SHARE, LONG_S = 0.1, 30.0
"""Share of the faults of a line that last up to so long."""

PAUSES_S = (2.0, 40.0)
"""From the end of a fault to the next."""


class FaultyLines:
    """Bytes in both directions; what arrives is an event.

    Args:
        rig: The devices.
        rng: Chooses the faults.

    Attributes:
        faults: Number of faults by kind.
        suspended_ns: How long the host slept so far.
        off_ns: How long the devices had no power so far.
        calm: No fault begins.
        off: The devices have no power; switch them with this.
    """

    def __init__(self, rig: SlowRig, rng: Random) -> None:
        self.faults: Counter[str] = Counter()
        self.suspended_ns = self.off_ns = 0
        self.calm, self.off = True, False
        self._rig, self._rng = rig, rng
        self._up: set[str] = set()
        self._said: dict[str, list[bytes]] = {link: [] for link in LINES}
        self._queues: dict[str, deque[tuple[int, bytes]]] = {link: deque() for link in LINES}
        self._active: dict[str, Fault] = {}
        self._kind = self._struck = ""
        self._next_ns = self._stalled_until_ns = 0

    def plug(self, link: str, t_ns: int) -> Event:
        """Open a line; return the event of it."""
        self._up.add(link)
        self._said[link].clear()
        self._queues[link].clear()
        self._rig.devices[link].opened(t_ns)
        return LinkUp(link, f"serial of {link}")

    def unplug(self, link: str) -> Event:
        """Close a line; return the event of it."""
        self._up.discard(link)
        self._queues[link].clear()
        return LinkDown(link, "unplugged")

    def write(self, link: str, data: bytes, t_ns: int) -> None:
        """Pass what the daemon writes to the device; its answer comes with the next step."""
        if link in self._up:
            self._said[link] += self._rig.devices[link].receive(data, t_ns)

    @property
    def stalled(self) -> bool:
        """The daemon does not run: what arrives is read at once later."""
        return self._stalled_until_ns > 0

    def step(self, t_ns: int) -> list[Event]:
        """Advance everything to ``t_ns``; return the events that enter the daemon."""
        if self.off:
            self.off_ns += STEP_NS
            return [self.unplug(link) for link in sorted(self._up)]
        events = self._turn_of_faults(t_ns) if self._up else [self.plug(link, t_ns) for link in LINES]
        pieces = self._rig.advance(t_ns)
        for link in LINES:
            self._say(link, pieces.get(link, []), t_ns)
        if t_ns < self._stalled_until_ns:
            return events
        joined, self._stalled_until_ns = self.stalled, 0
        for link, queue in self._queues.items():
            arrived = []
            while queue and queue[0][0] <= t_ns:
                arrived.append(queue.popleft()[1])
            if joined:
                arrived = [b"".join(arrived)]
            events += [Bytes(link, data) for data in arrived if data]
        return events

    def _say(self, link: str, pieces: list[bytes], t_ns: int) -> None:
        data = b"".join([*self._said[link], *pieces])
        self._said[link].clear()
        if data and link in self._up:
            fault = self._active.get(link)
            self._queues[link] += [(t_ns, data)] if fault is None else fault.pass_on(data, t_ns)

    def _turn_of_faults(self, t_ns: int) -> list[Event]:
        """End a fault, or begin one, when it is time."""
        if t_ns < self._next_ns or (self.calm and not self._kind):
            return []
        rng = self._rng
        if self._kind:
            events = [self.plug(self._struck, t_ns)] if self._kind == "unplugged" else []
            self._active.clear()
            self._kind = ""
            self._next_ns = t_ns + round(rng.uniform(*PAUSES_S) * SECOND)
            return events
        self._kind, (self._struck,) = rng.choice([*KINDS, *OF_HOST]), rng.choices(LINES, WEIGHTS)
        self.faults[self._kind] += 1
        seconds = rng.uniform(SHORTEST_S, LONGEST_S)
        if rng.random() < LONG_SHARE and self._kind != "all stalled":
            seconds = rng.uniform(LONGEST_S, LONG_S)
        self._next_ns = t_ns + round(seconds * SECOND)
        if self._kind == "unplugged":
            return [self.unplug(self._struck)]
        if self._kind == "all stalled":
            self._stalled_until_ns = self._next_ns
        elif self._kind == "suspended":
            self.suspended_ns += round(10.0 ** rng.uniform(0.0, 3.5) * SECOND)
            for queue in self._queues.values():
                queue.clear()
        else:
            struck = [self._struck] if rng.random() < 0.7 else rng.sample(LINES, rng.randint(2, 5))
            self._active = {link: KINDS[self._kind](rng, link) for link in struck}
        return []


def _clock_jump(rng: Random, link: str) -> Fault:
    if link == "gripper":
        return Drop(rng)
    jump_us = rng.randrange(CLOCK_SPAN_US)

    def moved(time_us: int) -> int:
        return (time_us + jump_us) % CLOCK_SPAN_US

    return Edit(wrench(clock_us=moved) if link.endswith("wrench") else pad(cols=4, clock_us=moved), lies=False)


def _not_a_number(rng: Random) -> Fault:
    value, place = rng.choice((float("nan"), float("inf"), float("-inf"))), rng.randrange(6)
    return Edit(wrench(lambda six, _: [value if n == place else number for n, number in enumerate(six)]))
