"""Load the kernels from Numba's cache, or compile them and show the progress; also ``python -m`` this module."""

from __future__ import annotations

import contextlib
import gc
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any, cast

import numpy as np
from numba.core import event

from slipd.config import Finger as FingerConfig
from slipd.config import Levels, Pad, Slip, Wrench
from slipd.finger.finger import Finger
from slipd.finger.force_image_check import COMPARE_NS, Agreement
from slipd.finger.freshness import Read
from slipd.finger.image_channel import ImageChannel
from slipd.fusion import contact_from_wrench
from slipd.fusion.compiled import KERNELS, PARTS
from slipd.fusion.contact_state import ContactState, WrenchUncertainty
from slipd.fusion.held_pad import HeldPad, tipping_edges, twist_net
from slipd.fusion.motion_limits import nearest_limit, worst_turn
from slipd.fusion.motion_scale import check_points, follow_gravity, largest_scales
from slipd.fusion.streaming import move_to_pad, new_readings
from slipd.grasp.object_swing import SwingEstimate, swing_excess
from slipd.io.progress import Progress
from slipd.motion.evidence import BLOCK_S
from slipd.motion.image_blocks import Block, ImageBlocks
from slipd.motion.image_fit import ImageComparison
from slipd.motion.image_shift import ImageShift
from slipd.signals.charge_reconstruction import ChargeReconstruction
from slipd.signals.pad import PadGeometry
from slipd.signals.taxel_blocks import BLOCK_NS, WINDOW
from slipd.signals.taxel_health import TaxelHealth
from slipd.types.arrays import Array
from slipd.types.samples import TactileSample, WrenchSample
from slipd_client.terminal import INTERRUPTED

PURPOSE = "compiling kernels, once"

COLLECT_EVERY = 50_000
"""New objects between two runs of the garbage collector: the compiler leaves next to nothing to collect, and at the
default threshold of Python the collector takes a fifteenth of the time."""


