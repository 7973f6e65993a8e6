"""Record the story of the demo in five seconds of simulated time: the recordings ``demo`` and ``reflex`` of `replays`.

    PYTHONPATH=tests/support python -m short_stories FOLDER        write both recordings into a folder

The devices are slow, so that the recordings are small. The messages are not recorded.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

from demo_story import Story

from slipd import config
from slipd.engine.engine import Engine
from slipd.recording.mcap_file import RecordingFile
from slipd.tools.sim.emulated_pvdf import PvdfElectronics
from slipd.tools.sim.robot_program import Plan
from slipd.tools.sim.scene import Scene
from slipd.tools.sim.scene_parts import Script
from slipd.tools.sim.virtual_gripper import VirtualRig

BOOT, WALL_NS, SEED = "b", 1_790_000_000_000_000_000, 11
READY_S, BEGIN_S = 0.25, 0.4
PAD_HZ = 25.0
SLOW = (
    ("rate_hz = 200.0", f"rate_hz = {PAD_HZ}"),
    ("rate_hz = 800.0", "rate_hz = 200.0\noptions = { sinc_length = 256 }"),
    ("virtual/", "/run/rig/"),
)
RATES = "\n[rates]\nslip_hz = 20.0\nwrench_hz = 5.0\ntactile_hz = 5.0\ngrasp_hz = 4.0\nstatus_hz = 1.0\n"
REFLEX = (  # no margin: the stated friction is the true one, and the reflex acts when the object slips
    ("mu = 0.55 ", "mu = 0.60 "),
    ("grip_safety = 2.0", "grip_safety = 1.0"),
    ("mu = 0.55\n", "mu = 0.60\n"),
    ("enabled = false", "enabled = true"),
    ("calm_s = 2.0", "calm_s = 0.2"),
    ("lower_n_per_s = 0.0", "lower_n_per_s = 1.0"),
)


@dataclass(frozen=True)
class Short:
    """One of the stories.

    Attributes:
        script: Loads over time.
        plan: What the robot program does.
        heed: Whether it answers warnings.
        changes: Changes of the shipped config of the demo.
    """

    script: Script
    plan: Plan
    heed: bool
    changes: tuple[tuple[str, str], ...] = ()


PLAN = Plan(tare_s=0.1, close_s=0.6, speed_mps=0.15, open_s=4.0, end_s=4.2)
SCRIPT = Script(
    lift_s=1.0, ramp_s=0.2, pour_s=1.2, pour_until_s=2.1, drain_s=2.3, drain_takes_s=0.4, pour_n_per_s=1.5,
    tug_s=2.8, tug_stiffness_n_per_m=1500.0, set_down_s=3.7,
)  # fmt: skip
STORIES = {
    "demo": Short(SCRIPT, PLAN, heed=True),
    "reflex": Short(replace(SCRIPT, pour_until_s=1.75, tug_stiffness_n_per_m=750.0), PLAN, heed=False, changes=REFLEX),
}


def record(short: Short, path: Path) -> Story:
    """Play a story into a recording, and return it."""
    text = config.shipped("demo.toml").read_text(encoding="utf-8") + RATES
    for old, new in (*SLOW, *short.changes):
        text = text.replace(old, new)
    rig = VirtualRig(Scene(short.script), SEED, PvdfElectronics(rate_hz=PAD_HZ))
    engine = Engine(config.parse(text, path.name), boot=BOOT, wall_minus_monotonic_ns=WALL_NS)
    file = RecordingFile(path, config_text=text, boot=BOOT, wall_minus_monotonic_ns=WALL_NS)
    story = Story(rig, engine, BEGIN_S, short.plan, file)
    story.grip(READY_S)
    story.until(short.plan.open_s, heed=short.heed)
    story.release(short.plan.end_s)
    file.finish(story.events)
    return story


def main() -> int:
    """Write every recording."""
    parser = argparse.ArgumentParser(prog="python -m short_stories", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    folder = parser.parse_args().folder
    for name, short in STORIES.items():
        story = record(short, folder / f"{name}.mcap")
        told = [f"{truth.t_s:.3f} s  {truth.event}" for truth in story.rig.scene.truth]
        told += [f"{t_s:.3f} s  {body['finger']}: {body['level']} {body['reasons']}" for t_s, body in story.changes]
        print(name, *sorted(told), sep="\n    ")
    return 0


if __name__ == "__main__":
    sys.exit(main())
