"""After the warm-up no reading waits for the compilation of a kernel."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.uncovered

SCRIPT = """
import sys
import numpy as np
from numba.core.dispatcher import Dispatcher
from slipd.finger.freshness import Read
from slipd import config
from slipd.engine.engine import Engine
from slipd.finger.finger import Finger
from slipd.publish.finger_messages import slip_body, tactile_body, wrench_body
from slipd.engine.warm_up import warm_up
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
def test_the_warm_up_compiles_every_kernel_that_any_reading_needs(left: str, right: str) -> None:
    """Fingers with and without torque, weight, drift and charge; pads of one axis and three, also mounted turned."""
    heavy = left.replace("stuck_after = 0", "mass_kg = 0.02\ncom_m = [0.0, 0.0, -0.01]\ndrift_tau_s = 10.0")
    charged = left.replace("threshold = 0.05", "threshold = 0.05\ncharge_tau_s = 2.0\ngain_error = 0.05")
    turned = [text.replace("pitch_m", "swap_xy = true\nflip_x = true\npitch_m") for text in (left, right)]
    texts = [left, right, heavy, charged, *turned, left.partition("[finger.left.pad]")[0]]
    run = [sys.executable, "-W", "error", "-c", SCRIPT, *texts]
    done = subprocess.run(run, env=os.environ, capture_output=True, text=True, check=False, timeout=100)
    assert done.returncode == 0, done.stderr[-3000:]
