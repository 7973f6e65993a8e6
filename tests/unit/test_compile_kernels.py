"""Kernels that the cache lacks are compiled with a message; the others are loaded silently, and no reading waits."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numba
import pytest

from slipd import compile_kernels


def test_compiling_is_announced_once_and_a_compiled_kernel_is_not(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    first, second = numba.njit(lambda x: x + 1), numba.njit(lambda x: x + 2)
    monkeypatch.setattr(compile_kernels, "warm_up", lambda: first(1) + second(1))
    for expected in ("compiling kernels, once (about a minute)\n", ""):
        compile_kernels.compile_kernels()
        assert capfd.readouterr() == ("", expected)


def test_the_message_ends_with_a_failure(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    kernel = numba.njit(lambda x: x + 3)

    def fail() -> None:
        kernel(1)
        raise RuntimeError("no LLVM")

    monkeypatch.setattr(compile_kernels, "warm_up", fail)
    with pytest.raises(RuntimeError, match="no LLVM"):
        compile_kernels.compile_kernels()
    assert capfd.readouterr().err == "compiling kernels, once (about a minute)\n"


def test_an_interrupt_while_compiling_ends_it_before_the_next_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel, reached = numba.njit(lambda x: x + 4), []

    def interrupted() -> None:
        signal.raise_signal(signal.SIGINT)
        reached.append("here")  # not at once: it may be in a callback
        kernel(1)
        reached.append("a further kernel")

    monkeypatch.setattr(compile_kernels, "warm_up", interrupted)
    before = signal.getsignal(signal.SIGINT)
    assert compile_kernels.main() == 130
    assert reached == ["here"]
    assert signal.getsignal(signal.SIGINT) is before


def test_an_interrupt_after_the_last_kernel_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_kernels, "warm_up", lambda: signal.raise_signal(signal.SIGINT))
    assert compile_kernels.main() == 130


def test_an_ignored_interrupt_stays_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_kernels, "warm_up", lambda: signal.raise_signal(signal.SIGINT))
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        assert compile_kernels.main() == 0
    finally:
        signal.signal(signal.SIGINT, before)


def test_kernels_are_compiled_in_any_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_kernels, "warm_up", lambda: None)
    with ThreadPoolExecutor(1) as other:
        assert other.submit(compile_kernels.main).result() == 0


SCRIPT = """
import sys
import numpy as np
from numba.core.dispatcher import Dispatcher
from slipd.finger.freshness import Read
from slipd import config
from slipd.engine.engine import Engine
from slipd.finger.finger import Finger
from slipd.publish.finger_messages import slip_body, tactile_body, wrench_body
from slipd.compile_kernels import warm_up
from slipd.types.samples import TactileSample, WrenchSample

def kernels():
    modules = [module for name, module in list(sys.modules.items()) if name.partition(".")[0] == "slipd"]
    found = {id(v): v for module in modules for v in vars(module).values() if isinstance(v, Dispatcher)}
    return {f"{v.__module__}.{v.__name__}": tuple(map(str, v.signatures)) for v in found.values()}

def feel(finger):
    for channel in (finger.force, finger.image):
        if channel is not None:
            channel.tare.observe(0)
    rng = np.random.default_rng(0)
    for k in range(100):
        t_ns = 100_000_000_000 + k * 10_000_000
        if finger.image is not None:
            pressed = rng.uniform(1500.0, 1600.0, finger.image.x.size)
            values = np.column_stack((pressed, pressed, 2 * pressed)) if finger.image.three_axis else pressed
            finger.update_image(TactileSample(t_ns, None, values))
            tactile_body(finger, finger.image)
        if finger.force is not None:
            torque = None if k % 3 == 0 else np.array((0.0, 0.0, 0.001))
            samples = [WrenchSample(t_ns, None, np.array((0.5, 0.0, -5.0 - n)), torque) for n in range(1 + k % 3)]
            for batch in finger.decide(Read(samples, [t_ns] * len(samples))):
                slip_body(finger, batch[-1]), wrench_body(finger, batch[-1])
        slip_body(finger, finger.state)

warm_up()
before = kernels()
assert len(before) > 20, before
for rule in ("matched", "binary", "grey"):
    for text in sys.argv[1:]:
        for name, finger in config.parse(text, "rig.toml").finger.items():
            finger = finger.model_copy(update={"load_rule": rule})
            feel(Finger(name, finger, config.Levels()))
new = {name: set(signatures) - set(before.get(name, ())) for name, signatures in kernels().items()}
new = {name: signatures for name, signatures in new.items() if signatures}
assert not new, new
"""


@pytest.mark.process
@pytest.mark.uncovered
def test_the_warm_up_compiles_every_kernel_that_any_reading_needs(left: str, right: str) -> None:
    """Fingers with and without torque, weight, drift and charge; pads of one axis and three, also mounted turned."""
    heavy = left.replace("stuck_after = 0", "mass_kg = 0.02\ncom_m = [0.0, 0.0, -0.01]\ndrift_tau_s = 10.0")
    charged = left.replace("threshold = 0.05", "threshold = 0.05\ncharge_tau_s = 2.0\ngain_error = 0.05")
    turned = [text.replace("pitch_m", "swap_xy = true\nflip_x = true\npitch_m") for text in (left, right)]
    texts = [left, right, heavy, charged, *turned, left.partition("[finger.left.pad]")[0]]
    run = [sys.executable, "-W", "error", "-c", SCRIPT, *texts]
    done = subprocess.run(run, env=os.environ, capture_output=True, text=True, check=False, timeout=100)
    assert done.returncode == 0, done.stderr[-3000:]
