"""Tells the daemon which way is down while a person holds the gripper in a known pose."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Mapping

from slipd_client.errors import ClientError
from slipd_client.gravity_feed import PERIOD_S
from slipd_client.grip import GripClient
from slipd_client.keys import Keys

Gravities = Mapping[str, tuple[float, float, float]]


class GravityTeller:
    """Repeats ``gravity.set`` from a thread of its own, because a tare keeps the guide's own client waiting.

    A refusal or a stall is left out: it shows in the verdicts.
    """

    def __init__(self, requests: str | None, keys: Keys | None) -> None:
        self._requests, self._keys = requests, keys
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def tell(self, by_finger: Gravities) -> None:
        """Send each finger's gravity from now on: by finger, in its pad's frame, m/s²; an empty map sends nothing."""
        self.stop()
        if by_finger:
            self._ended.clear()
            self._thread = threading.Thread(target=self._work, args=(by_finger,), name="gravity", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Tell nothing any more."""
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
