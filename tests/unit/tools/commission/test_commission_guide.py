"""The whole guide behind the real engine on emulated devices: from a wrong config to a first grasp."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from commission_person import ANSWERS, POSES_OF_TWO, TOUCHES
from commission_rig import FINGER, FINGERS, GRIPPER, LIMIT, PRESSES, TAXELS, TRUE, WRONG, commission_rig
from emulated_engine import EmulatedEngine
from guided_engine import GuidedEngine

from slipd import config
from slipd.errors import SlipdError
from slipd.tools.commission import commission_guide, friction_step, gripper_steps, weight_step
from slipd.tools.commission.commission_guide import Commission
from slipd.tools.commission.dialogue import Choice, Event, follow
from slipd.tools.commission.readings import wait_for_restart
from slipd.tools.commission.touches import mount_of
from slipd.tools.commission.weight_step import weigh


def guided(folder: Path, read: config.Config, true: config.Config | None = None, **person: Any) -> GuidedEngine:
    """A person at a rig whose sensors are mounted as in another config, by default that of ``TRUE``."""
    return GuidedEngine(EmulatedEngine(true or commission_rig(), read, folder), read.text, TOUCHES | PRESSES, **person)


def follow_guide(host: GuidedEngine, first: str = "mounting", patience_s: float = 20.0) -> bool:
    guide = Commission(config.parse(host.text, "rig"), FINGERS, patience_s, "restart")
    return follow(guide.run(first), host.respond)


def wrench_of(host: GuidedEngine) -> Any:
    return config.parse(host.text, "found").finger["left"].wrench


def test_the_whole_guide_leads_from_a_wrong_config_to_a_first_grasp(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(friction_step, "SAMPLES", 1)
    monkeypatch.setattr(gripper_steps, "HOLD_S", 1.0)
    host = guided(tmp_path, commission_rig(**WRONG))
    assert follow_guide(host), "\n".join(host.printed)
    finger = config.parse(host.text, "found").finger["left"]
    assert finger.wrench.pad_from_sensor.quat_xyzw == TRUE["quat"]
    assert finger.wrench.mass_kg == pytest.approx(TRUE["mass"], abs=0.002)
    assert finger.wrench.com_m == pytest.approx([0.0, 0.0, -0.012], abs=0.002)
    assert finger.pad.flip_y is False
    assert finger.mu == pytest.approx(0.55, abs=0.06), "a low estimate of 0.6"
    assert any("read as w, x, y, z" in line for line in host.printed)
    assert host.asked.count("gripper.close") == host.asked.count("gripper.open") == 2
    assert host.printed[-1].startswith("Hold the object")


def test_a_dry_run_weighs_two_fingers_and_moves_and_writes_nothing(tmp_path: Path) -> None:
    two = "# A rig.\n" + "".join(
        FINGER.format(name=name, number=k, **TRUE) for k, name in enumerate(("left", "right"), 1)
    )
    true = config.parse(two + GRIPPER + LIMIT, "rig")
    read = config.parse(true.text.replace("mass_kg = 0.08", "mass_kg = 0.05"), "rig")
    host = guided(tmp_path, read, true, answers=POSES_OF_TWO, write=False)
    guide = Commission(read, ["left", "right"], 20.0, moves=False)
    follow(guide.run("weight"), host.respond)
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
    host = guided(tmp_path, commission_rig(mass=0.0, com_z=0.0), answers=TYPED, then=[("Step 3", {})])
    follow_guide(host, "weight")
    assert wrench_of(host).mass_kg == pytest.approx(TRUE["mass"], abs=0.002)


def test_what_is_typed_and_is_no_gravity_says_what_would_be(tmp_path: Path) -> None:
    host = guided(tmp_path, commission_rig(), answers={"tips_down": ("", "3 0 0")}, then=[("must", {})])
    assert not follow_guide(host, "weight")
    (line,) = [line for line in host.printed if "gravity must be about 9.81 m/s² in size" in line]
    assert line.endswith("got 3. Or choose: ready, not possible, skip")


OTHER_POSE = ANSWERS | {"pad_down": ("tilt 0 0 -1", "ready"), "pose_again": ("", "again")}


@pytest.mark.parametrize("word", ["again", "go on"])
def test_a_pose_that_does_not_fit_the_others_is_named_and_repeated(tmp_path: Path, word: str) -> None:
    again = {"pose_again": ("", word)}
    then = [("[pose_again]", ANSWERS | again), ("Step 3", {})]
    host = guided(tmp_path, commission_rig(mass=0.0, com_z=0.0), answers=OTHER_POSE | again, then=then)
    follow_guide(host, "weight")
    named = "All poses fit a weight but one, in which the fingers lie level, and the left pad faces down."
    assert sum(line.startswith(named) for line in host.printed) == 1
    assert sum(line.startswith("Pose ") for line in host.printed) == (5 if word == "again" else 4)
    assert wrench_of(host).mass_kg == pytest.approx(TRUE["mass"] if word == "again" else 0.0, abs=0.002)


def test_a_pose_that_never_fits_is_not_asked_for_without_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(weight_step, "MOST_REPEATS", 2)
    read = commission_rig(mass=0.0, com_z=0.0)
    host = guided(tmp_path, read, answers=OTHER_POSE)
    findings = follow(weigh(read, {"left": mount_of(wrench_of(host))}, FINGERS), host.respond)
    assert findings["left"].problems
    assert sum(line.startswith("Pose 3") for line in host.printed) == 3


def test_a_finger_that_is_never_at_rest_is_named_with_the_noise_that_the_config_states(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(weight_step, "MOST_TRIES", 2)
    quiet = config.parse(commission_rig().text.replace("force_std_n = 0.03", "force_std_n = 0.0001"), "rig")
    then = [("[still_again]", ANSWERS | {"still_again": ("", "again")}), ("[still_again]", {})]
    host = guided(tmp_path, quiet, then=then)
    assert not follow_guide(host, "weight")
    assert host.then == []
    moves = [line for line in host.printed if "hold it still" in line]
    assert len(moves) == 4
    assert "more than 0.0005 N" in moves[0]
    assert "slipd commission FILE --from weight" in "\n".join(host.printed)


@pytest.mark.parametrize(
    ("edited", "words"),
    [
        (False, "does not run the new config; start it, and go on with --from"),
        (True, "the file was changed after the guide wrote it; go on with --from and the next step"),
    ],
)
def test_a_daemon_that_does_not_run_the_new_config_ends_the_guide(tmp_path: Path, edited: bool, words: str) -> None:
    host = guided(tmp_path, commission_rig(mass=0.0))
    restart = host.engine.restart
    host.engine.restart = lambda read: restart(commission_rig(mass=0.07)) if edited else None
    with pytest.raises(SlipdError, match=words):
        follow_guide(host, "weight", patience_s=1.0)


def test_a_zero_that_friction_needs_is_asked_for_again(tmp_path: Path) -> None:
    answers = {"tips_down": ("tilt 1 0 0", "ready"), "zero_again": ("", "go on")}
    host = guided(tmp_path, commission_rig(), answers=answers, refused="it is touched")
    assert not follow_guide(host, "grasp")
    assert any(line.startswith("Without its zero, finger left shows other forces") for line in host.printed)


TURNED = [0.0, 0.0, 0.7071068, 0.7071068]
"""A sensor that the config states as turned about the normal of the pad."""


@pytest.mark.parametrize("word", ["again", "go on"])
def test_a_weight_that_contradicts_the_mounting_leads_back_to_the_touches(tmp_path: Path, word: str) -> None:
    read = commission_rig(quat=TURNED, mass=0.0, com_z=0.0)
    host = guided(tmp_path, read, answers=ANSWERS | {"mounting_again": ("", word)}, then=[("Step 3", {})])
    assert not follow_guide(host, "weight")
    left_out = [line for line in host.printed if "left out: with a wrong mounting" in line]
    if word == "again":
        assert wrench_of(host).pad_from_sensor.quat_xyzw == TRUE["quat"]
        assert wrench_of(host).mass_kg == pytest.approx(TRUE["mass"], abs=0.002)
        assert left_out == []
    else:
        assert host.text == read.text
        assert len(left_out) == 2, "friction and grasp"


def test_what_is_found_and_not_written_is_not_gripped_with(tmp_path: Path) -> None:
    host = guided(tmp_path, commission_rig(mass=0.0), write=False)
    assert not follow_guide(host, "weight")
    left_out = "  left out: what was found is not written, so the daemon does not run it"
    assert host.printed.count(left_out) == 2
    assert not any(op.startswith("gripper") for op in host.asked)


def test_a_zero_that_is_refused_again_and_again_leaves_the_step_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commission_guide, "MOST_ZEROS", 2)
    monkeypatch.setattr(gripper_steps, "PAUSE_S", 0.1)
    read = commission_rig(mass=0.0)
    host = guided(tmp_path, read, read, answers={"zero_again": ("", "again")}, refused="it is touched")
    assert not follow_guide(host, "grasp")
    assert host.printed[-2:] == [
        "  given up: the zero was refused 2 times",
        "  left out; later: slipd commission FILE --from grasp",
    ]


def test_the_wait_for_the_new_config_can_be_ended() -> None:
    events: list[Event] = [Choice("skip"), Choice("perhaps"), None]
    with pytest.raises(SlipdError, match="does not run the new config"):
        follow(wait_for_restart("old", "new", "restart", 100.0), lambda output: None if output else events.pop())
    assert events == []


AXES = "# A rig.\n[finger.left]\nmu = 0.5\nmin_normal_n = 0.3\n" + TAXELS.format(name="left", number=1, flip_y="false")


def test_orientation_and_signs_of_the_axes_are_found_and_there_is_no_weight_to_find(tmp_path: Path) -> None:
    wrong = AXES.replace("flip_y = false", "flip_y = true").replace("[0.001, 0.001, -0.001]", "[-0.001, 0.001, -0.001]")
    true, read = config.parse(AXES, "rig"), config.parse(wrong, "rig")
    host = guided(tmp_path, read, true, answers={})
    assert not follow_guide(host), "friction and grasp are left out"
    assert config.parse(host.text, "found").finger["left"].pad == config.parse(AXES, "true").finger["left"].pad
    assert "  no finger has a force sensor, so none has a weight to subtract" in host.printed
