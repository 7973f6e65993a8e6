"""Oracle of the request fuzzing: keeps its own record of what is allowed, and reports what was done beyond it.

It hears the requests that were granted, the readings that were delivered and the frames that reached the gripper; it
asks the daemon nothing. Where the daemon may know of something a moment later than this book, the book is the milder.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from fuzz.asking import FINGERS
from fuzz.hand import Said, Told, newtons
from fuzz.malformed import malformed

from slipd_client.messages.schema.ops import OPS

LEAST_N, MOST_N = 4.0, 22.0
STEP_N, RAISE_N_PER_S, LOWER_N_PER_S, BUDGET_N = 2.0, 10.0, 2.0, 8.0
CEILING_N, REFLEX_N_PER_S, REFLEX_STEP_N = 18.0, 50.0, 1.0
"""Of the reflex: the most it asks for, how fast it raises, and what it may add at once (20 ms of that)."""

MS = 1_000_000
LONGEST_LEASE_MS = 200

FRESH_NS = 50 * MS
"""No increase on readings older than this; the daemon may date a reading a little later than it was delivered."""

SILENCE_NS = 400 * MS
"""A gripper that was not heard for so long is taken for gone, and what it holds for unknown."""

PRESSES_N = 3.0
"""A finger that last felt so much is in contact, beyond all noise."""

MU, MOST_MU = 0.5, 1.0
"""Friction of the rig's config, and the most that may be set without another word of it: twice as much."""

EPS_N = 1e-6
MOST_TOLD = 50

FORCING = ("grip.set", "grip.adjust", "gripper.close")
NEEDS_LEASE = {op.name for op in OPS.values() if op.lease == "holder"}


@dataclass
class Allowance:
    """How much a force may still change: so much at once, and so much more with time."""

    rate_n_per_s: float
    most_n: float = STEP_N
    left_n: float = math.inf
    at_ns: int = 0

    def take(self, change_n: float, t_ns: int) -> bool:
        """Whether a change is within it; one that is, is taken from it."""
        self.left_n = min(self.most_n, self.left_n + self.rate_n_per_s * (t_ns - self.at_ns) * 1e-9)
        self.at_ns = t_ns
        self.left_n -= change_n
        return self.left_n >= -EPS_N


