"""Whatever clients request and whatever fails meanwhile, no byte to the gripper is outside the limits.

Requests enter as bytes, and commands are read from the registers of the gripper, so that every stage takes part.
"""

from __future__ import annotations

import math
import random
from typing import Any

import pytest
from engine_rig import MS, Run

from slipd.devices.robotiq_2f import robotiq_registers
from slipd.events import Reply
from slipd_client.messages import MessageError, decode, encode
from slipd_client.messages.schema.ops import OPS

pytestmark = pytest.mark.no_cover


STEP_N, QUANTUM_N, RAISE_N_PER_S, LEAST_N, MOST_N = 2.0, 0.1, 10.0, 3.0, 25.0
MOVES = ("grip.set", "grip.adjust", "gripper.close")
OPENING = ("gripper.open", "gripper.activate")

ODD = (None, True, "", "5", [5.0], math.nan, math.inf, -math.inf, 1e308, -1e308, 2**63, -1, 0, 5e-324)
RIGHT: dict[str, tuple[Any, ...]] = {
    "force_n": (3.0, 5.0, 6.5, 8.0, 12, 24.95, 25.0, 25.0001, 2.9999),
    "delta_n": (0.5, 1.0, 2.0, 2.0, 2.1, 9.0, -0.5, -2.0, 0),
    "width_m": (0.0, 0.02, 0.0425, 0.06, 0.085, 0.0851),
    "speed_mps": (0.02, 0.1, 0.15, 0.2),
    "drop": (True, True, False),
    "unloaded": (True, False),
    "finger": ("left", "right", "middle"),
    "ttl_ms": (1, 200, 200, 201),
    "mu_s": (0.2, 0.5, 11.0),
    "mu_d": (0.2, 0.5),
    "name": ("mug", "box.2", None, "a mug", "x" * 65),
    "seconds": (0.01, 0.5),
    "stream": ("wrench", "pad", "all"),
    "gravity_mps2": ([0.0, 0.0, -9.8],),
    "points": ([[0.1 * n, 0.0, 0.0, -9.8, *[0.0] * 6] for n in range(3)],),
    "acceleration_mps2": ([0.0, 0.0, 1.0],),
}
ENVELOPE = ("id", "boot", "deadline_ns", "v", "zz")


def any_request(rng: random.Random) -> tuple[Any, ...]:
    """Return a request of any op, mostly a motion with valid fields."""
    op = rng.choice((*OPS, *MOVES, *MOVES, *MOVES, *OPENING, "grip.hold", "fault.ack"))
    fields = [name for name, field in OPS[op].fields.items() if field.required or rng.random() < 0.3]
    body = {"op": op} | {name: rng.choice(ODD if rng.random() < 0.1 else RIGHT[name]) for name in fields}
    if rng.random() < 0.05:
        body[rng.choice(ENVELOPE)] = rng.choice(ODD)
    return "ask", rng.choice((b"ann", b"ann", b"ann", b"ann", b"ben")), body


def any_event(rng: random.Random) -> tuple[Any, ...]:
    """Return something else that may happen between two requests."""
    return rng.choice(
        (
            ("again",),
            ("wait", rng.choice((1, 20, 100, 250, 600))),
            ("feel", rng.choice((0.0, 5.0, 9.0))),
            ("feel", 5.0),
            ("found", rng.choice((0, 2, 2, 2, 3))),
            ("position", rng.randrange(256)),
            ("fault", rng.choice((0, 0, 0, 0, 8, 14))),
            ("silent", rng.random() < 0.1),
            ("echo", rng.choice((None, None, None, 9))),
            ("stage", rng.choice((3, 3, 3, 0))),
            ("replug",),
            ("sleep",),
        )
    )


