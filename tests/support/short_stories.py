"""Record the story of the demo in five seconds of simulated time: the recordings ``demo`` and ``reflex`` of `replays`.

    PYTHONPATH=tests/support python -m short_stories FOLDER        write both recordings into a folder

The devices are slow, so that the recordings are small. The messages are not recorded.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from stepped_demo import PAD_HZ, SteppedDemo, recording_of, slow_config

from slipd.tools.shipped_files import shipped_config
from slipd.tools.sim.emulated_pvdf import PvdfElectronics
from slipd.tools.sim.robot_program import Plan, RobotProgram
from slipd.tools.sim.scene import Scene
from slipd.tools.sim.scene_parts import Script
from slipd.tools.sim.virtual_gripper import VirtualRig

SEED = 11
REFLEX = (  # no margin: the stated friction is the true one, and the reflex acts when the object slips
    ("mu = 0.55 ", "mu = 0.60 "),
    ("grip_safety = 2.0", "grip_safety = 1.0"),
    ("mu = 0.55\n", "mu = 0.60\n"),
    ("enabled = false", "enabled = true"),
    ("calm_s = 2.0", "calm_s = 0.2"),
    ("lower_n_per_s = 0.0", "lower_n_per_s = 1.0"),
)
PLAN = Plan(tare_s=0.1, close_s=0.6, speed_mps=0.15, open_s=4.0, end_s=4.2)
SCRIPT = Script(
    lift_s=1.0, ramp_s=0.2, pour_s=1.2, pour_until_s=2.1, drain_s=2.3, drain_takes_s=0.4, pour_n_per_s=1.5,
    tug_s=2.8, tug_stiffness_n_per_m=1500.0, set_down_s=3.7,
)  # fmt: skip
STORIES = {
    "demo": (SCRIPT, PLAN, ()),
    "reflex": (
        replace(SCRIPT, pour_until_s=1.75, tug_stiffness_n_per_m=750.0),
        replace(PLAN, limit_n=PLAN.force_n),  # it leaves every raise to the reflex
        REFLEX,
    ),
}
"""Loads over time, what the robot program does, and the changes of the shipped config of the demo."""


def record(name: str, path: Path, *, with_messages: bool) -> tuple[SteppedDemo, RobotProgram]:
    """Play a story into a recording."""
    script, plan, changes = STORIES[name]
    text = slow_config(shipped_config("demo.toml").read_text(encoding="utf-8"), *changes)
    rig = VirtualRig(Scene(script), SEED, PvdfElectronics(rate_hz=PAD_HZ))
    demo, program = SteppedDemo(rig, text, recording_of(path, text), with_messages), RobotProgram("", "", plan)
    demo.play(program)
    demo.finish()
    return demo, program


def main() -> int:
    """Write every recording."""
    parser = argparse.ArgumentParser(prog="python -m short_stories", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    folder = parser.parse_args().folder
    for name in STORIES:
        demo, program = record(name, folder / f"{name}.mcap", with_messages=False)
        begin_ns = demo.rig.began_ns or 0
        told = [f"{truth.t_s:.3f} s  {truth.event}" for truth in demo.rig.scene.truth]
        told += [
            f"{(c.t_ns - begin_ns) * 1e-9:.3f} s  {c.finger}: {c.level} {c.reasons}" for c in program.report.changes
        ]
        print(name, *sorted(told), sep="\n    ")
    return 0


if __name__ == "__main__":
    sys.exit(main())
