"""The readings of all fingers from the messages of the daemon, and their means while nothing changes."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field

import numpy as np

from slipd.arrays import Array
from slipd.commission.dialogue import SKIP, Choice, Refusal, Reply, Skipped, Steps, ask
from slipd.errors import SlipdError
from slipd_client.elapsed_time import ElapsedTime
from slipd_client.messages.schema.replies import StatusReply
from slipd_client.messages.schema.topics import Message, Tactile, Wrench

LEAST_READINGS = 10
"""Readings of a mean."""

SILENCE_S = 10.0
"""Longest time without a message, s: the machine may be busy."""

STATUS_ATTEMPTS, STATUS_PAUSE_S = 20, 0.5
"""How often the daemon is asked for its status, and the time between, s."""


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
    """Collects the readings of a daemon that runs one config, in the time of its readings; its methods are steps.

    Args:
        fingers: Names of the fingers.
        config_id: Of the config that the daemon must run.
    """

    def __init__(self, fingers: Collection[str], config_id: str) -> None:
        self._fingers, self._config_id = fingers, config_id
        self._newest_ns = 0

    def collect(self, seconds: float) -> Steps[dict[str, FingerReadings]]:
        """Return the readings of ``seconds``, or longer until every finger has some.

        Raises:
            Skipped: The person chose it.
            SlipdError: The daemon runs another config or is silent, or a force is not known.
        """
        found = {name: FingerReadings() for name in self._fingers}

        def enough(message: Wrench | Tactile, passed_s: float) -> bool:
            _add(message, found)
            return passed_s >= seconds and all(len(each.wrenches) >= LEAST_READINGS for each in found.values())

        if (yield from self._readings(enough, seconds + SILENCE_S)):
            return found
        silent = [name for name, each in found.items() if len(each.wrenches) < LEAST_READINGS]
        raise SlipdError(f"finger {', '.join(silent)} has no force readings; see: slipctl status")

    def leave_out_earlier(self) -> Steps[None]:
        """Leave out readings from before now, by the daemon's clock: a busy machine delivers them later."""
        answer = yield ask("hello")
        if isinstance(answer, Reply):
            self._newest_ns = max(self._newest_ns, answer.result.t_ns)

    def wait(self, condition: Callable[[dict[str, Array]], bool], seconds: float) -> Steps[bool]:
        """Wait until the newest wrenches fulfil a condition; return False if they do not within ``seconds``.

        Raises:
            Skipped: The person chose it.
            SlipdError: The daemon runs another config, or is silent.
        """
        newest: dict[str, Array] = {}

        def met(message: Wrench | Tactile, _passed_s: float) -> bool:
            if not isinstance(message, Wrench) or message.force_n is None or message.torque_nm is None:
                return False
            newest[message.finger] = np.array((*message.force_n, *message.torque_nm))
            return len(newest) == len(self._fingers) and condition(newest)

        return (yield from self._readings(met, seconds))

    def _readings(self, done: Callable[[Wrench | Tactile, float], bool], seconds: float) -> Steps[bool]:
        """Pass on readings from now on, and the time since the first, until it is done; return False after ``seconds``.

        Streams lag by different times: a reading that is older than one that came before this call is left out.
        """
        elapsed, begin_ns = ElapsedTime(), self._newest_ns
        while (message := (yield None)) is not None:
            if isinstance(message, Choice) and message.word == SKIP:
                raise Skipped
            if not isinstance(message, Message):
                continue
            if message.config_id not in (None, self._config_id):
                raise SlipdError("the daemon runs another config than this file; start it with this file")
            self._newest_ns = max(self._newest_ns, message.t_ns)
            passed_s = elapsed.update(message.t_ns * 1e-9)
            if passed_s > seconds:
                return False
            if message.t_ns < begin_ns or not isinstance(message, (Wrench, Tactile)):
                continue
            if message.finger in self._fingers and done(message, passed_s):
                return True
        raise silence()


def pause(seconds: float) -> Steps[None]:
    """Let time pass, by the times of the messages of one topic: those of a slow or stale stream lag behind others.

    Raises:
        Skipped: The person chose it.
        SlipdError: The daemon is silent.
    """
    began_ns: dict[str, int] = {}
    while (event := (yield None)) is not None:
        if isinstance(event, Choice) and event.word == SKIP:
            raise Skipped
        if isinstance(event, Message) and event.t_ns - began_ns.setdefault(event.topic, event.t_ns) >= seconds * 1e9:
            return
    raise silence()


def read_status() -> Steps[StatusReply]:
    """Return the status of the daemon; a request may be lost while the daemon starts, so it is repeated.

    Raises:
        Skipped: The person chose it.
        SlipdError: The daemon does not report its status.
    """
    reason = ""
    for _ in range(STATUS_ATTEMPTS):
        answer = yield ask("status")
        if isinstance(answer, Reply):
            status: StatusReply = answer.result
            return status
        reason = answer.reason if isinstance(answer, Refusal) else reason
        yield from pause(STATUS_PAUSE_S)
    raise SlipdError(f"the daemon does not report its status: {reason}")


def silence() -> SlipdError:
    """Return the error of a daemon that says nothing."""
    return SlipdError(f"no message from the daemon for {SILENCE_S:g} s. Is slipd running?")


def _add(message: Wrench | Tactile, found: dict[str, FingerReadings]) -> None:
    if isinstance(message, Tactile):
        if message.loads_n is not None:
            found[message.finger].images.append(np.array(message.loads_n))
    elif message.force_n is not None and message.torque_nm is not None:
        found[message.finger].wrenches.append(np.array((*message.force_n, *message.torque_nm)))
