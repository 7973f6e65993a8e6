"""Handlers of the requests that change the basis of verdicts: tares, gravity, friction and the name of the object.

The lease holder moves the gripper on these verdicts. While a client holds the lease, no other may make them more
lenient: a tare and its undo shift every force, and a larger μ makes a slipping grip look stable.
"""

from __future__ import annotations

from slipd.events import Body, Request
from slipd.finger.finger import Finger
from slipd.finger.finger_tares import Tares
from slipd.gripper.lease import Lease
from slipd.publish import replies
from slipd.requests.motion_handlers import Handler
from slipd.rig import Rig
from slipd.signals.gravity import FRESH_NS, gravity_fault
from slipd.types.permit import RefusalError, require
from slipd_client.messages.request_fields import SECONDS, STREAM, STREAM_OR_ALL, TARE_S

_GRIP_IN_FORCE = "a grip is in force, so a tare may erase the load of the held object"
_OTHER_NAME = "another name may make verdicts more lenient, as friction is learned for each"


class FingerHandlers:
    """Carry out the requests about a finger, and about the object.

    Args:
        rig: The rig of this run.

    Attributes:
        ops: Handler of each op.
    """

    def __init__(self, rig: Rig) -> None:
        self._fingers, self._named, self._arm = rig.fingers, rig.named, rig.arm
        self._policy, self._config = rig.gripper.policy, rig.config.requests
        self._gravity_from: dict[str, tuple[bytes, int]] = {}
        self.ops: dict[str, Handler] = {
            "tare": self._tare,
            "tare.get": self._tare_get,
            "tare.undo": self._tare_undo,
            "gravity.set": self._gravity_set,
            "friction.set": self._friction_set,
            "object.set": self._object_set,
        }

    def _finger(self, request: Request) -> Finger:
        name = request.body["finger"]
        if name not in self._fingers:
            rule = f"finger must be one of {', '.join(self._fingers)}, got {name!r:.40}"
            raise RefusalError("unknown_finger", rule, "finger")
        return self._fingers[name]

    def _tares(self, request: Request, known: tuple[str, ...]) -> Tares:
        """Return the streams of a finger that a request names."""
        finger, stream = self._finger(request), request.body.get("stream")
        if stream not in (None, *known):
            rule = f"stream must be one of {', '.join(known)}, got {stream!r:.40}"
            raise RefusalError("out_of_range", rule, "stream")
        return Tares.of(finger, stream)

    def _tare(self, request: Request, t_ns: int) -> Body:
        tares = self._tares(request, STREAM_OR_ALL.words)
        seconds, unloaded = request.body.get("seconds", TARE_S), request.body.get("unloaded", False)
        if not SECONDS.allows(seconds):
            rule = f"seconds must be {SECONDS.number_range}, got {seconds:g}"
            raise RefusalError("out_of_range", rule, "seconds")
        self._check_others_lease(request, t_ns, "tared")
        require(tares.refuse(t_ns, unloaded=unloaded))
        verified = tares.verified
        if (self._policy.grips or self._policy.releasing) and not verified:
            rule = f"{_GRIP_IN_FORCE}: finger {tares.finger.name} must be known to be free"
            raise RefusalError("in_contact", rule, "finger")
        tares.begin(t_ns, seconds, client_name(request.client), unloaded=unloaded)
        return replies.tare_begun(tares, seconds, verified=verified)

    def _tare_get(self, request: Request, _: int) -> Body:
        return replies.tare_in_use(self._tares(request, STREAM.words))

    def _tare_undo(self, request: Request, t_ns: int) -> Body:
        tares = self._tares(request, STREAM.words)
        self._check_others_lease(request, t_ns, "changed")
        if not tares.busy and tares.finger.presence.is_pressed() is True:
            require(self._policy.lease.check(request.client, t_ns))
        require(tares.undo())
        return replies.tare_in_use(tares)

    def _gravity_set(self, request: Request, t_ns: int) -> Body:
        finger, gravity = self._finger(request), request.body["gravity_mps2"]
        if finger.force is None:
            rule = f"finger {finger.name} has no force sensor, so that its weight is not measured"
            raise RefusalError("not_ready", rule, "finger")
        if fault := gravity_fault(gravity):
            raise RefusalError("out_of_range", fault, "gravity_mps2")
        if self._arm is not None and self._arm.sets_gravity_of(finger.name, t_ns):
            rule = f"the arm stream ([grasp.arm]) gives the gravity of finger {finger.name}: no client may set it now"
            raise RefusalError("not_ready", rule, "gravity_mps2")
        sender, sent_ns = self._gravity_from.get(finger.name, (request.client, t_ns))
        holder = self._policy.lease.holder(t_ns)
        if holder not in (None, request.client) and sender == holder and t_ns - sent_ns <= FRESH_NS:
            rule = f"the lease holder sends the gravity of finger {finger.name}: no other client may send it now"
            raise RefusalError("lease_held", rule, "gravity_mps2")
        self._gravity_from[finger.name] = request.client, t_ns
        finger.force.set_gravity(gravity, t_ns)
        return replies.gravity_set(finger.force, t_ns)

    def _friction_set(self, request: Request, t_ns: int) -> Body:
        finger, mu_s = self._finger(request), float(request.body["mu_s"])
        mu_d = float(request.body["mu_d"]) if "mu_d" in request.body else None
        _check_friction(finger, mu_s, mu_d)
        if finger.friction.is_more_lenient(mu_s, mu_d):
            change = f"{_change(finger, mu_s)} makes the verdicts on finger {finger.name} more lenient"
            self._check_lenience(request, change, t_ns)
        finger.set_friction(mu_s, mu_d, client_name(request.client), t_ns)
        return replies.friction_set(finger)

    def _object_set(self, request: Request, t_ns: int) -> Body:
        """Name the object; another name exchanges what was learned of friction for something else."""
        name = request.body["name"]
        if name != self._named.name:
            self._check_lenience(request, _OTHER_NAME, t_ns)
        self._named.set(name, client_name(request.client), t_ns)
        for finger in self._fingers.values():
            finger.friction.set_object(name)
        return replies.object_named(self._named, self._fingers)

    def _check_lenience(self, request: Request, change: str, t_ns: int) -> None:
        """Refuse a change that makes a verdict more lenient, unless the client holds the lease."""
        if not self._config.friction_without_lease:
            require_lease(self._policy.lease, request, t_ns, change)

    def _check_others_lease(self, request: Request, t_ns: int, done: str) -> None:
        """Refuse to change the readings by which another client moves the gripper."""
        if self._policy.lease.holder(t_ns) not in (None, request.client):
            rule = f"another client holds the lease: only that client may have its sensors {done}"
            raise RefusalError("lease_held", rule)


