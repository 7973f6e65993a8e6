"""The scene ``carry`` in simulated time: its robot program, the engine and the virtual gripper are the real ones."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from advice.safe_speed import holds_scale
from stepped_demo import PAD_HZ, SteppedDemo, recording_of, slow_config

from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd.tools.demo_summary import print_summary
from slipd.tools.shipped_files import shipped_config
from slipd.tools.sim import carry
from slipd.tools.sim.carry import (
    CARRY_PLAN,
    FLOOR,
    GLASS_KG,
    GRIP_N,
    HANDOVER_S,
    PATH,
    Arm,
    CarryProgram,
    CarryScript,
    Move,
    carry_config,
)
from slipd.tools.sim.emulated_pvdf import PvdfElectronics
from slipd.tools.sim.scene import GripCommand
from slipd.tools.sim.virtual_gripper import VirtualRig, carried_rig
from slipd_client.messages import encode

MU = 0.6
STEP_S = 0.00125


def slides(rig: VirtualRig) -> int:
    """Return how often the glass has slid."""
    return sum(event.event == "slide_begins" for event in rig.scene.truth)


def carried_through(scales: list[float]) -> VirtualRig:
    """Return the rig at the end of the path, without sensors and daemon."""
    rig, t_s = carried_rig(), 0.0
    while rig.arm.begun < len(PATH) or not rig.arm.arrived(t_s):
        t_s += STEP_S
        rig.scene.step(t_s, GripCommand(0.0, 0.05, GRIP_N))
        if t_s > 1.5 and rig.arm.begun < len(PATH):
            rig.arm.begin(t_s, scales[rig.arm.begun])
    return rig


def test_at_full_speed_the_glass_slips_and_at_the_fastest_safe_speed_it_does_not() -> None:
    limits = [holds_scale(move, GLASS_KG, GRIP_N, MU) for move in PATH]
    assert min(limits) < 0.9
    assert max(limits) == 1.0, "not every move must be slowed down"
    assert slides(carried_through([1.0] * len(PATH))) > 0
    assert slides(carried_through([0.97 * limit for limit in limits])) == 0


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_a_move_ends_at_rest_at_its_place_and_the_stream_has_its_motion(scale: float) -> None:
    move, step_s = Move("both", 0.4, -0.2, 0.6), 1e-4
    times = np.arange(0.0, 0.6 / scale, step_s)
    speeds = np.cumsum(np.array([move.acceleration(float(t_s), scale) for t_s in times]), axis=0) * step_s
    assert speeds[-1] == pytest.approx([0.0, 0.0], abs=1e-3)
    assert speeds.sum(axis=0) * step_s == pytest.approx([0.4, -0.2], abs=1e-3)
    arm = Arm((move, move, move))
    arm.begin(0.0, 1.0)
    arm.begin(0.1, 1.0)
    assert arm.begun == 1, "it still moves"
    at_s = move.takes_s / (carry.POINTS - 1)
    x, z = arm.acceleration(HANDOVER_S + at_s)
    assert move.points()[1][1:4] == pytest.approx(arm.reading(HANDOVER_S + at_s)["gravity_mps2"])
    assert arm.reading(HANDOVER_S + at_s)["gravity_mps2"] == pytest.approx([-x, 0.0, 9.80665 + z])


def test_the_table_hands_the_glass_over_before_the_first_move_and_takes_it_after_the_last() -> None:
    arm = Arm(PATH[:2])
    assert arm.carried(0.0) == 0.0
    arm.begin(0.0, 1.0)
    assert arm.carried(HANDOVER_S / 2) == pytest.approx(0.5)
    end_s = HANDOVER_S + PATH[0].takes_s
    arm.begin(end_s, 1.0)
    assert arm.carried(end_s) == 1.0
    assert arm.carried(end_s + PATH[1].takes_s + HANDOVER_S / 2) == pytest.approx(0.5)
    assert arm.arrived(end_s + PATH[1].takes_s + HANDOVER_S + 1e-9)


@pytest.mark.parametrize(
    ("reply", "scale", "why"),
    [
        ({"time_scale": 0.7, "mode": "translation", "finger": "left"}, 0.7, "translation of left limits it"),
        ({"time_scale": 1.0}, 1.0, "the grip holds it"),
        ({"time_scale": 0.0, "unknown": None}, FLOOR, "the grip hardly holds it at rest"),
        ({"time_scale": None, "unknown": "nothing is held"}, FLOOR, "nothing is held"),
    ],
)
def test_a_move_is_as_fast_as_slipd_says_and_slow_where_it_does_not_know(
    reply: dict[str, Any], scale: float, why: str
) -> None:
    client: Any = SimpleNamespace(motion_check=lambda _: reply)
    assert CarryProgram("", "", print, int, advised=True)._advice(client, PATH[0]) == (scale, why)


def carry_once(demo: SteppedDemo, path: tuple[Move, ...]) -> CarryProgram:
    """Carry the glass along a path as slipd advises, without a slip, and let it go."""
    scene = demo.rig.scene
    arm = demo.rig.arm = Arm(path)
    scene.script = CarryScript(arm=arm)
    program = CarryProgram(
        "",
        "",
        lambda scale: arm.begin(scene.t_s, scale),
        lambda: arm.begun - (not arm.arrived(scene.t_s)),
        advised=True,
        plan=replace(CARRY_PLAN, close_s=0.8, tare_s=0.15),
        path=path,
    )
    demo.play(program)
    assert (program.report.error, program.report.refusals) == ("", [])
    assert program.report.opened_ns is not None
    assert all(
        scale <= holds_scale(move, GLASS_KG, GRIP_N, MU) for move, scale in zip(path, program.scales, strict=True)
    )
    assert slides(demo.rig) == 0
    return program


def test_with_advice_the_glass_is_carried_without_a_slip_and_the_run_replays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = slow_config(carry_config(shipped_config("demo.toml").read_text(encoding="utf-8")))
    demo = SteppedDemo(
        carried_rig(3, PvdfElectronics(rate_hz=PAD_HZ)), text, recording_of(tmp_path / "carry.mcap", text)
    )
    first = carry_once(demo, (PATH[0], PATH[1], PATH[4]))
    assert first.scales[0] == FLOOR, "what is not yet lifted is not known"
    program = carry_once(demo, (PATH[0], PATH[2], PATH[4]))
    demo.finish()
    assert program.scales[0] > 1.5 * FLOOR, "what was carried before is known while it stands on the table"
    assert FLOOR < program.scales[1] < 1.0, "up is slowed down no more than must be"
    print_summary(demo.tally, program.report, demo.events_of_scene)
    shown = capsys.readouterr().out
    assert re.search(r"program  moves up at \d+% of full speed \(\w+ of \w+ limits it\)", shown)
    assert "glass: did not slip" in shown
    assert "NOT AS EXPECTED" not in shown
    recording = open_recording(tmp_path / "carry.mcap")
    live = list(recording.messages())
    assert recording.complete
    assert {topic for topic, _ in live} >= {"motion", "grasp"}
    again = [(topic, encode(body)) for topic, body in replay(open_recording(tmp_path / "carry.mcap"))]
    assert again == live
