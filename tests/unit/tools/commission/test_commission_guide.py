"""The whole guide behind the real engine on emulated devices: from a wrong config to a first grasp."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from commission_person import ANSWERS, POSES_OF_TWO, TOUCHES
from commission_rig import FINGER, FINGERS, GRIPPER, LIMIT, PRESSES, TRUE, WRONG, commission_rig
from emulated_engine import EmulatedEngine
from guided_engine import GuidedEngine

from slipd import config
from slipd.errors import SlipdError
from slipd.tools.commission import commission_guide, friction_step, gripper_steps, weight_step
from slipd.tools.commission.commission_guide import Allowed, Commission
from slipd.tools.commission.config_update import changed_text
from slipd.tools.commission.dialogue import Ask, Change, Choice, Event, Output, Prompt, Refusal, Say, Written, follow
from slipd.tools.commission.touches import mount_of
from slipd.tools.commission.weight_step import weigh


def guided(folder: Path, true: config.Config, read: config.Config, **person: Any) -> GuidedEngine:
    return GuidedEngine(EmulatedEngine(true, read, folder), read.text, TOUCHES | PRESSES, **person)


def test_the_whole_guide_leads_from_a_wrong_config_to_a_first_grasp(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(friction_step, "SAMPLES", 1)
    monkeypatch.setattr(gripper_steps, "HOLD_S", 1.0)
    read = commission_rig(**WRONG)
    host = guided(tmp_path, commission_rig(), read)
    complete = follow(Commission(read, FINGERS, 20.0, "restart").run(), host.respond)
    assert complete, "\n".join(host.printed)
    found = config.parse(host.text, "found")
    for finger in found.finger.values():
        assert finger.wrench is not None
        assert finger.pad is not None
        assert finger.wrench.pad_from_sensor.quat_xyzw == TRUE["quat"]
        assert finger.wrench.mass_kg == pytest.approx(TRUE["mass"], abs=0.002)
        assert finger.wrench.com_m == pytest.approx([0.0, 0.0, -0.012], abs=0.002)
        assert finger.pad.flip_y is False
        assert finger.mu == pytest.approx(0.55, abs=0.06), "a low estimate of 0.6"
    assert any("read as w, x, y, z" in line for line in host.printed)
    assert host.asked.count("gripper.close") == host.asked.count("gripper.open") == 2
    assert host.printed[-1].startswith("Hold the object")


def test_a_dry_run_weighs_two_fingers_and_moves_and_writes_nothing(tmp_path: Path) -> None:
    two = [FINGER.format(name=name, number=k, **TRUE) for k, name in enumerate(("left", "right"), 1)]
    read = config.parse(
        "# A rig.\n" + "".join(two).replace("mass_kg = 0.08", "mass_kg = 0.05") + GRIPPER + LIMIT, "rig"
    )
    true = config.parse("# A rig.\n" + "".join(two) + GRIPPER + LIMIT, "rig")
    host = guided(tmp_path, true, read, answers=POSES_OF_TWO, write=False)
    follow(
        Commission(read, ["left", "right"], 20.0, allowed=Allowed(write=False, move=False)).run("weight"), host.respond
    )
    masses = [line for line in host.printed if "mass 80" in line or "mass 79" in line]
    assert [line.split(":")[0].strip() for line in masses] == ["left", "right"]
    assert any("left out: only slipd commission in a terminal" in line for line in host.printed)
    assert (host.text, set(host.asked)) == (read.text, {"hello", "status"})


TYPED = {
    "tips_down": ("tilt 1 0 0", "9.81, 0, 0"),
    "pad_up": ("tilt 0 0 -1", "0 0 -1"),
    "pad_down": ("tilt 0 0 1", "1 0 0 0"),
    "side_down": ("tilt 0 1 0", "-0.7071068 0 0 0.7071068"),
}
"""Gravity, its direction, and orientations of the pad in the order x, y, z, w."""


def test_gravity_and_orientations_may_be_typed_in_place_of_the_poses(tmp_path: Path) -> None:
    read = commission_rig(mass=0.0, com_z=0.0)
    host = guided(tmp_path, commission_rig(), read, answers=TYPED)

    def respond(output: Output) -> Event:
        if isinstance(output, Say) and "Step 3" in output.text:
            host.answers = {}
        return host.respond(output)

    follow(Commission(read, FINGERS, 20.0).run("weight"), respond)
    wrench = config.parse(host.text, "found").finger["left"].wrench
    assert wrench is not None
    assert wrench.mass_kg == pytest.approx(TRUE["mass"], abs=0.002)


def test_what_is_typed_and_is_no_gravity_says_what_would_be(tmp_path: Path) -> None:
    read = commission_rig()
    host = guided(tmp_path, read, read, answers={"tips_down": ("", "3 0 0")})
    steps = Commission(read, FINGERS, 20.0).run("weight")

    def respond(output: Output) -> Event:
        if isinstance(output, Say) and "must" in output.text:
            host.answers = {}
        return host.respond(output)

    assert not follow(steps, respond)
    (line,) = [line for line in host.printed if "gravity must be about 9.81 m/s² in size" in line]
    assert line.endswith("got 3. Or choose: ready, not possible, skip")


OTHER_POSE = ANSWERS | {"pad_down": ("tilt 0 0 -1", "ready"), "pose_again": ("", "again")}


@pytest.mark.parametrize("word", ["again", "go on"])
def test_a_pose_that_does_not_fit_the_others_is_named_and_repeated(tmp_path: Path, word: str) -> None:
    read = commission_rig(mass=0.0, com_z=0.0)
    host = guided(tmp_path, commission_rig(), read, answers=OTHER_POSE | {"pose_again": ("", word)})

    def respond(output: Output) -> Event:
        if isinstance(output, Prompt) and output.step == "pose_again":
            host.answers = ANSWERS | {"pose_again": ("", word)}
        elif isinstance(output, Say) and "Step 3" in output.text:
            host.answers = {}
        return host.respond(output)

    follow(Commission(read, FINGERS, 20.0).run("weight"), respond)
    named = "All poses fit a weight but one, in which the fingers lie level, and the left pad faces down."
    assert sum(line.startswith(named) for line in host.printed) == 1
    assert sum(line.startswith("Pose ") for line in host.printed) == (5 if word == "again" else 4)
    wrench = config.parse(host.text, "found").finger["left"].wrench
    assert wrench is not None
    assert wrench.mass_kg == pytest.approx(TRUE["mass"] if word == "again" else 0.0, abs=0.002)


def test_a_pose_that_never_fits_is_not_asked_for_without_end(tmp_path: Path) -> None:
    read = commission_rig(mass=0.0, com_z=0.0)
    host = guided(tmp_path, commission_rig(), read, answers=OTHER_POSE)
    mounts = {"left": mount_of(wrench)} if (wrench := read.finger["left"].wrench) is not None else {}
    findings = follow(weigh(read, mounts, FINGERS), host.respond)
    assert findings["left"].problems
    assert sum(line.startswith("Pose 3") for line in host.printed) == 1 + weight_step.MOST_REPEATS


def test_a_finger_that_is_never_at_rest_is_named_with_the_noise_that_the_config_states(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(weight_step, "MOST_TRIES", 2)
    quiet = commission_rig().text.replace("force_std_n = 0.03", "force_std_n = 0.0001")
    read = config.parse(quiet, "rig")
    host = guided(tmp_path, commission_rig(), read)
    steps = Commission(read, FINGERS, 20.0).run("weight")
    asked = 0

    def respond(output: Output) -> Event:
        nonlocal asked
        if isinstance(output, Prompt) and output.step == "still_again":
            asked += 1
            host.answers = ANSWERS | {"still_again": ("", "again")} if asked == 1 else {}
        return host.respond(output)

    assert not follow(steps, respond)
    assert asked == 2
    moves = [line for line in host.printed if "hold it still" in line]
    assert len(moves) == 4
    assert "more than 0.0005 N" in moves[0]
    assert "slipd commission --from weight" in "\n".join(host.printed)


def test_a_daemon_that_does_not_run_the_new_config_ends_the_guide(tmp_path: Path) -> None:
    read = commission_rig(**WRONG)
    host = guided(tmp_path, commission_rig(), read)

    def respond(output: Output) -> Event:
        return Written(changed_text(read.text, output.values)) if isinstance(output, Change) else host.respond(output)

    with pytest.raises(SlipdError, match="does not run the new config; start it, and go on with --from"):
        follow(Commission(read, FINGERS, 1.0, "restart").run(), respond)


def test_a_zero_that_friction_needs_is_asked_for_again(tmp_path: Path) -> None:
    read = commission_rig()
    host = guided(tmp_path, read, read, answers={"tips_down": ("tilt 1 0 0", "ready"), "zero_again": ("", "go on")})

    def respond(output: Output) -> Event:
        refused = isinstance(output, Ask) and output.method == "tare"
        return Refusal("it is touched") if refused else host.respond(output)

    assert not follow(Commission(read, FINGERS, 20.0).run("grasp"), respond)
    assert any(line.startswith("Without its zero, finger left shows other forces") for line in host.printed)


TURNED = [0.0, 0.0, 0.7071068, 0.7071068]
"""A sensor that the config states as turned about the normal of the pad."""


@pytest.mark.parametrize("word", ["again", "go on"])
def test_a_weight_that_contradicts_the_mounting_leads_back_to_the_touches(tmp_path: Path, word: str) -> None:
    read = commission_rig(quat=TURNED, mass=0.0, com_z=0.0)
    host = guided(tmp_path, commission_rig(), read, answers=ANSWERS | {"mounting_again": ("", word)})

    def respond(output: Output) -> Event:
        if isinstance(output, Say) and "Step 3" in output.text:
            host.answers = {}
        return host.respond(output)

    assert not follow(Commission(read, FINGERS, 20.0).run("weight"), respond)
    wrench = config.parse(host.text, "found").finger["left"].wrench
    assert wrench is not None
    left_out = [line for line in host.printed if "left out: with a wrong mounting" in line]
    if word == "again":
        assert wrench.pad_from_sensor.quat_xyzw == TRUE["quat"]
        assert wrench.mass_kg == pytest.approx(TRUE["mass"], abs=0.002)
        assert left_out == []
    else:
        assert host.text == read.text
        assert len(left_out) == 2, "friction and grasp"


def test_what_is_found_and_not_written_is_not_gripped_with(tmp_path: Path) -> None:
    read = commission_rig(**WRONG)
    host = guided(tmp_path, commission_rig(), read, write=False)
    assert not follow(Commission(read, FINGERS, 20.0).run(), host.respond)
    left_out = "  left out: what was found is not written, so the daemon does not run it"
    assert host.printed.count(left_out) == 3
    assert not any(op.startswith("gripper") for op in host.asked)


def test_a_zero_that_is_refused_again_and_again_leaves_the_step_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commission_guide, "MOST_ZEROS", 2)
    monkeypatch.setattr(gripper_steps, "PAUSE_S", 0.1)
    read = commission_rig(mass=0.0)
    host = guided(tmp_path, read, read, answers={"zero_again": ("", "again")})

    def respond(output: Output) -> Event:
        refused = isinstance(output, Ask) and output.method == "tare"
        return Refusal("it is touched") if refused else host.respond(output)

    assert not follow(Commission(read, FINGERS, 20.0).run("grasp"), respond)
    assert host.printed[-2:] == [
        "  given up: the zero was refused 2 times",
        "  left out; later: slipd commission --from grasp",
    ]


def test_the_wait_for_the_new_config_can_be_ended(tmp_path: Path) -> None:
    read = commission_rig(**WRONG)
    host = guided(tmp_path, commission_rig(), read)
    events: list[Event] = [Choice("skip"), Choice("perhaps"), None]
    waits = False

    def respond(output: Output) -> Event:
        nonlocal waits
        waits = waits or (isinstance(output, Prompt) and output.step == "restart")
        return events.pop() if waits and output is None else host.respond(output)

    with pytest.raises(SlipdError, match="does not run the new config"):
        follow(Commission(read, FINGERS, 20.0, "restart").run(), respond)
    assert events == []
