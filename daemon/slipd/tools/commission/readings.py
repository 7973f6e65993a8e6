"""The readings of all fingers from the messages of the daemon, their means while nothing changes, and their noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from slipd.errors import SlipdError
from slipd.tools.commission.dialogue import AGAIN, SKIP, Ask, Choice, Prompt, Refusal, Reply, Skipped, Steps, choose
from slipd.tools.commission.touches import Mount, Noise
from slipd.types.arrays import Array
from slipd_client.friction_session import ElapsedTime
from slipd_client.messages.replies import HelloReply, StatusReply
from slipd_client.messages.topics import Message, Tactile, Wrench

LEAST_READINGS = 10
"""Fewest readings of a force sensor that make a mean."""

SILENCE_S = 10.0
"""Longest time without a message, s: the machine may be busy."""

ATTEMPTS, PAUSE_S = 20, 0.5
"""How often a request that changes nothing is sent, and the time between, s."""


@dataclass(slots=True)
class FingerReadings:
    """What the sensors of one finger read over some time.

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

        Where a finger has none, the guide says so, and goes on when the person has seen to it.

        Raises:
            Skipped: The person chose it.
            SlipdError: The daemon runs another config, or is silent.
        """
        while True:
            found = {name: FingerReadings() for name in self._fingers}
            if (yield from self._readings(partial(_add_reading, found, seconds), seconds + SILENCE_S)):
                return found
            silent = [name for name, each in found.items() if len(each.wrenches) < LEAST_READINGS]
            text = (
                f"Finger {', '.join(silent)} had no force readings for {seconds + SILENCE_S:g} s. slipctl status says "
                "why. Go on when they are back."
            )
            yield from choose(Prompt("readings_again", text, choices=(AGAIN, SKIP)))

    def check_config(self) -> Steps[None]:
        """See by the next messages that the daemon runs this config, before anything is asked of it.

        Raises:
            Skipped: The person chose it.
            SlipdError: The daemon runs another config, or is silent.
        """
        yield from self._readings(lambda *_: False, 0.0)

    def leave_out_earlier(self) -> Steps[None]:
        """Leave out readings from before now, by the daemon's clock: a busy machine delivers them later.

        Raises:
            Skipped: The person chose it.
            SlipdError: The daemon does not answer.
        """
        hello: HelloReply = yield from _answer("hello")
        self._newest_ns = max(self._newest_ns, hello.t_ns)

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
        while True:
            message = yield from next_message()
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


def next_message() -> Steps[Message]:
    """Return the next message of the daemon.

    Raises:
        Skipped: The person left the step out.
        SlipdError: The daemon is silent.
    """
    while (event := (yield None)) is not None:
        if isinstance(event, Choice) and event.word == SKIP:
            raise Skipped
        if isinstance(event, Message):
            return event
    raise SlipdError(f"no message from the daemon for {SILENCE_S:g} s. Is slipd running?")


def pause(seconds: float) -> Steps[None]:
    """Let time pass from now on by the daemon's clock; a busy machine delivers messages from before now later.

    Without that clock, the times of the messages of one topic count: those of a slow or stale stream lag behind others.

    Raises:
        Skipped: The person chose it.
        SlipdError: The daemon is silent.
    """
    answer = yield Ask("hello")
    until_ns = answer.result.t_ns + seconds * 1e9 if isinstance(answer, Reply) else math.inf
    longest_ns = (seconds if math.isinf(until_ns) else seconds + SILENCE_S) * 1e9
    began_ns: dict[str, int] = {}
    while True:
        message = yield from next_message()
        passed_ns = message.t_ns - began_ns.setdefault(message.topic, message.t_ns)
        if message.t_ns >= until_ns or passed_ns >= longest_ns:
            return


def read_status() -> Steps[StatusReply]:
    """Return the status of the daemon; a request may be lost while the daemon starts, so it is repeated.

    Raises:
        Skipped: The person chose it.
        SlipdError: The daemon does not report its status.
    """
    status: StatusReply = yield from _answer("status")
    return status


def _answer(method: str) -> Steps[Any]:
    """Return the answer to a request that changes nothing, which is repeated where it is refused."""
    reason = ""
    for _ in range(ATTEMPTS):
        answer = yield Ask(method)
        if isinstance(answer, Reply):
            return answer.result
        reason = answer.reason if isinstance(answer, Refusal) else reason
        yield from pause(PAUSE_S)
    raise SlipdError(f"the daemon does not answer: {reason}")


def _add_reading(found: dict[str, FingerReadings], seconds: float, message: Wrench | Tactile, passed_s: float) -> bool:
    """Add a reading; return whether ``seconds`` have passed and every finger has enough."""
    if isinstance(message, Tactile):
        if message.loads_n is not None:
            found[message.finger].images.append(np.array(message.loads_n))
    elif message.force_n is not None and message.torque_nm is not None:
        found[message.finger].wrenches.append(np.array((*message.force_n, *message.torque_nm)))
    return passed_s >= seconds and all(len(each.wrenches) >= LEAST_READINGS for each in found.values())


TOUCHED_N = 0.5
"""Readings that vary by more than this, N, are no noise: the finger was touched, or the gripper moved."""

LEAST_IMAGES = 20
"""Fewest images that show the noise of their taxels."""

NOISES_PER_THRESHOLD = 10.0
"""A threshold is this many times the noise of a taxel (docs/config.md)."""

POSITIVE_STD = math.sqrt(0.5 - 0.5 / math.pi)
"""Spread of the positive part of noise about zero, in standard deviations: an image shows no negative load. That of a
pad whose zero is off is larger, up to 1."""

NOISIEST = 0.9
"""Share of the taxels that are less noisy than the one whose noise counts: a broken one is masked, not averaged."""


def noise_at_rest(rest: FingerReadings, stated: Mount, found: Mount) -> Noise | None:
    """Return the noise of the sensors of one finger; None if it was not at rest, or its readings do not change at all.

    Args:
        rest: Readings while nothing touched.
        stated: Mounting of the force sensor by the config, with which they were published.
        found: Mounting that the config will state.
    """
    raw = np.linalg.solve(stated.matrix, np.array(rest.wrenches).T)
    force_std_n, torque_std_nm = _stds((found.matrix @ raw).T)
    if not (0.0 < force_std_n < TOUCHED_N and torque_std_nm > 0.0):
        return None
    return Noise(force_std_n, torque_std_nm, _threshold(rest))


def _stds(wrenches: Array) -> tuple[float, float]:
    """Return the largest standard deviation of a force and of a torque component about their linear trend."""
    times = np.linspace(-1.0, 1.0, len(wrenches))
    trend = np.outer(times, times @ wrenches / (times @ times))
    stds = np.std(wrenches - wrenches.mean(axis=0) - trend, axis=0, ddof=2)
    return float(stds[:3].max()), float(stds[3:].max())


def _threshold(rest: FingerReadings) -> float | None:
    if len(rest.images) < LEAST_IMAGES:
        return None
    stds = np.std(rest.images, axis=0) / POSITIVE_STD
    noisy = float(np.quantile(stds, NOISIEST))
    return NOISES_PER_THRESHOLD * noisy if noisy > 0.0 else None


def wait_for_restart(before_id: str, config_id: str, how: str, longest_s: float) -> Steps[None]:
    """Ask for a restart of the daemon, and wait until it runs a config.

    Args:
        before_id: Of the config that it runs until then.
        config_id: Of the config that it must run.
        how: What the person does so that the daemon reads it, for people.
        longest_s: How long to wait, s.

    Raises:
        SlipdError: The daemon does not run it in time or runs a third one, or the person does not want to wait.
    """
    yield Prompt("restart", f"{how} This goes on by itself when the daemon runs the new config.")
    elapsed, silent_s = ElapsedTime(), 0.0
    while elapsed.passed_s + silent_s < longest_s:
        event = yield None
        if event is None:
            silent_s += SILENCE_S
        elif isinstance(event, Choice) and event.word == SKIP:
            break
        elif isinstance(event, Message):
            if event.config_id == config_id:
                return
            if event.config_id not in (None, before_id):
                raise SlipdError("the file was changed after the guide wrote it; go on with --from and the next step")
            elapsed.update(event.t_ns * 1e-9)
    raise SlipdError("the daemon does not run the new config; start it, and go on with --from and the next step")
