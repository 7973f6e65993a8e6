"""Handlers of the requests that change the basis of verdicts: tares, gravity and friction.

The lease holder moves the gripper on these verdicts. While a client holds the lease, no other may make them more
lenient: a tare and its undo shift every force, and a larger μ makes a slipping grip look stable.
"""

from __future__ import annotations

from slipd.config import Requests
from slipd.events import Request
from slipd.finger.finger import Finger
from slipd.finger.finger_tares import Tares
from slipd.gripper.grip_policy import GripPolicy
from slipd.publish import replies
from slipd.publish.replies import Result
from slipd.requests.gripper_handlers import Handler
from slipd.signals.gravity import FRESH_NS, gravity_fault
from slipd.types.refusal import Refusal
from slipd_client.messages.schema.request_fields import SECONDS, STREAM, STREAM_OR_ALL, TARE_S

_GRIP_IN_FORCE = "a grip is in force, so a tare may erase the load of the held object"


class FingerHandlers:
    """Carry out the requests about a finger.

    Args:
        fingers: The fingers by name.
        policy: Keeps the lease.
        config: ``[requests]``.

    Attributes:
        ops: Handler of each op.
    """

    def __init__(self, fingers: dict[str, Finger], policy: GripPolicy, config: Requests) -> None:
        self._fingers = fingers
        self._policy = policy
        self._config = config
        self._gravity_from: dict[str, tuple[bytes, int]] = {}
        self.ops: dict[str, Handler] = {
            "tare": self._tare,
            "tare.get": self._tare_get,
            "tare.undo": self._tare_undo,
            "gravity.set": self._gravity_set,
            "friction.set": self._friction_set,
        }

    def _finger(self, request: Request) -> Finger | Refusal:
        name = request.body["finger"]
        finger = self._fingers.get(name)
        if finger is None:
            rule = f"finger must be one of {', '.join(self._fingers)}, got {name!r:.40}"
            return Refusal("unknown_finger", rule, "finger")
        return finger

    def _tares(self, request: Request, known: tuple[str, ...]) -> Tares | Refusal:
        """Return the streams of a finger that a request names."""
        finger = self._finger(request)
        if isinstance(finger, Refusal):
            return finger
        stream = request.body.get("stream")
        if stream not in (None, *known):
            return Refusal("out_of_range", f"stream must be one of {', '.join(known)}, got {stream!r:.40}", "stream")
        return Tares.of(finger, stream)

    def _tare(self, request: Request, t_ns: int) -> Result:
        tares = self._tares(request, STREAM_OR_ALL.words)
        if isinstance(tares, Refusal):
            return tares
        seconds = request.body.get("seconds", TARE_S)
        if not SECONDS.allows(seconds):
            return Refusal("out_of_range", f"seconds must be {SECONDS.number_range}, got {seconds:g}", "seconds")
        unloaded = request.body.get("unloaded", False)
        refusal = self._check_others_lease(request, t_ns, "tared") or tares.refuse(t_ns, unloaded=unloaded)
        if refusal is not None:
            return refusal
        if (self._policy.grips or self._policy.releasing) and not tares.verified:
            rule = f"{_GRIP_IN_FORCE}: finger {tares.finger.name} must be known to be free"
            return Refusal("in_contact", rule, "finger")
        verified = tares.verified
        tares.begin(t_ns, seconds, client_name(request.client), unloaded=unloaded)
        return replies.tare_begun(tares, seconds, verified=verified)

    def _tare_get(self, request: Request, _: int) -> Result:
        tares = self._tares(request, STREAM.words)
        return tares if isinstance(tares, Refusal) else replies.tare_in_use(tares)

    def _tare_undo(self, request: Request, t_ns: int) -> Result:
        tares = self._tares(request, STREAM.words)
        if isinstance(tares, Refusal):
            return tares
        refusal = self._check_others_lease(request, t_ns, "changed")
        if refusal is None and not tares.busy and tares.finger.is_pressed() is True:
            refusal = self._policy.lease.check(request.client, t_ns)
        return refusal or tares.undo() or replies.tare_in_use(tares)

    def _gravity_set(self, request: Request, t_ns: int) -> Result:
        finger = self._finger(request)
        if isinstance(finger, Refusal):
            return finger
        if finger.force is None:
            return Refusal(
                "not_ready", f"finger {finger.name} has no force sensor, so that its weight is not measured", "finger"
            )
        fault = gravity_fault(request.body["gravity_mps2"])
        if fault is not None:
            return Refusal("out_of_range", fault, "gravity_mps2")
        sender, sent_ns = self._gravity_from.get(finger.name, (request.client, t_ns))
        holder = self._policy.lease.holder(t_ns)
        if holder not in (None, request.client) and sender == holder and t_ns - sent_ns <= FRESH_NS:
            rule = f"the lease holder sends the gravity of finger {finger.name}: no other client may send it now"
            return Refusal("lease_held", rule, "gravity_mps2")
        self._gravity_from[finger.name] = request.client, t_ns
        finger.force.set_gravity(request.body["gravity_mps2"], t_ns)
        return replies.gravity_set(finger.force, t_ns)

    def _friction_set(self, request: Request, t_ns: int) -> Result:
        finger = self._finger(request)
        if isinstance(finger, Refusal):
            return finger
        mu_s = float(request.body["mu_s"])
        mu_d = float(request.body["mu_d"]) if "mu_d" in request.body else None
        refusal = _check_friction(finger, mu_s, mu_d) or self._check_lenience(request, finger, mu_s, mu_d, t_ns)
        if refusal is not None:
            return refusal
        finger.set_friction(mu_s, mu_d, client_name(request.client), t_ns)
        return replies.friction_set(finger)

    def _check_lenience(
        self, request: Request, finger: Finger, mu_s: float, mu_d: float | None, t_ns: int
    ) -> Refusal | None:
        """Refuse coefficients that make a verdict more lenient, unless the client holds the lease."""
        if self._config.friction_without_lease or not finger.friction.is_more_lenient(mu_s, mu_d):
            return None
        refusal = self._policy.lease.check(request.client, t_ns)
        if refusal is None:
            return None
        why = f"{_change(finger, mu_s)} makes the verdicts on finger {finger.name} more lenient"
        return Refusal(refusal.code, f"{why}: {lease_advice(self._policy, t_ns)}")

    def _check_others_lease(self, request: Request, t_ns: int, done: str) -> Refusal | None:
        """Refuse to change the readings by which another client moves the gripper."""
        if self._policy.lease.holder(t_ns) in (None, request.client):
            return None
        return Refusal("lease_held", f"another client holds the lease: only that client may have its sensors {done}")


