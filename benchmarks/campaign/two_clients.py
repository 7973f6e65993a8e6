"""Random walks of two clients, a page, the reflex, faults, reloads and kills, and an oracle on the gripper's bytes.

The oracle knows who could cause what. A width on the wire needs a motion that the lease holder was granted. A force on
a held object changes no faster than step and rate allow. The reflex raises only where the truth is a cause: the object
pulls, or what the lease holder stated makes the pull a danger.
"""

from __future__ import annotations

import itertools
from collections import Counter
from random import Random
from typing import Any

from gripper_peers import Peer
from motions.cell import PART_M, RAISE_N_PER_S, STEP_N, Cell, brought_up
from motions.wire_oracle import MOTIONS, WireOracle
from nanoseconds import MS, T0

LOWER_N_PER_S = 2.0
MU = 0.5
EPS_N = 0.12
"""A force setting of the Robotiq, which rounds down."""
AFTERMATH_NS = 4_000 * MS
"""A slip is reported for up to 3 s after its evidence: a pull that lets go, or a sensor that comes back."""
DANGER = 0.75
"""Share of what friction carries from which a true load may be a cause: a growing load warns from 0.80 on."""
HOLDER, OTHER, PAGE = b"ann", b"eve", b"page"


class Rates:
    """How far a force may have moved: a step at once, then at the rate."""

    def __init__(self, rate_n_per_s: float) -> None:
        self._rate, self._left_n, self._t_ns = rate_n_per_s, STEP_N, 0

    def take(self, change_n: float, t_ns: int) -> bool:
        self._left_n = min(self._left_n + self._rate * (t_ns - self._t_ns) * 1e-9, STEP_N) - change_n
        self._t_ns = t_ns
        return self._left_n >= -EPS_N

    def renew(self) -> None:
        """A new run of the daemon has a step at once again."""
        self._left_n = STEP_N