@dataclass
class Book:
    """What was granted so far.

    Attributes:
        violations: What was done beyond it, in words.
        granted: Op → requests that were granted.
        commands: Frames that told the gripper something.
        acts: Of the reflex.
        holder: Who holds the lease, as far as was granted.
    """

    violations: list[str] = field(default_factory=list)
    granted: dict[str, int] = field(default_factory=dict)
    commands: int = 0
    acts: int = 0
    holder: bytes | None = None
    said: Said | None = None
    held: bool = False
    fault: bool = False
    force_n: float | None = None
    grip_n: float | None = None
    _heard_ns: int = 0
    _until_ns: int = 0
    _ttl_ns: int = 0
    _last: Told | None = None
    _wire_n: float | None = None
    _slept: bool = False
    _zeros_known: bool = True
    _goal: str = ""
    _floor: int = 0
    _activations: int = 0
    _raised_n: Counter[str] = field(default_factory=Counter)
    _fault_seen: int = 0
    _asked_n: float = 0.0
    _reflex: Allowance = field(default_factory=lambda: Allowance(REFLEX_N_PER_S, REFLEX_STEP_N))
    _up: Allowance = field(default_factory=lambda: Allowance(RAISE_N_PER_S))
    _down: Allowance = field(default_factory=lambda: Allowance(LOWER_N_PER_S))
    _felt: dict[str, tuple[int, float, bool]] = field(default_factory=dict)
    _mu: dict[str, float] = field(default_factory=dict)
    _object: str | None = None

    def holder_at(self, t_ns: int) -> bytes | None:
        """Who holds the lease."""
        return self.holder if t_ns < self._until_ns else None

    @property
    def is_active(self) -> bool:
        """The gripper said so, and reported no fault: only another activation ends one."""
        return self.said is not None and self.said.active and not self.said.fault

    # -- what the daemon was told

    def restart(self) -> None:
        """The daemon starts anew: it knows of nothing, but what it commands must still be asked for."""
        self.end_lease()
        self.said, self.fault, self._slept = None, False, False
        self._fault_seen = 0
        self._felt.clear()
        self._mu.clear()
        self._object = None
        self._zeros_known = True  # until a finger is tared of which nobody knows what presses on it
        self._let_go()
        self._goal, self.force_n = "", None

    def end_lease(self) -> None:
        """What ends every lease has happened."""
        self.holder, self._until_ns = None, 0

    def sleep(self) -> None:
        """The host slept: the daemon learns of it by its next tick."""
        self._slept = True

    def tick(self) -> None:
        """The daemon heard of the time."""
        if self._slept:
            self._slept = False
            self.end_lease()
            self._felt.clear()

    def lose_gripper(self) -> None:
        """Its link went down."""
        self.end_lease()
        self.said = None
        self._let_go()

    def feel(self, finger: str, t_ns: int, normal_n: float, *, good: bool) -> None:
        """A reading was delivered."""
        self._felt[finger] = t_ns, normal_n, good

    def lose_finger(self, finger: str) -> None:
        """Its link went down."""
        self._felt.pop(finger, None)

    def hear(self, said: Said, t_ns: int) -> None:
        """A status of the gripper was delivered."""
        if t_ns - self._heard_ns > SILENCE_NS:
            self._let_go()
        self._heard_ns = t_ns
        began = said.active and said.fault not in (0, self._fault_seen)
        self.said, self.fault, self._fault_seen = said, self.fault or began, said.fault
        if not said.active or (self.held and not said.holds):
            self._let_go()
        elif said.holds and not self.held and self.grip_n is not None:
            self.held = True
            self._raised_n.clear()
            self._up, self._down = Allowance(RAISE_N_PER_S), Allowance(LOWER_N_PER_S)

    def _let_go(self) -> None:
        """The grasp ended: the first force of the next one meets the absolute limits alone."""
        self.held, self.grip_n, self._wire_n = False, None, None

    # -- what the daemon granted

    def grant(self, client: bytes, body: dict[str, Any], boot: str, result: dict[str, Any], t_ns: int) -> None:
        """A request that is no repetition was granted."""
        op = body.get("op")
        self.granted[str(op)] = self.granted.get(str(op), 0) + 1
        fault = malformed(body, boot, t_ns)
        if fault:
            self._blame(t_ns, f"granted although {fault}: {body!r:.200}")
            return
        assert isinstance(op, str)
        if op in NEEDS_LEASE and (client != self.holder or t_ns >= self._until_ns):
            self._blame(t_ns, f"{op} granted to {client!r}, which holds no lease ({self.holder!r} does)")
        if op == "lease.acquire":
            self._acquire(client, body["ttl_ms"], t_ns)
        elif op == "lease.renew":
            self._until_ns = t_ns + self._ttl_ns
        elif op == "lease.release":
            self.end_lease()
        elif op in ("tare", "tare.undo"):
            if self.holder not in (None, client) and t_ns < self._until_ns:
                self._blame(t_ns, f"{op} granted to {client!r} while {self.holder!r} steers")
            if op == "tare" and not result.get("verified"):
                self._zeros_known = False
        elif op == "friction.set":
            self._rub(client, body, t_ns)
        elif op == "object.set":
            self._name(client, body["name"], t_ns)
        elif op == "fault.ack":
            self.fault = False
        elif op in FORCING or op.startswith("gripper.") or op == "grip.hold":
            self._command(op, body, result, t_ns)

    def _rub(self, client: bytes, body: dict[str, Any], t_ns: int) -> None:
        finger, mu = body["finger"], float(body["mu_s"])
        held = client == self.holder and t_ns < self._until_ns
        if mu > MOST_MU or (mu > self._mu.get(finger, MU) and not held):
            self._blame(t_ns, f"mu_s {mu} of {finger} granted to {client!r}, over {self._mu.get(finger, MU)}")
        self._mu[finger] = mu

    def _name(self, client: bytes, name: str | None, t_ns: int) -> None:
        if name != self._object and (client != self.holder or t_ns >= self._until_ns):
            self._blame(t_ns, f"object.set {name!r} granted to {client!r}, which holds no lease, over {self._object!r}")
        self._object = name

    def _acquire(self, client: bytes, ttl_ms: int, t_ns: int) -> None:
        if self.holder not in (None, client) and t_ns < self._until_ns:
            self._blame(t_ns, f"the lease of {self.holder!r} was given to {client!r}")
        if not 0 < ttl_ms <= LONGEST_LEASE_MS:
            self._blame(t_ns, f"a lease of {ttl_ms} ms was given")
        self.holder, self._ttl_ns = client, ttl_ms * MS
        self._until_ns = t_ns + self._ttl_ns

    def _command(self, op: str, body: dict[str, Any], result: dict[str, Any], t_ns: int) -> None:
        if op == "gripper.activate":
            self._activations += 2  # a frame that ends the old one, and one that begins the new one
            self._goal, self.force_n = op, None
            self._let_go()
            return
        said = self.said
        stops = op in ("gripper.stop", "grip.hold")
        if (said is None or not said.active) and not (stops and self._activations > 0):  # it takes that back
            self._blame(t_ns, f"{op} granted on a gripper that is not active, or not there")
        if stops:
            self._goal = op if op == "gripper.stop" else self._goal
        if stops or said is None or not said.active:
            return
        if self.fault or said.fault:
            self._blame(t_ns, f"{op} granted although a fault stands that nobody acknowledged")
        self._floor = 0 if op == "gripper.open" else said.position - 1
        if op == "gripper.open":
            if (
                self._zeros_known
                and not body.get("drop")
                and any(normal_n > PRESSES_N for _, normal_n, _ in self._felt.values())
            ):
                self._blame(t_ns, "opened in contact without drop")
            self._goal, self.force_n = op, result.get("applied_n")
            self._let_go()
            return
        self._goal = op if op == "gripper.close" else self._goal
        self._force(op, body, result, t_ns)

    def _force(self, op: str, body: dict[str, Any], result: dict[str, Any], t_ns: int) -> None:
        applied_n = result.get("applied_n")
        if not isinstance(applied_n, float) or not math.isfinite(applied_n):
            self._blame(t_ns, f"{op} granted, and applied_n is {applied_n!r}")
            return
        asked_n = body.get("force_n", min(max(applied_n, LEAST_N), MOST_N))
        if not LEAST_N <= asked_n <= MOST_N or not LEAST_N - EPS_N <= applied_n <= asked_n + EPS_N:
            self._blame(t_ns, f"{op}: {asked_n} N asked for, {applied_n} N applied")
        change_n = self._change_to(applied_n)
        if change_n > EPS_N:
            self._look_for_blindness(op, change_n, t_ns)
        if self.held:
            self._change(op, change_n, t_ns)
        self.force_n = self.grip_n = self._asked_n = applied_n

    def react(self, act: dict[str, Any], applied_n: Any, t_ns: int) -> None:
        """The reflex told that it acted."""
        self.acts += 1
        asked_n = act["force_n"]
        if self.said is None or not self.said.active or self.said.fault or self.fault:
            self._blame(t_ns, f"the reflex acts on a gripper that is not ready: {self.said}, fault {self.fault}")
            return
        if (
            not isinstance(applied_n, float)
            or not LEAST_N - EPS_N <= applied_n <= asked_n + EPS_N <= CEILING_N + 2 * EPS_N
        ):
            self._blame(t_ns, f"the reflex asks for {asked_n} N, {applied_n} N applied")
            return
        change_n = self._change_to(applied_n)
        if change_n > EPS_N:
            self._look_for_blindness("the reflex", change_n, t_ns)
            if not self._reflex.take(change_n, t_ns):
                self._blame(t_ns, f"the reflex raised by {change_n:.3f} N, faster than {REFLEX_N_PER_S:g} N/s")
        elif change_n < 0.0 and applied_n < min(self._asked_n, self._wire_n or 0.0) - EPS_N:
            self._blame(t_ns, f"the reflex lowered to {applied_n:.3f} N, below the {self._asked_n:.3f} N asked for")
        if self.held:
            self._change("the reflex", change_n, t_ns)
        self.force_n = self.grip_n = applied_n

    def _change_to(self, applied_n: float) -> float:
        """By how much the force leaves what lies between the one granted last and the one sent last.

        A stop, a stall or a sleep may have dropped what was granted since; where nothing was sent, all of it.
        """
        before = [applied_n if force_n is None else force_n for force_n in (self.grip_n, self._wire_n)]
        return applied_n - min(max(applied_n, min(before)), max(before))

    def _spend(self, who: str, change_n: float, t_ns: int) -> None:
        """What all raises of one grasp by requests, and by the reflex, add up to is bounded."""
        budget = "the reflex" if who == "the reflex" else "requests"
        self._raised_n[budget] += change_n
        if self._raised_n[budget] > BUDGET_N + EPS_N:
            self._blame(t_ns, f"{who} raised one grasp by {self._raised_n[budget]:.3f} N in all")

    def _change(self, op: str, change_n: float, t_ns: int) -> None:
        """The force on a held object changes."""
        if abs(change_n) > STEP_N + EPS_N:
            self._blame(t_ns, f"{op} changed the grip by {change_n:.3f} N in one step")
        if change_n > 0.0:
            if not self._up.take(change_n, t_ns):
                self._blame(t_ns, f"{op} raised faster than {RAISE_N_PER_S:g} N/s")
            self._spend(op, change_n, t_ns)
        elif change_n < 0.0 and not self._down.take(-change_n, t_ns):
            self._blame(t_ns, f"{op} lowered faster than {LOWER_N_PER_S:g} N/s")

    def _look_for_blindness(self, op: str, change_n: float, t_ns: int) -> None:
        for finger in FINGERS:
            felt_ns, _, good = self._felt.get(finger, (0, 0.0, False))
            if not good or t_ns - felt_ns > FRESH_NS:
                age_ms = (t_ns - felt_ns) * 1e-6
                self._blame(t_ns, f"{op} raised by {change_n:.3f} N on {finger}: good {good}, {age_ms:.1f} ms old")

    # -- what reached the gripper

    def write(self, told: Told, t_ns: int) -> None:
        """A frame told the gripper something."""
        self.commands += 1
        if told.reserved:
            self._blame(t_ns, f"reserved bits are set: {told}")
        if told == self._last and not told.goes:
            return  # a command that was not acknowledged is sent again
        self._last = told
        if told.activates or (told.goes is False and self._activations and len(told.addresses) == 3):
            self._activations -= 1
            if self._activations < 0:
                self._blame(t_ns, f"activated, and nobody asked for it: {told}")
            return
        force_n = newtons(told.force)
        if told.goes or told.forces:
            if force_n > MOST_N + EPS_N:
                self._blame(t_ns, f"{force_n:.2f} N on the wire, more than {MOST_N:g}")
            wanted_n, self._wire_n = self.force_n, force_n
            if self._goal != "gripper.open" and (wanted_n is None or abs(force_n - wanted_n) > EPS_N):
                self._blame(t_ns, f"{force_n:.3f} N on the wire, and {wanted_n} N were granted last")
        if told.goes and self._goal not in ("gripper.close", "gripper.open"):
            self._blame(t_ns, f"moves, and the last that was granted is {self._goal!r}")
        if told.goes and told.position < self._floor:
            self._blame(t_ns, f"opens to {told.position} from {self._floor + 1}, and nobody asked for it")

    def _blame(self, t_ns: int, what: str) -> None:
        if len(self.violations) < MOST_TOLD:
            self.violations.append(f"at {t_ns * 1e-9:.4f} s: {what}")
