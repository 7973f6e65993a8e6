"""A gripper, two fingers and the engine on one clock; everything goes through `Engine.handle`, from bytes to bytes."""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from engine_rig import RIGHT, EngineRun
from grasp_table import grasp_table
from gripper_peers import Peer, SentCommand
from nanoseconds import MS

from slipd import config
from slipd.devices import bota
from slipd.devices.pvdf import encode_scan
from slipd.events import Bytes, Event, LinkDown, LinkUp, Output, Publish, StateRestored, Write
from slipd.tools.sim.emulated_pads import encode_message

STEP_NS, READING_NS = 5 * MS, 20 * MS
MOST_N, STEP_N, RAISE_N_PER_S, BUDGET_N, CEILING_N = 25.0, 2.0, 10.0, 12.0, 15.0
PART_M = 0.04
OVERLOAD = 2
JITTER = np.array([[1, 2, 1], [2, 1, 2], [1, 1, 2], [2, 2, 1]])
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
[rates]
tactile_hz = 1.0
wrench_hz = 1.0
[reflex]
enabled = true
CEILING
[gripper]
"""


LIMITS = {"max_force_n": MOST_N, "step_n": STEP_N, "raise_n_per_s": RAISE_N_PER_S, "budget_n": BUDGET_N}


class Cell(EngineRun):
    """The rig while it runs.

    Args:
        jaws: The gripper.
        keys: Of ``[gripper]``, beside or in place of `LIMITS`.

    Attributes:
        t_ns: CLOCK_MONOTONIC.
        state: "good", "overload" (it marks its readings) or "silent", of each finger.
        felt: When each finger sent its last reading, and whether that was good.
        shown_n: What pressed on each pad when the fingers were read last.
        mute: Whether nothing passes on the gripper's line.
        pull: Tangential force on the left finger, as a share of the grip.
        sent: The commands on the gripper's wire; those that move nothing are left out.
        on_sent: Hears of every command before the gripper does.
        acts: What the reflex did.
        on_act: Hears of each, in the ``gripper`` message that publishes it.
        body: The newest ``gripper`` message.
        levels: The newest level of each finger.
    """

    def __init__(self, jaws: Peer, **keys: Any) -> None:
        self.jaws = jaws
        self.on_sent: Callable[[SentCommand], object] = lambda _: None
        self.on_act: Callable[[dict[str, Any]], object] = lambda _: None
        self._limits = LIMITS | keys
        self.state = {"left": "good", "right": "good"}
        self.felt = {"left": (0, False), "right": (0, False)}
        self.mute, self.pull, self.shown_n = False, 0.0, 0.0
        self._message = self._scan = self._suspended_ns = 0
        super().__init__(self._settings())
        self._plug_in()

    def _settings(self) -> config.Config:
        ceiling = f"ceiling_n = {min(CEILING_N, self._limits['max_force_n'])}"
        limits = "\n".join(f"{key} = {value!r}" for key, value in self._limits.items())
        return config.parse(TEXT.replace("CEILING", ceiling) + self.jaws.CONFIG + limits, "cell.toml")

    def begin(self, settings: config.Config, *, zeros: bool = True) -> None:
        super().begin(settings, zeros=zeros)
        self.acts: list[dict[str, Any]] = []
        self.sent: list[SentCommand] = []
        self.body: dict[str, Any] = {}
        self.levels: dict[str, str] = {}
        self._unheard: list[bytes] = []

    def restart(self, kept: StateRestored | None = None, **keys: Any) -> None:
        """Start a daemon that knows of nothing but the zeros and what was kept; the gripper holds what it holds."""
        self._limits |= keys
        self.begin(self._settings())
        if kept is not None:
            self.feed(kept)
        self._plug_in()

    def _plug_in(self, *links: str) -> None:
        for link in links or self.engine.links:
            self.feed(LinkUp(link, f"opened {link}"))
        self.jaws.left()
        self.jaws.opened(self.t_ns)

    @property
    def policy(self) -> Any:
        return self.engine._gripper.policy

    def hear(self, output: Output, event: Event) -> None:
        if isinstance(output, Write) and output.link == "gripper":
            for sent in self.jaws.commands(output.data):
                self.on_sent(sent)
                self.sent += [sent] if sent.kind not in ("other", "acknowledge") else []
            self._unheard.append(output.data)
        elif isinstance(output, Publish) and output.topic == "gripper":
            self.body = output.body
            if output.body["reflex"] is not None:
                self.acts.append(output.body["reflex"])
                self.on_act(output.body)
        elif isinstance(output, Publish) and output.topic.startswith("slip."):
            self.levels[output.body["finger"]] = output.body["level"]

    def serve_gripper(self, ms: float) -> None:
        """Let time pass."""
        until_ns = self.t_ns + round(ms * MS)
        while self.t_ns < until_ns:
            self.t_ns += STEP_NS
            self.renew_lease()
            self.tick(self._suspended_ns)
            self._serve()
            if self.t_ns % READING_NS == 0:
                self._read()

    def serve_until(self, met: Callable[[], bool]) -> None:
        """Let time pass until something is the case, and is reported."""
        for _ in range(60):
            self.serve_gripper(25)
            if met():
                break
        assert met()
        self.serve_gripper(100)

    def stall(self, ms: float = 60.0) -> None:
        """The loop is held up: nothing reaches the engine, and its devices go on."""
        self.wait(ms)

    def sleep(self) -> None:
        """The host sleeps; the monotonic clock does not see it."""
        self._suspended_ns += 10**9
        self.tick(self._suspended_ns)

    def kept(self) -> StateRestored:
        """What the daemon keeps for the next run, as the event with which that begins."""
        return StateRestored(self.engine.kept.text(self.t_ns))

    def replug(self) -> None:
        """The gripper's link is lost and comes back."""
        self._unheard.clear()
        self.feed(LinkDown("gripper", "unplugged"))
        self._plug_in("gripper")

    def _serve(self) -> None:
        heard, self._unheard = self._unheard, []
        said = [] if self.mute else [answer for piece in heard for answer in self.jaws.hear(piece, self.t_ns)]
        said += self.jaws.advance(self.t_ns)
        for piece in [] if self.mute else said:
            self.feed(Bytes("gripper", piece))

    def _read(self) -> None:
        """A reading of each finger; an image hangs where it is ever the same."""
        self.shown_n = normal_n = self.jaws.grip_n
        if self.state["left"] != "silent":
            status = OVERLOAD if self.state["left"] == "overload" else 0
            force = (self.pull * normal_n, 0.0, -normal_n - self.t_ns // READING_NS % 3 * 0.002)
            self.felt["left"] = self.t_ns, not status
            frame = bota.encode_frame(force, (0.0, 0.0, 0.0), self.t_ns // 1000, status=status)
            self.feed(Bytes("left.wrench", frame))
            self._scan += 1
            counts = np.full((4, 4), 100 + self._scan % 7) if normal_n else np.zeros((4, 4), dtype=int)
            self.feed(Bytes("left.pad", encode_scan(counts, self._scan, self.t_ns / 1000, 5.0)))
        if self.state["right"] != "silent":
            self._message += 1
            self.felt["right"] = self.t_ns, True
            counts = np.full((4, 3), 1000)
            counts[:, 2] += round(normal_n * 250)
            counts += self._message * JITTER % 3 - 1
            self.feed(Bytes("right.pad", encode_message(self._message, {"2": counts}, 1.7e9)))

    def bring_up(self) -> None:
        """Free fingers, tared, an active gripper, and the lease with the client."""
        self.serve_gripper(100)
        self.lease()
        assert self.code("tare", finger="left", seconds=0.05) is None
        self.serve_gripper(100)
        assert self.code("gripper.activate") is None
        self.serve_until(lambda: self.jaws.active)

    def grip(self, force_n: float) -> None:
        """Grip the part."""
        self.jaws.put(PART_M)
        assert self.code("gripper.close", force_n=force_n) is None
        self.serve_until(lambda: self.jaws.grip_n > force_n - 0.2)


@cache
def _brought_up(jaws: type[Peer], held_n: float, **keys: Any) -> Cell:
    if held_n:
        cell = brought_up(jaws, **keys)
        cell.grip(held_n)
    else:
        cell = Cell(jaws(), **keys)
        cell.bring_up()
    cell.sent.clear()
    return cell


def brought_up(jaws: type[Peer], held_n: float = 0.0, **keys: Any) -> Cell:
    """A cell that was brought up, and grips with ``held_n`` where that is not 0; made once, and copied."""
    return copy.deepcopy(_brought_up(jaws, held_n, **keys))
