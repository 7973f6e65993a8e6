"""Sensors of two pads that push their readings to a daemon, and what presses on them."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import zmq

from slipd.devices.external import encode_reading
from slipd.signals.pad import PadGeometry

PERIOD_S = 0.02
HOT_N = 1.0

PADS = {
    "left": PadGeometry(4, 8, 0.004, 0.003, flip_x=True),
    "right": PadGeometry(8, 4, 0.004, 0.003, swap_xy=True),
}


@dataclass(frozen=True)
class Contact:
    """What presses on a finger.

    Attributes:
        loads_n: Load on each taxel in scan order, N.
        tangential_n: Tangential force on the finger.
        spin_nm: Torque about the pad's normal through the centroid of the loads.
    """

    loads_n: np.ndarray
    tangential_n: Sequence[float]
    spin_nm: float

    def wrench(self, pad: PadGeometry) -> tuple[np.ndarray, np.ndarray]:
        """Return force and torque about the pad's origin."""
        x, y = pad.positions()
        total_n = self.loads_n.sum()
        centroid_m = (*((x @ self.loads_n, y @ self.loads_n) / total_n), 0.0) if total_n > 0 else (0.0, 0.0, 0.0)
        force_n = np.array((*self.tangential_n, -total_n))
        return force_n, np.cross(centroid_m, force_n) + np.array((0.0, 0.0, self.spin_nm))


def held(pad: PadGeometry, tangential_n: tuple[float, float], spin_nm: float) -> Contact:
    """A contact of 10 N that is off the centre of the pad, with more load on one side."""
    x, y = pad.positions()
    loads = np.where((np.abs(x + 0.002) < 0.007) & (np.abs(y - 0.002) < 0.005), 1.0 + 60.0 * x + 40.0 * y, 0.0)
    return Contact(10.0 * loads / loads.sum(), tangential_n, spin_nm)


HELD = {"left": held(PADS["left"], (0.4, 1.2), 0.008), "right": held(PADS["right"], (0.4, -1.2), -0.008)}
"""An object in the grip."""


class Sensors(threading.Thread):
    """Pushes the readings of both fingers until it is stopped.

    Attributes:
        contacts: What presses on each finger; None: nothing.
        hot: Finger and index of a taxel that reads a load which does not exist; None: no taxel.
        silent: Nothing is sent.
    """

    def __init__(self, endpoint: str) -> None:
        super().__init__(name="sensors")
        self.contacts: dict[str, Contact | None] = {"left": None, "right": None}
        self.hot: tuple[str, int] | None = None
        self.silent = False
        self._endpoint = endpoint
        self._ended = threading.Event()

    def stop(self) -> None:
        self._ended.set()
        self.join()

    def run(self) -> None:
        noise = np.random.default_rng(1)
        with zmq.Context() as context, context.socket(zmq.PUSH) as push:
            push.setsockopt(zmq.LINGER, 0)
            push.setsockopt(zmq.SNDHWM, 10)
            push.connect(self._endpoint)
            while not self._ended.wait(PERIOD_S):
                for name, pad in PADS.items():
                    contact = self.contacts[name] or Contact(np.zeros(pad.taxels), (0.0, 0.0), 0.0)
                    force_n, torque_nm = contact.wrench(pad)
                    noisy = {
                        "force_n": force_n + 0.01 * noise.standard_normal(3),
                        "torque_nm": torque_nm + 0.0002 * noise.standard_normal(3),
                    }
                    loads_n = np.where(contact.loads_n > 0, contact.loads_n + 0.001 * noise.random(pad.taxels), 0.0)
                    if self.hot is not None and self.hot[0] == name:
                        loads_n[self.hot[1]] = HOT_N
                    if not self.silent:
                        t_ns = time.monotonic_ns()
                        with contextlib.suppress(zmq.Again):  # no daemon
                            push.send(encode_reading(f"{name}.pad", t_ns, values=loads_n), zmq.NOBLOCK)
                            push.send(encode_reading(f"{name}.wrench", t_ns, **noisy), zmq.NOBLOCK)