def _check_friction(finger: Finger, mu_s: float, mu_d: float | None) -> None:
    """Refuse coefficients out of range."""
    most = finger.config.most_mu
    if not 0.0 < mu_s <= most:
        rule = f"mu_s must be above 0 and at most {most:g}, the mu_max of finger {finger.name}, got {mu_s:g}"
        raise RefusalError("out_of_range", rule, "mu_s")
    if mu_d is not None and not 0.0 < mu_d <= mu_s:
        raise RefusalError("out_of_range", f"mu_d must be above 0 and at most mu_s, {mu_s:g}, got {mu_d:g}", "mu_d")


def _change(finger: Finger, mu_s: float) -> str:
    """Return what is more lenient about a coefficient, for people."""
    strictest = finger.friction.strictest
    if strictest is None:
        return f"mu_s {mu_s:g}, while no coefficient is stated,"
    return f"mu_s {mu_s:g} over {strictest:.3g}" if mu_s > strictest else "a lower mu_d"


def require_lease(lease: Lease, request: Request, t_ns: int, why: str, free: str = "") -> None:
    """Go on if a client holds the lease; refuse otherwise, with why it needs it and what it may do.

    Raises:
        RefusalError: It does not.
    """
    refusal = lease.check(request.client, t_ns)
    if refusal is not None:
        held = lease.holder(t_ns) is not None
        advice = "another client holds the lease" if held else "acquire the lease first (lease.acquire)"
        raise RefusalError(refusal.code, f"{why}: {advice}{free}")


def client_name(client: bytes) -> str:
    """Return the name of a client for people: its key or its process, without the route that it chose itself."""
    return client.partition(b"\0")[0].decode(errors="replace")
