"""The readings of all fingers from the messages of the daemon, and their means while nothing changes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from slipd.arrays import Array
from slipd.errors import SlipdError
from slipd_client.errors import hint_for
from slipd_client.messages.schema.topics import Tactile, Wrench
from slipd_client.subscriber import Subscriber

LISTEN_S = 0.2
LEAST_READINGS = 10
"""Readings of a mean."""

SILENCE_S = 5.0


@dataclass(slots=True)
class FingerReadings:
    """Sums over some time.

    Attributes:
        wrenches: Force and torque in the pad frame by the config, each shape (6,).
        images: Load on each taxel in scan order, each shape (taxels,).
    """

    wrenches: list[Array] = field(default_factory=list)
    images: list[Array] = field(default_factory=list)

    @property
    def wrench(self) -> Array:
        """Mean wrench, shape (6,)."""
        return np.asarray(np.mean(self.wrenches, axis=0))

    @property
    def image(self) -> Array | None:
        """Mean image; None if there was none."""
        return np.asarray(np.mean(self.images, axis=0)) if self.images else None


class ReadingListener:
    """Collects the readings of a daemon that runs one config.

    Args:
        subscriber: Receives the topics ``wrench`` and ``tactile``.
        fingers: Names of the fingers.
        config_id: Of the config that the daemon must run.
    """

    def __init__(self, subscriber: Subscriber, fingers: list[str], config_id: str) -> None:
        self._subscriber, self._fingers, self._config_id = subscriber, fingers, config_id

    def collect(self, seconds: float) -> dict[str, FingerReadings]:
        """Return the readings of at least ``seconds``, and of some messages of every finger.

        Raises:
            SlipdError: The daemon is silent, runs another config, or a force is not known.
        """
        until_s = time.monotonic() + seconds
        found = {name: FingerReadings() for name in self._fingers}
        while time.monotonic() < until_s or any(len(each.wrenches) < LEAST_READINGS for each in found.values()):
            self._add(self._receive(), found)
            if time.monotonic() > until_s + SILENCE_S:
                silent = [name for name, each in found.items() if len(each.wrenches) < LEAST_READINGS]
                raise SlipdError(f"finger {', '.join(silent)} has no force readings; see: slipctl status")
        return found

    def wait(self, condition: Callable[[dict[str, Array]], bool], seconds: float) -> bool:
        """Wait until the newest wrenches fulfil a condition; return False if they do not within ``seconds``."""
        newest: dict[str, Array] = {}
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            message = self._receive()
            if isinstance(message, Wrench) and message.force_n is not None and message.torque_nm is not None:
                newest[message.finger] = np.array((*message.force_n, *message.torque_nm))
                if len(newest) == len(self._fingers) and condition(newest):
                    return True
        return False

    @staticmethod
    def _add(message: Wrench | Tactile | None, found: dict[str, FingerReadings]) -> None:
        if message is None or message.finger not in found:
            return
        if isinstance(message, Tactile):
            if message.loads_n is not None:
                found[message.finger].images.append(np.array(message.loads_n))
        elif message.force_n is not None and message.torque_nm is not None:
            found[message.finger].wrenches.append(np.array((*message.force_n, *message.torque_nm)))

    def _receive(self) -> Wrench | Tactile | None:
        message = self._subscriber.receive(LISTEN_S)
        if message is None and self._subscriber.stale:
            where = self._subscriber.endpoint
            raise SlipdError(f"no message from {where}. {hint_for(where)}")
        if message is not None and message.config_id not in (None, self._config_id):
            raise SlipdError("the daemon runs another config than this file; start it with this file, or name its file")
        return message if isinstance(message, (Wrench, Tactile)) else None