class Watcher:
    """Applies requests and events to a run, and checks every register that is written."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.granted: set[float] = set()
        self.may_open = False
        self.felt_n = (0.0, 0.0)  # the last two forces: a grip that is found is judged every 20 ms
        self.claimed = False  # only the daemon can have changed the grip since its last command
        self.held_n: float | None = None
        self.lost = False
        self.since_ns, self.raised_n, self.slept = run.t_ns, 0.0, 0
        self.sent: list[tuple[bytes, dict[str, Any]]] = []

    def do(self, thing: tuple[Any, ...]) -> None:
        kind, *rest = thing
        getattr(self, kind, self.change)(*(rest if hasattr(self, kind) else (kind, *rest)))
        self.run.serve_gripper(20)
        if self.run.published("gripper")[-1]["force_command_n"] is None:
            self.held_n = None  # it is not active any more
        self.look()

    def ask(self, client: bytes, body: dict[str, Any]) -> None:
        envelope = {"v": 1, "id": len(self.sent), "boot": "b00t", "deadline_ns": self.run.t_ns + 100 * MS}
        self.send(client, envelope | body)
        self.sent.append((client, envelope | body))

    def again(self) -> None:
        for client, body in self.sent[-2:]:
            self.send(client, body)

    def send(self, client: bytes, body: dict[str, Any]) -> None:
        try:
            body = decode(encode(body))
        except MessageError:
            return
        before = self.run.ask("status")["result"]["gripper"]
        out = self.run.request(client, body)
        (reply,) = (output.body for output in out if isinstance(output, Reply))
        if reply["ok"] and reply["t_ns"] == self.run.t_ns:
            self.done(body["op"], reply["result"], before)

    def done(self, op: str, result: dict[str, Any], before: dict[str, Any]) -> None:
        """Check that a request was rightly carried out, and note what it allows."""
        if op in (*MOVES, *OPENING):
            assert not before["latched_fault"]
            assert before["active"] or op == "gripper.activate"
        if op in OPENING:
            self.may_open, self.held_n, self.claimed = True, None, False
            self.granted.add(round(result.get("applied_n", LEAST_N), 6))
        elif op in MOVES:
            applied_n = result["applied_n"]
            self.may_open = self.may_open and op != "gripper.close"
            self.change_to(applied_n, op)
            self.granted.add(round(applied_n, 6))

    def change_to(self, applied_n: float, op: str) -> None:
        held_n, self.held_n = self.held_n, applied_n
        known, self.claimed = self.claimed and not self.lost, True
        step_n = STEP_N + 1e-6
        if held_n is None or (not known and abs(applied_n - held_n) > step_n):
            found = any(abs(applied_n - max(felt_n, LEAST_N)) <= step_n + QUANTUM_N for felt_n in self.felt_n)
            assert op == "gripper.close" or found, "only a closing begins a grasp, and what is found changes in steps"
            self.since_ns, self.raised_n, self.lost = self.run.t_ns, 0.0, False
            return
        assert abs(applied_n - held_n) <= step_n
        self.raised_n += max(applied_n - held_n, 0.0)
        assert self.raised_n <= step_n + RAISE_N_PER_S * (self.run.t_ns - self.since_ns) * 1e-9

    def look(self) -> None:
        gripper = self.run.gripper
        outputs = (0, 0, 0)
        for registers in self.run.writes():
            outputs = (*registers, *outputs[len(registers) :]) if len(registers) != 1 else outputs
            if len(registers) == 1 and registers[0] >> 8 in (0, robotiq_registers.ACTIVATE):
                continue  # a stop
            if registers[0] == 0 or registers == (robotiq_registers.ACTIVATE << 8, 0, 0):
                continue  # the two steps of an activation
            force = registers[-1] & 0xFF
            force_n = LEAST_N + QUANTUM_N * force
            assert force_n <= MOST_N + 1e-9
            assert round(force_n, 6) in self.granted, "only a granted force is sent"
            if len(registers) == 3 and registers[1] < gripper.position:
                assert self.may_open, "it opens only on request"

    def wait(self, ms: int) -> None:
        self.run.serve_gripper(ms)

    def feel(self, normal_n: float) -> None:
        self.felt_n = self.felt_n[-1], normal_n
        self.run.feel(normal_n)

    def change(self, name: str, value: Any) -> None:
        self.lost |= name == "found" and value == 3
        self.claimed &= name != "stage"
        setattr(self.run.gripper, name, value)

    def recover(self, *, acknowledge: bool) -> None:
        """Clear every fault, except that an inactive gripper stays inactive."""
        self.run.gripper.fault, self.run.gripper.echo, self.run.gripper.silent = 0, None, False
        self.run.ask("lease.acquire", ttl_ms=200)
        self.run.serve_gripper(20)
        if acknowledge:
            self.run.ask("fault.ack")
        self.feel(5.0)

    def replug(self) -> None:
        self.claimed = False
        self.run.down("gripper")
        self.run.up("gripper")

    def sleep(self) -> None:
        self.claimed = False
        self.slept += 10**9
        self.run.tick(self.slept)


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(n, marks=pytest.mark.statistics) for n in range(2, 12))])
def test_no_request_moves_the_gripper_beyond_its_limits(run: Run, seed: int) -> None:
    rng = random.Random(seed)
    run.bring_up()
    watcher = Watcher(run)
    for _ in range(60):
        if rng.random() < 0.8:
            watcher.recover(acknowledge=rng.random() < 0.5)
        watcher.do(any_request(rng))
        watcher.do(any_event(rng) if rng.random() < 0.4 else ("feel", 5.0))


def test_the_watcher_sees_motions_that_are_carried_out(run: Run) -> None:
    """Random requests may all be refused; these are carried out."""
    run.bring_up()
    watcher = Watcher(run)
    watcher.do(("ask", b"ann", {"op": "gripper.close", "force_n": 5.0}))
    watcher.do(("found", 2))
    watcher.do(("feel", 5.0))
    watcher.do(("ask", b"ann", {"op": "grip.adjust", "delta_n": 2.0}))
    assert (watcher.held_n, run.gripper.command.force) == (7.0, 40)
    watcher.do(("ask", b"ann", {"op": "gripper.open", "drop": True}))
    assert (watcher.held_n, run.gripper.command.position) == (None, 0)
