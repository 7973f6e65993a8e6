"""A gripper, two fingers and the engine on one clock; everything goes through `Engine.handle`, from bytes to bytes."""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from engine_rig import RIGHT
from grasp_table import grasp_table
from known_zeros import know_zeros
from motions.jaws import Jaws, Sent

from slipd import config
from slipd.devices import bota, pvdf, xela
from slipd.engine.engine import Engine
from slipd.events import Bytes, Event, LinkDown, LinkUp, Publish, Reply, Request, StateRestored, Tick, Write

MS = 1_000_000
STEP_NS, READING_NS = 5 * MS, 10 * MS
BOOT = "b00t"
MOST_N, STEP_N, RAISE_N_PER_S, BUDGET_N, CEILING_N = 25.0, 2.0, 10.0, 12.0, 15.0
PART_M = 0.04
OVERLOAD = 2
JITTER = np.array([[1, 2, 1], [2, 1, 2], [1, 1, 2], [2, 2, 1]])
CLIENT = b"ann"
"""Of the counts from one message to the next: what never changes is taken for stuck."""

TEXT = f"""
[finger.left]
mu = 0.5
min_normal_n = 0.5
[finger.left.wrench]
device = "bota"
port = "/dev/left-wrench"
rate_hz = 100.0
stuck_after = 0
[finger.left.pad]
device = "pvdf"
port = "/dev/left-pad"
rate_hz = 100.0
rows = 4
cols = 4
pitch_m = 0.004
electrode_m = 0.002
axis_scale = [0.01]
threshold = 0.05
{RIGHT}
{grasp_table(0.11)}
[reflex]
enabled = true
CEILING
[gripper]
"""


LIMITS = {"max_force_n": MOST_N, "step_n": STEP_N, "raise_n_per_s": RAISE_N_PER_S, "budget_n": BUDGET_N}


def _ignore(_: Any) -> None:
    pass