def compile_kernels() -> None:
    """Get every kernel ready; where the cache lacks some, show the progress on standard error.

    Raises:
        KeyboardInterrupt: SIGINT came, and is not ignored.
    """
    shown, collections = _Compilation(), gc.get_threshold()
    gc.set_threshold(COLLECT_EVERY)
    with interruptible():
        try:
            with event.install_listener("numba:compile", shown):
                warm_up()
        finally:
            gc.set_threshold(*collections)
            shown.progress.erase()


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Let Ctrl-C end a block that loads or compiles kernels: between two passes of the compiler, or after the block.

    Numba takes kernels from its cache, and stores them there, in callbacks from C. An exception in one of those is
    printed and dropped: the program goes on, or ends with SIGSEGV because a kernel has no code.

    In other threads than the main one, and where SIGINT is ignored, nothing is handled.

    Raises:
        KeyboardInterrupt: SIGINT came.
    """
    before = signal.getsignal(signal.SIGINT)
    if before in (None, signal.SIG_IGN) or threading.current_thread() is not threading.main_thread():
        yield
        return
    interrupt = _Interrupt()
    signal.signal(signal.SIGINT, interrupt.receive)
    try:
        with event.install_listener("numba:run_pass", interrupt):
            yield
    finally:
        signal.signal(signal.SIGINT, before)
    interrupt.deliver()


class _Interrupt(event.Listener):
    """SIGINT, from its arrival to the next pass of the compiler."""

    def __init__(self) -> None:
        self._received = False

    def receive(self, *_: object) -> None:
        """Handle the signal."""
        self._received = True

    def deliver(self) -> None:
        """Raise KeyboardInterrupt where the signal came."""
        if self._received:
            raise KeyboardInterrupt

    def on_start(self, _: Any) -> None:
        """Deliver it before a pass."""
        self.deliver()

    def on_end(self, _: Any) -> None:
        """Do nothing: an exception here would replace that of the pass."""


class _Compilation(event.Listener):
    """Count the kernels that are compiled; Numba reports only those that its cache lacks."""

    def __init__(self) -> None:
        self._ready: set[str] = set()
        self.progress = Progress(lambda done, of: f"{PURPOSE}: {done} of {of}")
        self._announced = False

    def on_start(self, _: Any) -> None:
        """Announce the first kernel: with the bar, or as a line where no terminal can show it."""
        if self._announced:
            return
        self._announced = True
        self.progress.show(0, len(KERNELS) + len(PARTS))
        if not sys.stderr.isatty():
            print(f"{PURPOSE} (about a minute)", file=sys.stderr, flush=True)

    def on_end(self, compiled: Any) -> None:
        """Count a kernel that is ready."""
        function = compiled.data["dispatcher"].py_func
        if function.__module__.partition(".")[0] == "slipd":  # and not a function of NumPy that a kernel calls
            self._ready.add(f"{function.__module__}.{function.__qualname__}")
        self.progress.show(len(self._ready), len(KERNELS) + len(PARTS))


def warm_up() -> None:
    """Call each kernel with arrays of the types that a run uses; with a warm cache this takes some 10 ms."""
    x, y = np.array((0.0, 0.01, 0.0, 0.01)), np.array((0.0, 0.0, 0.01, 0.01))
    move_to_pad(new_readings([(0.0,) * 6], [0]), ContactState(Levels(), Slip(), 0.0, 0.5).row)
    contact = contact_from_wrench((0.1, 0.0, -1.0), (0.0, 0.0, 0.001))
    Agreement(2, 2, 0.01, 0.5).update(0, contact, 0.02, x, y, np.ones(4))
    charge = ChargeReconstruction(4, 1.0)
    charge.update(np.zeros(4), 0.0, True)
    charge.update(np.ones(4), 0.01, False)
    health = TaxelHealth(2, 2)
    for k in range(WINDOW + 1):
        health.update(np.zeros(4), k * BLOCK_NS, None, None)
    _look_for_motion()
    _judge_contact()
    _advise_motion(x, y, np.full(4, 0.25))


def _judge_contact() -> None:
    """Judge a held object with a force sensor that measures torque, and with one that does not."""
    wrench = Wrench(device="bota", port="-", rate_hz=1000.0)
    pad = Pad(device="pvdf", port="-", rate_hz=100.0, rows=2, cols=2, pitch_m=0.01, electrode_m=0.005)
    finger = Finger("warm", FingerConfig(mu=0.5, wrench=wrench, pad=pad), Levels())
    for tare in (channel.tare for channel in (finger.force, finger.image) if channel is not None):
        tare.observe(0)  # without a known zero nothing is a contact
    for t_ns, torque in ((0, np.zeros(3)), (COMPARE_NS, None)):
        finger.update_image(TactileSample(t_ns, None, np.ones(4)))
        samples = [WrenchSample(k, None, np.array((0.1, 0.0, -1.0 - k)), torque) for k in range(3)]
        for read in (samples[:2], samples[2:]):  # readings that arrive together and alone take different paths
            for batch in finger.decide(Read(read, [sample.t_ns for sample in read])):
                batch[-1].needed_normal_n(finger.config)
    cast("ImageChannel", finger.image).shape()


def _look_for_motion() -> None:
    """Compare two blocks of images of a contact that rests."""
    geometry, noise = PadGeometry(2, 2, 0.01, 0.005), WrenchUncertainty(0.0, 0.0)
    shift, blocks = ImageShift(geometry, noise), ImageBlocks(geometry, noise)
    for k in range(9):
        t_ns, image, wrench = k * round(BLOCK_S * 1e9), np.ones(4), (0.1, 0.0, -1.0, 0.0, 0.0, 0.0)
        shift.update(t_ns, image, wrench)
        block = blocks.update(t_ns, image, wrench)
    rests = cast("Block", block)
    ImageComparison(geometry).shows_shift(rests, rests, np.zeros(3))


def _advise_motion(x: Array, y: Array, loads: Array) -> None:
    """Find the limits of the motion of an object between two pads."""
    net, halves = twist_net(x, y, loads, 0.005, 0.005), np.full(2, 0.5)
    edges = tipping_edges(x[[0, 1, 3, 2]], y[[0, 1, 3, 2]], 0.0, 0.0, 0.005)
    zero = np.zeros(3)
    pad = HeldPad(np.eye(3), zero, zero, zero, 1.0, halves, halves, halves, 0.5, 1.0, net, edges)
    each, rest = np.empty(net.shape[1]), np.zeros((1, 6))
    nearest_limit(pad, rest[0], 1.5, 3.0, np.empty(3))
    worst_turn(pad, np.zeros(3), 9.81, np.empty(3))
    largest_scales(pad, pad, rest[0], rest, 1.5, 1.0, each, np.empty(1))
    check_points(pad, pad, rest, rest, 1.5, each)
    follow_gravity(np.zeros((1, 10)), np.zeros(3), np.empty((1, 3)))
    swing_excess(np.zeros(1), np.zeros(1), 30.0, 0.0, np.empty((2, 1)))
    swing = SwingEstimate()
    for t_ns in (1, 2):
        swing.update(t_ns, 0.0, 0.0)


def main() -> int:
    """Get every kernel ready; return the exit code."""
    try:
        compile_kernels()
    except KeyboardInterrupt:
        return INTERRUPTED
    return 0


if __name__ == "__main__":
    sys.exit(main())
