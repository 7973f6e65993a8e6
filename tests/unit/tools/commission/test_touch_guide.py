"""The guide on emulated devices behind the real engine: every wrong mounting of the config, from bytes to the TOML."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from charge_rig import charge_rig
from commission_person import TOUCHES
from commission_rig import commission_rig
from emulated_engine import EmulatedEngine
from guided_engine import GuidedEngine
from known_zeros import know_zeros
from scipy.spatial.transform import Rotation

from slipd import config
from slipd.config.config_file import marked_keys
from slipd.errors import SlipdError
from slipd.tools.commission import gripper_steps, touch_guide
from slipd.tools.commission.commission_guide import Commission
from slipd.tools.commission.config_update import changed_text, changes
from slipd.tools.commission.dialogue import Ask, Event, Output, Prompt, Refusal, Skipped, follow
from slipd.tools.commission.readings import ReadingListener
from slipd.tools.commission.touch_guide import TouchGuide
from slipd.tools.commission.touches import Findings, scan_centroid
from slipd.tools.sim import touched_devices
from slipd_client.messages.topics import Tactile


def commission(
    true: config.Config,
    read: config.Config,
    folder: Path,
    touches: Mapping[str, str] = TOUCHES,
    then: Mapping[str, str] | None = None,
) -> tuple[Findings, list[str]]:
    """Return what the guide finds, and what it prints; at its question, the person makes the touches of ``then``."""
    engine = EmulatedEngine(true, read, folder)
    know_zeros(*engine._engine._fingers.values())
    words = ("skip", "go on") if then is None else ("again", "again")
    answers = {"touch_wait": ("release", words[0]), "touch_again": ("", words[1])}
    host = GuidedEngine(engine, read.text, touches, answers)

    def respond(output: Output) -> Event:
        if "Let go" in getattr(output, "text", "") and "Let go" in host.touches:
            return None
        event = host.respond(output)
        if then is not None and getattr(output, "step", "") in answers:
            host.touches = then
        return event

    guide = TouchGuide(read, ReadingListener(read.finger, read.config_id), 5.0)
    return follow(guide.run("left"), respond), host.printed


def corrected(read: config.Config, found: Findings) -> config.Config:
    """Return the config with what was found."""
    return config.parse(changed_text(read.text, changes(read, {"left": found})), "corrected")


def check_same(found: config.Config, true: config.Config) -> None:
    wrench, wanted = found.finger["left"].wrench, true.finger["left"].wrench
    assert (wrench.sign, wrench.port) == (wanted.sign, wanted.port)
    turn, wanted_turn = (Rotation.from_quat(each.pad_from_sensor.quat_xyzw) for each in (wrench, wanted))
    assert (turn * wanted_turn.inv()).magnitude() < math.radians(3.0)
    assert wrench.pad_from_sensor.xyz_m == pytest.approx(wanted.pad_from_sensor.xyz_m, abs=0.003)
    keys = {"swap_xy", "flip_x", "flip_y", "port"}
    assert found.finger["left"].pad.model_dump(include=keys) == true.finger["left"].pad.model_dump(include=keys)


SENSOR_ONLY = config.parse(charge_rig(left={}).text.partition("[finger.left.pad]")[0], "sensor only")
SERIAL = """
[finger.left]
mu = 0.5
[finger.left.wrench]
device = "optoforce"
port = "/dev/left-wrench"
rate_hz = 100.0
options = {{ period_ms = 10, counts_per_n = {scale}, counts_per_nm = [1000.0, 1000.0, 1000.0] }}
"""

SMALL = commission_rig()
WRONG: dict[str, Any] = {"sign": -1, "quat": [0.0, 0.0, 0.0, 1.0], "xyz": [0.0, 0.03, 0.0], "flip_y": "true"}


@pytest.fixture(autouse=True)
def tared(monkeypatch: pytest.MonkeyPatch) -> None:
    """The force sensors have their zero: a charge pad shows nothing before its finger was seen free."""
    monkeypatch.setattr(touched_devices, "BIAS", np.zeros(6))
    monkeypatch.setattr(gripper_steps, "PAUSE_S", 1.0)


def test_swapped_fingers_are_found(tmp_path: Path) -> None:
    true = charge_rig(left={}, right={})
    read = charge_rig(
        left={"wrench": "right-wrench", "pad": "right-pad"}, right={"wrench": "left-wrench", "pad": "left-pad"}
    )
    found, _ = commission(true, read, tmp_path)
    assert found.problems == []
    check_same(corrected(read, found), true)


def test_a_person_who_goes_on_although_a_push_went_the_other_way_changes_nothing(tmp_path: Path) -> None:
    touches = TOUCHES | {"push along +Y": "press {finger} 6 N at 0 0 mm; push {finger} -y 2.5 N"}
    found, _ = commission(charge_rig(left={}), charge_rig(left={}), tmp_path, touches)
    assert any("on the other side" in problem for problem in found.problems)
    assert changes(charge_rig(left={}), {"left": found}) == {}


WRONG_CORNER = TOUCHES | {"Press the corner": "press {finger} 6 N at 16 -7 mm"}


def test_only_touches_that_do_not_fit_are_asked_for_again_and_what_is_found_loses_its_mark(tmp_path: Path) -> None:
    true, text = charge_rig(left={}), charge_rig(left={"flip_y": "true"}).text
    for key in ("sign = 1", "swap_xy = false"):
        text = text.replace(key, f"{key}  # MEASURE")
    read = config.parse(text.replace("sign =", "force_std_n = 0.2  # MEASURE\nsign =", 1), "marked")
    found, printed = commission(true, read, tmp_path, WRONG_CORNER, then=TOUCHES)
    assert found.problems == []
    right = corrected(read, found)
    check_same(right, true)
    assert marked_keys(read.text)
    assert marked_keys(right.text) == {}
    assert right.finger["left"].wrench.force_std_n == pytest.approx(0.02, rel=0.3), "that of the emulated sensor"
    assert any("noise at rest 0.0" in line for line in (*printed, *found.notes))
    (asked,) = [number for number, line in enumerate(printed) if "do not fit together" in line]
    assert printed[asked].startswith(
        "The touches of finger left do not fit together. Only the press at the +X +Y corner"
    )
    assert "on the other side" in printed[asked - 1]
    assert [line for line in printed[asked + 1 :] if line.startswith("Press")] == [
        line for line in printed[:asked] if ("corner" in line and line.startswith("Press")) or "without sliding" in line
    ]


@pytest.mark.parametrize(
    ("slow", "words"),
    [
        ({}, "No press was felt within 5 s."),
        (TOUCHES | {"push along +X": "press {finger} 6 N at 0 0 mm"}, "No push was felt within 5 s."),
        (
            {"Press the centre": "press {finger} 200 N in 10 s"},
            "The press was not held still in 2 tries: the force changed between",
        ),
        (TOUCHES | {"Let go": ""}, "The pads were not released within 5 s."),
    ],
)
def test_a_slow_person_is_asked_and_loses_nothing(
    slow: Mapping[str, str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(touch_guide, "MOST_TRIES", 2)
    found, printed = commission(SENSOR_ONLY, SENSOR_ONLY, tmp_path, slow, then=TOUCHES)
    assert found.problems == []
    (asked,) = [line for line in printed if "what was found of the others is kept" in line]
    assert asked.startswith(words)


@pytest.mark.parametrize("lets_go", [True, False])
def test_a_touch_that_comes_too_early_must_end_first(lets_go: bool, tmp_path: Path) -> None:
    engine = EmulatedEngine(SENSOR_ONLY, SENSOR_ONLY, tmp_path)
    know_zeros(*engine._engine._fingers.values())
    host = GuidedEngine(engine, SENSOR_ONLY.text, answers={"touch_wait": ("release", "again")})

    def respond(output: Output) -> Event:
        if isinstance(output, Ask) and host.printed[-1].endswith("Let go."):
            engine.touch("press left 6 N")
            host.printed.append("pressed")
        return host.respond(output) if lets_go or "too early" not in getattr(output, "text", "") else None

    guide = TouchGuide(SENSOR_ONLY, ReadingListener(SENSOR_ONLY.finger, SENSOR_ONLY.config_id), 5.0)
    assert follow(guide.run("left"), respond).problems == []
    waits = "That was too early" if lets_go else "The pads were not released within 5 s."
    assert sum(line.strip().startswith(waits) for line in host.printed) == host.printed.count("pressed") == 4


def test_a_finger_can_be_left_out_where_nothing_is_felt(tmp_path: Path) -> None:
    with pytest.raises(Skipped):
        commission(SENSOR_ONLY, SENSOR_ONLY, tmp_path, {})


def test_a_force_in_counts_is_remarked_and_the_presses_are_not_asked_for_again(tmp_path: Path) -> None:
    true, read = (config.parse(SERIAL.format(scale=scale), "serial") for scale in ("[20.0, 20.0, 20.0]", "[1, 1, 1]"))
    found, printed = commission(true, read, tmp_path)
    assert found.wrong_scale
    assert changes(read, {"left": found}) == {}
    (problem,) = found.problems
    assert "about 5 N and the sensor reads 120 N: options.counts_per_n?" in problem
    assert [line for line in printed if line.startswith("Press")] == [printed[1]], (
        "the other touches would show nothing"
    )


def test_noise_finer_than_a_count_is_not_measured_and_the_person_is_told(tmp_path: Path) -> None:
    rig = config.parse(SERIAL.format(scale="[2.0, 2.0, 2.0]"), "coarse")
    found, _ = commission(rig, rig, tmp_path)
    assert found.noise is None
    assert "the noise is not measured: the readings moved, or did not change at all" in found.notes


def test_an_image_without_a_load_has_no_centre() -> None:
    pad = charge_rig(left={}).finger["left"].pad
    assert scan_centroid(pad, np.zeros(pad.rows * pad.cols)) is None


def test_another_config_of_the_daemon_is_refused(tmp_path: Path) -> None:
    engine = EmulatedEngine(charge_rig(left={}), charge_rig(left={}), tmp_path)
    know_zeros(*engine._engine._fingers.values())
    other = charge_rig(left={"sign": -1})
    listener = ReadingListener(other.finger, other.config_id)
    with pytest.raises(SlipdError, match="the daemon runs another config"):
        follow(listener.check_config(), lambda output: engine.receive())
    with pytest.raises(SlipdError, match="Is slipd running"):
        follow(listener.collect(0.1), lambda output: None)


def test_the_presses_are_asked_for_again_once_the_daemon_shows_the_image_of_a_charge_pad(tmp_path: Path) -> None:
    """Without a zero and with a wrong sign, the image of a charge pad shows only once the force sensor is right."""
    true, wrong = charge_rig(left={}), charge_rig(left=WRONG)
    answers = {"touch_again": ("", "again")}
    host = GuidedEngine(EmulatedEngine(true, wrong, tmp_path), wrong.text, answers=answers)

    def respond(output: Output) -> Event:
        tare = isinstance(output, Ask) and output.method == "tare"
        return Refusal("it is pulled at") if tare and host.text == wrong.text else host.respond(output)

    follow(Commission(wrong, ["left"], 20.0).run(), respond)
    check_same(config.parse(host.text, "found"), true)
    (again,) = [number for number, line in enumerate(host.printed) if "presses are needed once more" in line]
    touches = [line for line in host.printed[again:] if line.startswith("Press")]
    assert [line for line in touches if "push" in line] == []
    assert len(touches) >= 3


class Complete(Exception):  # noqa: N818 - it names what happened
    """The first touch is taken."""


def test_a_touch_without_images_is_held_until_they_are_back(tmp_path: Path) -> None:
    """On a busy machine, those of the first second after a question are lost."""
    engine, lost = EmulatedEngine(SMALL, SMALL, tmp_path), [0]
    know_zeros(*engine._engine._fingers.values())
    host = GuidedEngine(engine, SMALL.text)

    def respond(output: Output) -> Event:
        event = host.respond(output)
        while lost[0] and isinstance(event, Tactile):
            lost[0] -= 1
            event = engine.receive()
        if isinstance(output, Prompt):
            lost[0] = 50
        if "Let go" in getattr(output, "text", ""):
            raise Complete
        return event

    with pytest.raises(Complete):
        follow(TouchGuide(SMALL, ReadingListener(SMALL.finger, SMALL.config_id), 20.0).run("left"), respond)
    assert any("had gaps" in line and "hold it still" in line for line in host.printed)