class Cell:
    """The rig while it runs.

    Args:
        jaws: The gripper.
        begin_ns: CLOCK_MONOTONIC at the start.
        keys: Of ``[gripper]``, beside or in place of `LIMITS`.

    Attributes:
        now_ns: CLOCK_MONOTONIC.
        state: "good", "overload" (it marks its readings) or "silent", of each finger.
        felt: When each finger sent its last reading, and whether that was good.
        shown_n: What pressed on each pad when the fingers were read last.
        pull: Tangential force on the left finger, as a share of the grip.
        on_sent: Hears of every command on the gripper's wire before the gripper does.
        acts: What the reflex did.
        on_act: Hears of each, in the ``gripper`` message that publishes it.
        body: The newest ``gripper`` message.
        levels: The newest level of each finger.
    """

    def __init__(self, jaws: Jaws, begin_ns: int = 1_000_000 * MS, **keys: Any) -> None:
        self.jaws = jaws
        self.on_sent: Callable[[Sent], None] = _ignore
        self.on_act: Callable[[dict[str, Any]], None] = _ignore
        limits = LIMITS | keys
        text = TEXT.replace("CEILING", f"ceiling_n = {min(CEILING_N, limits['max_force_n'])}") + jaws.CONFIG
        text += "\n".join(f"{key} = {value!r}" for key, value in limits.items())
        self._settings = config.parse(text, "cell.toml")
        self.now_ns = begin_ns
        self.state = {"left": "good", "right": "good"}
        self.felt = {"left": (0, False), "right": (0, False)}
        self.mute = False  # nothing passes on the gripper's line
        self.pull = self.shown_n = 0.0
        self._asked = self._message = self._scan = self._suspended_ns = 0
        self._unheard: list[bytes] = []
        self.restart()

    def restart(self, kept: StateRestored | None = None) -> None:
        """Start a daemon that knows of nothing but the zeros and what was kept; the gripper holds what it holds."""
        self.engine = Engine(self._settings, boot=BOOT, wall_minus_monotonic_ns=0)
        know_zeros(*self.engine._fingers.values())
        self.acts: list[dict[str, Any]] = []
        self.body: dict[str, Any] = {}
        self.levels: dict[str, str] = {}
        self._renewed_ns: int | None = None
        self._unheard.clear()
        if kept is not None:
            self.feed(kept)
        for link in self.engine.links:
            self.feed(LinkUp(link, f"opened {link}"))
        self.jaws.opened(self.now_ns)

    @property
    def policy(self) -> Any:
        return self.engine._gripper.policy

    def feed(self, event: Event) -> list[Reply]:
        replies = []
        for output in self.engine.handle(event, self.now_ns):
            if isinstance(output, Write) and output.link == "gripper":
                for sent in self.jaws.sent(output.data):
                    self.on_sent(sent)
                self._unheard.append(output.data)
            elif isinstance(output, Reply):
                replies.append(output)
            elif isinstance(output, Publish) and output.topic == "gripper":
                self.body = output.body
                if output.body["reflex"] is not None:
                    self.acts.append(output.body["reflex"])
                    self.on_act(output.body)
            elif isinstance(output, Publish) and output.topic.startswith("slip."):
                self.levels[output.body["finger"]] = output.body["level"]
        return replies

    def ask(self, op: str, client: bytes = CLIENT, **fields: Any) -> dict[str, Any]:
        """A request, now; returns the reply."""
        self._asked += 1
        head = {"v": 1, "id": self._asked, "op": op, "boot": BOOT, "deadline_ns": self.now_ns + 100 * MS}
        given = {name: value for name, value in fields.items() if value is not None}
        (reply,) = self.feed(Request(client, head | given))
        return reply.body

    def code(self, op: str, **fields: Any) -> str | None:
        """Code with which a request is refused; None where it was done."""
        reply = self.ask(op, **fields)
        return None if reply["ok"] else reply["error"]["code"]

    def lease(self) -> None:
        """The client takes the lease, and renews it as time passes."""
        assert self.code("lease.acquire", ttl_ms=200) is None
        self._renewed_ns = self.now_ns

    def let_lease_be(self) -> None:
        self._renewed_ns = None

    def run(self, ms: float) -> None:
        """Let time pass."""
        until_ns = self.now_ns + round(ms * MS)
        while self.now_ns < until_ns:
            self.now_ns += STEP_NS
            if self._renewed_ns is not None and self.now_ns - self._renewed_ns >= 50 * MS:
                self._renewed_ns = self.now_ns
                self.ask("lease.renew")
            self.feed(Tick(self._suspended_ns))
            self._serve()
            if self.now_ns % READING_NS == 0:
                self._read()

    def stall(self, ms: float) -> None:
        """The loop is held up: nothing reaches the engine, and its devices go on."""
        self.now_ns += round(ms * MS)

    def sleep(self) -> None:
        """The host sleeps; the monotonic clock does not see it."""
        self._suspended_ns += 10**9
        self.feed(Tick(self._suspended_ns))

    def kept(self) -> StateRestored:
        """What the daemon keeps for the next run, as the event with which that begins."""
        return StateRestored(self.engine.kept.text(self.now_ns))

    def replug(self) -> None:
        """The gripper's link is lost and comes back."""
        self._unheard.clear()
        self.feed(LinkDown("gripper", "unplugged"))
        self.feed(LinkUp("gripper", "opened gripper"))
        self.jaws.opened(self.now_ns)

    def _serve(self) -> None:
        heard, self._unheard = self._unheard, []
        if self.mute:
            self.jaws.advance(self.now_ns)
            return
        said = [answer for piece in heard for answer in self.jaws.receive(piece, self.now_ns)]
        for piece in said + self.jaws.advance(self.now_ns):
            self.feed(Bytes("gripper", piece))

    def _read(self) -> None:
        """A reading of each finger; an image hangs where it is ever the same."""
        self.shown_n = normal_n = self.jaws.grip_n
        if self.state["left"] != "silent":
            status = OVERLOAD if self.state["left"] == "overload" else 0
            force = (self.pull * normal_n, 0.0, -normal_n - self.now_ns // READING_NS % 3 * 0.002)
            self.felt["left"] = self.now_ns, not status
            frame = bota.encode_frame(force, (0.0, 0.0, 0.0), self.now_ns // 1000, status=status)
            self.feed(Bytes("left.wrench", frame))
            self._scan += 1
            counts = np.full((4, 4), 100 + self._scan % 7) if normal_n else np.zeros((4, 4), dtype=int)
            self.feed(Bytes("left.pad", pvdf.encode_scan(counts, self._scan, self.now_ns / 1000, 5.0)))
        if self.state["right"] != "silent":
            self._message += 1
            self.felt["right"] = self.now_ns, True
            counts = np.full((4, 3), 1000)
            counts[:, 2] += round(normal_n * 250)
            counts += self._message * JITTER % 3 - 1
            self.feed(Bytes("right.pad", xela.encode_message(self._message, {"2": counts}, 1.7e9)))

    # -- what most tests begin with

    def bring_up(self) -> None:
        """Free fingers, tared, an active gripper, and the lease with the client."""
        self.run(100)
        self.lease()
        assert self.code("tare", finger="left", seconds=0.05) is None
        self.run(100)
        assert self.code("gripper.activate") is None
        self.run(1500)

    def grip(self, force_n: float) -> None:
        """Grip the part."""
        self.jaws.put(PART_M)
        assert self.code("gripper.close", force_n=force_n) is None
        self.run(1500)
        assert self.jaws.grip_n > 0.0


@cache
def _brought_up(jaws: type[Jaws], held_n: float, **keys: Any) -> Cell:
    cell = Cell(jaws(), **keys)
    cell.bring_up()
    if held_n:
        cell.grip(held_n)
    return cell


def brought_up(jaws: type[Jaws], held_n: float = 0.0, **keys: Any) -> Cell:
    """A cell that was brought up, and grips with ``held_n`` where that is not 0; made once, and copied."""
    return copy.deepcopy(_brought_up(jaws, held_n, **keys))