class Walk(WireOracle):
    """One walk; it stops with an AssertionError at the first thing that must not be.

    Attributes:
        done: How often each thing happened.
    """

    def __init__(self, jaws: type[Peer], seed: int) -> None:
        self.rng = Random(f"{jaws.__name__} {seed}")
        self.cell: Cell = brought_up(jaws, 6.0)
        self.cell.on_sent, self.cell.on_act = self.look_at_wire, self.look_at_act
        self.done: Counter[str] = Counter()
        self.granted = "gripper.close"  # the last motion that the lease holder was granted
        self.mu = {"left": MU, "right": MU}  # as the holder of the lease stated it, or the config
        self.pulls: list[tuple[int, float]] = [(self.cell.t_ns, 0.0)]
        self.disturbed_ns = -AFTERMATH_NS
        self.rising, self.falling = Rates(RAISE_N_PER_S), Rates(LOWER_N_PER_S)
        self.exerted_n = self.cell.jaws.grip_n
        self.let_go = False

    def run(self, seconds: float) -> Counter[str]:
        until_ns = self.cell.t_ns + round(seconds * 1e9)
        while self.cell.t_ns < until_ns:
            self.rng.choice(self.STEPS)(self)
            for _ in range(self.rng.choice((1, 4, 12, 40, 120))):
                self.cell.serve_gripper(5)
                self.look_at_jaws()
        return self.done

    # -- what happens

    def lease(self) -> None:
        """The holder takes the lease, if it is free."""
        if self.cell.code("lease.acquire", client=HOLDER, ttl_ms=200) is None:
            self.cell._renewed_ns = self.cell.t_ns

    def holder_asks(self) -> None:
        rng, cell = self.rng, self.cell
        self.lease()
        held_n = cell.policy.force_n or 6.0
        self.ask(
            HOLDER,
            *rng.choice(
                (
                    ("grip.set", {"force_n": held_n + rng.uniform(-3.0, 3.0)}),
                    ("grip.set", {"force_n": rng.choice((2.0, 4.0, 6.0, 25.0, 26.0))}),
                    ("grip.adjust", {"delta_n": rng.uniform(-2.5, 2.5)}),
                    ("gripper.close", {"force_n": held_n + rng.uniform(-2.0, 2.0)}),
                    ("gripper.close", {"force_n": rng.choice((6.0, 8.0, 25.0))}),
                    ("grip.hold", {}),
                    ("fault.ack", {}),
                    ("fault.ack", {}),
                    ("friction.set", {"finger": rng.choice(("left", "right")), "mu_s": rng.choice((0.3, 0.5))}),
                    ("lease.release", {}),
                )
            ),
        )

    def holder_grips_anew(self) -> None:
        """The holder opens, lays a part in, and grips it."""
        cell = self.cell
        cell.pull = 0.0
        self.lease()
        self.ask(HOLDER, "fault.ack", {})
        if not cell.jaws.active:
            self.ask(HOLDER, "gripper.activate", {"drop": True})
            self.wait(1500)
        self.ask(HOLDER, "gripper.open", {"drop": True})
        self.wait(1200)
        cell.jaws.put(PART_M)
        self.ask(HOLDER, "gripper.close", {"force_n": self.rng.choice((6.0, 8.0))})
        self.wait(1500)

    def peace(self) -> None:
        """Nothing true is a cause any more; then the other client states what the reflex acts on."""
        cell = self.cell
        cell.state, cell.mute, cell.pull = {"left": "good", "right": "good"}, False, min(cell.pull, 0.2)
        self.wait(AFTERMATH_NS // MS + 500)
        for finger in ("left", "right"):
            self.ask(OTHER, "friction.set", {"finger": finger, "mu_s": self.rng.choice((0.02, 0.1))})
        self.wait(500)

    def other_asks(self) -> None:
        """A client that the lease holder knows nothing of."""
        rng = self.rng
        finger = {"finger": rng.choice(("left", "right"))}
        self.ask(
            rng.choice((OTHER, OTHER, PAGE)),
            *rng.choice(
                (
                    ("friction.set", finger | {"mu_s": rng.choice((0.02, 0.1, 0.5))}),
                    ("friction.set", finger | {"mu_s": 0.3, "mu_d": 0.299}),
                    ("gravity.set", {"finger": "left", "gravity_mps2": [rng.uniform(-40.0, 40.0), 0.0, 0.0]}),
                    ("object.set", {"name": rng.choice(("mug", "box"))}),
                    ("tare", finger | {"seconds": 0.05}),
                    ("tare.undo", finger),
                    ("grip.set", {"force_n": 8.0}),
                    ("grip.adjust", {"delta_n": 2.0}),
                    ("gripper.open", {"drop": True}),
                    ("gripper.close", {"force_n": 25.0}),
                    ("gripper.activate", {"drop": True}),
                    ("grip.hold", {}),
                    ("gripper.stop", {}),
                    ("fault.ack", {}),
                    ("record.stop", {}),
                )
            ),
        )

    def page_adjusts(self) -> None:
        """A button of the page: the lease for one change, if it is free."""
        if self.cell.code("lease.acquire", client=PAGE, ttl_ms=200) is None:
            self.ask(PAGE, "grip.adjust", {"delta_n": self.rng.choice((-1.0, 1.0))})
            self.cell.code("lease.release", client=PAGE)

    def object_pulls(self) -> None:
        self.cell.pull = self.rng.choice((0.0, 0.1, 0.2, 0.3, 0.44, 0.48))

    def sensor_fails(self) -> None:
        self.cell.state[self.rng.choice(("left", "right"))] = self.rng.choice(("good", "good", "overload", "silent"))
        self.disturbed_ns = self.cell.t_ns

    def all_is_well(self) -> None:
        cell = self.cell
        if cell.mute or "good" not in cell.state.values():
            self.disturbed_ns = cell.t_ns
        cell.state, cell.mute, cell.pull = {"left": "good", "right": "good"}, False, 0.0
        self.wait(self.rng.choice((500, 5000)))

    def something_breaks(self) -> None:
        cell, what = self.cell, self.rng.choice(("mute", "replug", "stall", "sleep"))
        self.disturbed_ns = cell.t_ns
        self.done[what] += 1
        if what == "mute":
            cell.mute = True
            self.wait(self.rng.choice((100, 600)))
            cell.mute = False
        elif what == "stall":
            cell.stall(self.rng.choice((60, 400)))
        else:
            getattr(cell, what)()

    def daemon_begins_anew(self) -> None:
        """A reload hands its state on; a daemon that was killed finds what was kept some time ago, or nothing."""
        cell = self.cell
        kept = cell.kept()
        what = self.rng.choice(("reload", "kill", "kill", "kill that kept nothing"))
        self.done[what] += 1
        if what == "kill":
            self.wait(self.rng.choice((0, 5, 100)))
        cell.let_lease_be()
        cell.restart(None if what.endswith("nothing") else kept)
        self.mu = {"left": MU, "right": MU}
        self.rising.renew()
        self.falling.renew()
        self.disturbed_ns = cell.t_ns

    STEPS = (
        *(holder_asks,) * 6, *(other_asks,) * 8, *(page_adjusts,) * 2, *(object_pulls,) * 3, sensor_fails,
        *(all_is_well,) * 2, peace, something_breaks, daemon_begins_anew, *(holder_grips_anew,) * 2,
    )  # fmt: skip

    # -- what must hold

    def wait(self, ms: int) -> None:
        for _ in range(0, ms, 5):
            self.cell.serve_gripper(5)
            self.look_at_jaws()

    def ask(self, client: bytes, op: str, fields: dict[str, Any]) -> None:
        cell, before_motion = self.cell, self.granted
        holder = cell.policy.lease.holder(cell.t_ns)
        self.granted = op if op in MOTIONS and client == holder else self.granted  # the wire is seen before the reply
        reply = cell.ask(op, client, **fields)
        self.done[f"{op} {'done' if reply['ok'] else reply['error']['code']}"] += 1
        if not reply["ok"]:
            self.granted = before_motion
            return
        if op.startswith("grip") or op == "fault.ack":
            assert client == holder, f"{client!r} was granted {op} without the lease"
        if op in ("gripper.open", "gripper.activate"):
            self.let_go = True
        if op == "friction.set" and client == holder:
            self.mu[fields["finger"]] = fields["mu_s"]

    def look_at_jaws(self) -> None:
        """What presses on the object changes by step and rate, until it is let go."""
        cell = self.cell
        self.note_pull()
        before_n, self.exerted_n = self.exerted_n, cell.jaws.grip_n
        if not before_n or not self.exerted_n:
            self.let_go = self.let_go and bool(self.exerted_n or before_n)
            self.rising, self.falling = Rates(RAISE_N_PER_S), Rates(LOWER_N_PER_S)
            return
        if self.let_go or self.exerted_n == before_n:
            return
        change_n = self.exerted_n - before_n
        self.done["raised" if change_n > 0 else "lowered"] += 1
        assert abs(change_n) <= STEP_N + EPS_N, f"{before_n} N to {self.exerted_n} N at once"
        allowance = self.rising if change_n > 0.0 else self.falling
        assert allowance.take(abs(change_n), cell.t_ns), f"{before_n} N to {self.exerted_n} N is too fast"

    def note_pull(self) -> None:
        if self.cell.pull != self.pulls[-1][1]:
            self.pulls.append((self.cell.t_ns, self.cell.pull))

    def look_at_act(self, body: dict[str, Any]) -> None:
        """The reflex acted: something true, or stated by the lease holder, must be the cause of a raise."""
        cell, act = self.cell, body["reflex"]
        self.done[f"reflex {act['reason']}"] += 1
        if act["force_n"] <= act["from_n"]:
            return
        self.note_pull()
        since_ns = cell.t_ns - AFTERMATH_NS
        before = [pull for t_ns, pull in self.pulls if t_ns <= since_ns][-1:]
        recent = before + [pull for t_ns, pull in self.pulls if t_ns > since_ns]
        in_danger = max(recent) / min(self.mu.values()) >= DANGER
        lets_go = any(after < pull for pull, after in itertools.pairwise(recent))
        assert in_danger or lets_go or self.disturbed_ns > since_ns, f"the reflex raises, {act}, without a true cause"


def walk(jaws: type[Peer], seed: int, seconds: float) -> Counter[str]:
    """Walk, and name the seed of what must not be."""
    one = Walk(jaws, seed)
    try:
        return one.run(seconds)
    except AssertionError as error:
        error.add_note(f"{jaws.__name__}, seed {seed}, {(one.cell.t_ns - T0) * 1e-9:.3f} s")
        raise
