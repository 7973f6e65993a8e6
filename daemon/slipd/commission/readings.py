"""The readings of all fingers from the messages of the daemon, and their means while nothing changes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field

import numpy as np

from slipd.arrays import Array
from slipd.errors import SlipdError
from slipd_client.messages.schema.topics import Message, Tactile, Wrench

LEAST_READINGS = 10
"""Readings of a mean."""

SILENCE_S = 10.0
"""Longest time without a message, s: the machine may be busy."""


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
    """Collects the readings of a daemon that runs one config, in the time of its readings.

    Args:
        receive: Returns the next message; None if none came for a while.
        fingers: Names of the fingers.
        config_id: Of the config that the daemon must run.
    """

    def __init__(self, receive: Callable[[], Message | None], fingers: Collection[str], config_id: str) -> None:
        self._receive, self._fingers, self._config_id = receive, fingers, config_id

    def collect(self, seconds: float) -> dict[str, FingerReadings]:
        """Return the readings of ``seconds``, or longer until every finger has some.

        Raises:
            SlipdError: The daemon runs another config, or a force is not known.
        """
        found = {name: FingerReadings() for name in self._fingers}
        begin_ns: int | None = None
        for message in self._readings(seconds + SILENCE_S):
            begin_ns = message.t_ns if begin_ns is None else begin_ns
            self._add(message, found)
            enough = all(len(each.wrenches) >= LEAST_READINGS for each in found.values())
            if enough and message.t_ns - begin_ns >= seconds * 1e9:
                return found
        silent = [name for name, each in found.items() if len(each.wrenches) < LEAST_READINGS]
        raise SlipdError(f"finger {', '.join(silent)} has no force readings; see: slipctl status")

    def wait(self, condition: Callable[[dict[str, Array]], bool], seconds: float) -> bool:
        """Wait until the newest wrenches fulfil a condition; return False if they do not within ``seconds``."""
        newest: dict[str, Array] = {}
        for message in self._readings(seconds):
            if isinstance(message, Wrench) and message.force_n is not None and message.torque_nm is not None:
                newest[message.finger] = np.array((*message.force_n, *message.torque_nm))
                if len(newest) == len(self._fingers) and condition(newest):
                    return True
        return False

    def _readings(self, seconds: float) -> Iterator[Wrench | Tactile]:
        """Yield the readings of some time, by their own times."""
        begin_ns: int | None = None
        while (message := self._receive()) is not None:
            if message.config_id not in (None, self._config_id):
                raise SlipdError("the daemon runs another config than this file; start it with this file")
            begin_ns = message.t_ns if begin_ns is None else begin_ns
            if message.t_ns - begin_ns > seconds * 1e9:
                return
            if isinstance(message, (Wrench, Tactile)) and message.finger in self._fingers:
                yield message
        raise SlipdError(f"no message from the daemon for {SILENCE_S:g} s. Is slipd running?")

    @staticmethod
    def _add(message: Wrench | Tactile, found: dict[str, FingerReadings]) -> None:
        if isinstance(message, Tactile):
            if message.loads_n is not None:
                found[message.finger].images.append(np.array(message.loads_n))
        elif message.force_n is not None and message.torque_nm is not None:
            found[message.finger].wrenches.append(np.array((*message.force_n, *message.torque_nm)))
