"""Handler of the request that names the object, for which friction is learned."""

from __future__ import annotations

from slipd.config import Requests
from slipd.events import Request
from slipd.finger.finger import Finger
from slipd.grasp.named_object import NamedObject
from slipd.gripper.grip_policy import GripPolicy
from slipd.publish import replies
from slipd.publish.replies import Result
from slipd.requests.finger_handlers import client_name, lease_advice
from slipd.requests.gripper_handlers import Handler
from slipd.types.refusal import Refusal


class ObjectHandlers:
    """Name the object.

    Args:
        fingers: The fingers by name.
        named: Keeps the name.
        policy: Keeps the lease.
        config: ``[requests]``.

    Attributes:
        ops: Handler of each op.
    """

    def __init__(self, fingers: dict[str, Finger], named: NamedObject, policy: GripPolicy, config: Requests) -> None:
        self._fingers = fingers
        self._named = named
        self._policy = policy
        self._config = config
        self.ops: dict[str, Handler] = {"object.set": self._object_set}

    def _object_set(self, request: Request, t_ns: int) -> Result:
        name: str | None = request.body["name"]
        refusal = self._check_lenience(request, name, t_ns)
        if refusal is not None:
            return refusal
        self._named.set(name, client_name(request.client), t_ns)
        for finger in self._fingers.values():
            finger.friction.set_object(name)
        return replies.object_named(self._named, self._fingers)

    def _check_lenience(self, request: Request, name: str | None, t_ns: int) -> Refusal | None:
        """Refuse another name, unless the client holds the lease.

        Another name exchanges what was learned of friction for something else: a larger μ may be learned of the named
        object, and a smaller one may be forgotten.
        """
        if self._config.friction_without_lease or name == self._named.name:
            return None
        refusal = self._policy.lease.check(request.client, t_ns)
        if refusal is None:
            return None
        rule = "another name may make verdicts more lenient, as friction is learned for each"
        return Refusal(refusal.code, f"{rule}: {lease_advice(self._policy, t_ns)}")