def _check_friction(finger: Finger, mu_s: float, mu_d: float | None) -> Refusal | None:
    """Refuse coefficients out of range."""
    most = finger.config.most_mu
    if not 0.0 < mu_s <= most:
        rule = f"mu_s must be above 0 and at most {most:g}, the mu_max of finger {finger.name}, got {mu_s:g}"
        return Refusal("out_of_range", rule, "mu_s")
    if mu_d is not None and not 0.0 < mu_d <= mu_s:
        return Refusal("out_of_range", f"mu_d must be above 0 and at most mu_s, {mu_s:g}, got {mu_d:g}", "mu_d")
    return None


def _change(finger: Finger, mu_s: float) -> str:
    """Return what is more lenient about a coefficient, for people."""
    strictest = finger.friction.strictest
    if strictest is None:
        return f"mu_s {mu_s:g}, while no coefficient is stated,"
    return f"mu_s {mu_s:g} over {strictest:.3g}" if mu_s > strictest else "a lower mu_d"


def lease_advice(policy: GripPolicy, t_ns: int) -> str:
    """Return what a client without the lease may do about it, for people."""
    held = policy.lease.holder(t_ns) is not None
    return "another client holds the lease" if held else "acquire the lease first (lease.acquire)"


def client_name(client: bytes) -> str:
    """Return the name of a client for people: its key or its process, without the route that it chose itself."""
    return client.partition(b"\0")[0].decode(errors="replace")
