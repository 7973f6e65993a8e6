"""How the guide reaches the daemon: endpoints and keys, gravity while a pose is held, and reasons of refusals."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from slipd.config import Config
from slipd.errors import SlipdError
from slipd_client import keys
from slipd_client.errors import ClientError, KeyFileError, RequestRefused, TareGivenUp
from slipd_client.gravity_feed import PERIOD_S
from slipd_client.grip import GripClient
from slipd_client.keys import Keys


@dataclass(frozen=True, slots=True)
class DaemonLink:
    """Endpoints of a daemon; None: the default ones. Keys are None where none are needed."""

    publish: str | None
    requests: str | None
    publish_keys: keys.Keys | None
    request_keys: keys.Keys | None


def link_to(
    rig: Config, publish: str | None, requests: str | None, key: Path | None, server_key: Path | None
) -> DaemonLink:
    """Return how to reach the daemon that runs a config.

    Args:
        rig: The config.
        publish: Where the daemon publishes; None: as the config states.
        requests: Where it accepts requests, likewise.
        key: File with the secret key of this client.
        server_key: File with the public key of the daemon; None: that beside the daemon's secret key.

    Raises:
        SlipdError: A key is needed and was not given, a file holds none, or a port is not known.
    """
    bus = rig.bus
    used = None
    if bus.readers is not None or bus.requesters is not None:
        if key is None:
            folders = " and ".join(dict.fromkeys(each for each in (bus.readers, bus.requesters) if each))
            raise SlipdError(
                "the daemon of this config admits only clients with keys: give --key FILE, the secret key of this "
                f"client, whose public key is in {folders} (slipctl keys new, docs/service.md)"
            )
        try:
            used = keys.load(key, server_key or Path(bus.secret_key or "").with_suffix(keys.PUBLIC_SUFFIX))
        except KeyFileError as error:
            raise SlipdError(f"{error}; the public key of the daemon is given with --server-key") from error
    elif key is not None or server_key is not None:
        raise SlipdError("the daemon of this config uses no keys; leave out --key and --server-key")
    return DaemonLink(
        _reachable(publish or bus.publish, "--publish"),
        _reachable(requests or bus.requests, "--requests"),
        used if bus.readers is not None else None,
        used if bus.requesters is not None else None,
    )


def _reachable(endpoint: str | None, option: str) -> str | None:
    """Return an endpoint to connect to, of one that may stand for all addresses of this machine."""
    if endpoint is None:
        return None
    if endpoint.startswith("tcp:") and endpoint.endswith(":*"):
        raise SlipdError(f"the config leaves the port of {endpoint} open: give {option} as slipd run printed it")
    return endpoint.replace("tcp://*:", "tcp://127.0.0.1:").replace("tcp://0.0.0.0:", "tcp://127.0.0.1:")


Gravities = Mapping[str, tuple[float, float, float]]


class GravitySender:
    """Repeats ``gravity.set`` from a thread of its own, because a tare keeps the guide's own client waiting.

    A refusal or a stall is left out: it shows in the verdicts.
    """

    def __init__(self, requests: str | None, keys: Keys | None) -> None:
        self._requests, self._keys = requests, keys
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, by_finger: Gravities) -> None:
        """Send each finger's gravity from now on: by finger, in its pad's frame, m/s²; an empty map sends nothing."""
        self.stop()
        if by_finger:
            self._ended.clear()
            self._thread = threading.Thread(target=self._work, args=(by_finger,), name="gravity", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Send nothing any more."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join()
        self._thread = None

    def _work(self, by_finger: Gravities) -> None:
        with GripClient(self._requests, keys=self._keys) as client:
            while not self._ended.is_set():
                with contextlib.suppress(ClientError):
                    for finger, gravity in by_finger.items():
                        client.gravity_set(finger, gravity)
                self._ended.wait(PERIOD_S)


TOO_BUSY = "the machine was too busy to answer in time: close other programs on it, and try again"
STATUS = "slipctl status says what is wrong"

LATE_CODES = frozenset({"deadline_passed", "deadline_too_far", "busy", "repeated_id"})
"""Codes of refusals on a machine that is too busy."""

INSTEAD = {
    "wrong_boot": "the daemon was restarted meanwhile: try again",
    "read_only": "the key may only read: name a key that the daemon lists under requesters, with --key",
    "no_lease": f"the right to move the gripper ended before the request arrived; {TOO_BUSY}",
    "lease_held": "another program controls the gripper: end that program, or wait until it lets go",
}
"""Text that replaces the message of a refusal, by its code."""

BESIDE = {
    "in_contact": "take away whatever touches the finger",
    "not_ready": STATUS,
    "no_gripper": STATUS,
    "gripper_fault": "look at the gripper; slipctl grip activate clears the fault of most",
    "not_active": "slipctl grip activate",
}
"""What to do, appended to the message of a refusal, by its code."""

TARES = {
    "contact": "something touched the finger: touch nothing, and leave it free",
    "pulled": "the finger was pulled at: is a cable taut, or the sign of the sensor wrong?",
    "moved": "the readings moved: hold the gripper still, away from machines that shake",
    "turned": "the finger was turned: hold the gripper still",
    "silent": f"the sensor sent nothing for half a second: is the machine busy, or a cable loose? {STATUS}",
    "ended": f"the sensor was cut off: are its cable and its power in place? {STATUS}",
    "undone": "another program took the zero back: end that program",
}
"""Cause and remedy of a tare that was given up, by its reason."""


def reason_of(error: ClientError) -> str:
    """Return why a request was not carried out, and what to do."""
    if isinstance(error, TareGivenUp) and error.reason in TARES:
        return TARES[error.reason]
    if not isinstance(error, RequestRefused):
        return str(error)
    if error.code in LATE_CODES:
        return TOO_BUSY
    if error.code in INSTEAD:
        return INSTEAD[error.code]
    return f"{error.message}; {BESIDE[error.code]}" if error.code in BESIDE else error.message
