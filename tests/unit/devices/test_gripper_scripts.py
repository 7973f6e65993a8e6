"""The same scripts of permits for every gripper: what is then on the wire, and whether a command counts as lost."""

from __future__ import annotations

import math

import pytest
from gripper_peers import PEERS
from gripper_talk import STATES, Talk

from slipd.devices import robotiq_2f
from slipd.types.permit import Permit

SCRIPTS = {
    "a force after a waiting move is sent with the move": ("move 8, force 12", "move 12"),
    "a newer command replaces one that waits": ("move 8, force 9, move 10", "move 10"),
    "a dropped move is not sent": ("move 8, drop", ""),
    "a dropped move is not begun by a later force": ("move 8, drop, force 9", "force 9"),
    "a stop is not dropped": ("move 8, run, halt, drop, run", "move 8, stop"),
    "a force after a stop resumes nothing": ("move 8, run, halt, run, force 9", "move 8, stop, force 9"),
    "an unanswered command is repeated twice and then lost": ("deaf, force 8, wait", "force 8, force 8, force 8, lost"),
    "a command that was sent is not repeated after a drop": ("deaf, force 8, send, drop, wait", "force 8, lost"),
    "a newer force replaces an unanswered one": ("deaf, force 8, send, force 9, hear", "force 8, force 9"),
    "a refused command is lost and not repeated": ("refuse, force 8, wait", "force 8, lost"),
    "a command after a lost one is sent": ("refuse, force 8, wait, hear, force 9", "force 8, force 9"),
    "a lost command is forgotten once acknowledged": ("refuse, force 8, wait, hear, acknowledge", "force 8"),
    "nothing is sent to a gripper that is closed": ("move 8, stop", ""),
    "no motion is accepted during an activation": ("activate, force 8, move 8, run, wait", "activate"),
}


def ready(device: str) -> Talk:
    """Return a gripper that is ready, and was sent nothing."""
    talk = Talk(device, STATES[device]["active"])
    talk.commands.clear()
    return talk


def sent(talk: Talk) -> str:
    """Return what was sent: a move of a gripper with a force limit of its own is one command."""
    found: list[str] = []
    for command in talk.commands:
        force = f" {command.force_n:.0f}" if command.force_n is not None else ""
        kind = command.kind if command.width_m is None or command.width_m > 0.001 else "close"
        if command.kind == "move" and not force and found:
            force = found.pop().removeprefix("force")
        if kind != "other" and [kind] != found[-1:]:  # a Robotiq is activated by two writes
            found.append(kind + force)
    return ", ".join(found + ["lost"] * talk.session.command_lost)


def ending(talk: Talk) -> str:
    """Return what was sent, the state, and the force in effect."""
    force_n = talk.session.force_sent_n
    state = talk.session.state.partition(": ")[0]
    return f"{sent(talk)} | {state} | {'no force' if force_n is None else f'{force_n:.0f} N'}"


@pytest.mark.parametrize("device", PEERS)
@pytest.mark.parametrize("name", SCRIPTS)
def test_A6_a_script_of_permits_gives_the_same_commands_on_every_gripper(name: str, device: str) -> None:
    script, expected = SCRIPTS[name]
    assert sent(ready(device).play(script).run(0.25)) == expected


R, W, E = "robotiq_2f", "wsg", "external_gripper"
ENDINGS: dict[str, dict[str, tuple[str, ...]]] = {
    # a halt
    "move 8, run, force 9, halt": {"move 8, stop, force 9 | active | 9 N": (R,), "move 8, stop | active | 8 N": (W, E)},
    "move 8, run, close 3, halt": {"move 8, stop | active | 8 N": (R, W, E)},
    "move 8, run, halt, halt, force 9": {"move 8, stop, force 9 | active | 9 N": (R, W, E)},
    "move 8, run, halt, drop, deaf, send, drop, hear": {"move 8, stop | active | 8 N": (R, W, E)},
    "move 8, run, deaf, force 8, send, halt, force 9, hear": {
        "move 8, force 8, stop, force 9 | active | 9 N": (R, W, E)
    },
    "move 8, run, deaf, force 9, send, close 3, halt, hear, send, halt": {
        "move 8, force 9, stop, force 9 | active | 9 N": (R,),
        "move 8, force 9, stop | active | 9 N": (W, E),
    },
    # a drop
    "deaf, move 8, send, close 3, drop, drop, hear, wait": {
        "move 8, lost | command lost | 8 N": (R, E),
        "force 8, lost | command lost | 8 N": (W,),
    },
    "deaf, move 8, send, drop, force 9, hear": {
        "move 8, force 9 | active | 9 N": (R,),
        "force 8, lost | command lost | 8 N": (W,),
        "move 8, lost | command lost | 8 N": (E,),
    },
    # an activation
    "force 8, run, activate, wait, wait": {"force 8, activate | active | no force": (R, W, E)},
    "force 8, run, activate, halt": {"force 8, stop | active | 8 N": (R, W, E)},
    "force 8, run, activate, drop": {"force 8 | active | 8 N": (R, W, E)},
    "activate, drop, force 9": {"force 9 | active | 9 N": (R, W, E)},
    "activate, send, halt": {"activate | inactive | no force": (R,), "activate, stop | active | no force": (W, E)},
    "activate, send, halt, force 9": {
        "activate | inactive | no force": (R,),
        "activate, stop | active | no force": (W,),
        "activate, stop, force 9 | active | 9 N": (E,),
    },
    "activate, send, activate, drop, wait": {
        "activate | inactive | no force": (R,),
        "activate | active | no force": (W, E),
    },
    "deaf, activate, wait": {"activate, lost | no reply | no force": (R, W, E)},
    "deaf, activate, send, halt, hear, wait": {
        "activate, lost | command lost | no force": (R,),
        "activate, stop | active | no force": (W, E),
    },
    "deaf, force 8, send, activate, hear, wait, wait": {"force 8, activate | active | no force": (R, W, E)},
    "refuse, activate, wait, hear": {"activate, lost | command lost | no force": (R, W, E)},
    "inactive, run, force 8, activate, wait, wait": {"activate | active | no force": (R, W, E)},
    # what the gripper does meanwhile
    "force 8, run, inactive, run, force 9": {"force 8 | inactive | no force": (R, W, E)},
    "deaf, wait, wait, activate, force 8, wait": {
        "lost | no reply | no force": (R,),
        " | no reply | no force": (W, E),
    },
    "deaf, force 8, wait, wait, hear, wait, force 9": {"force 8, force 8, force 8, force 9 | active | 9 N": (R, W, E)},
    "fault, run, force 8, move 8, halt": {"stop | fast_stop | no force": (W,), "stop | no_power | no force": (E,)},
    "move 8, run, fault, run, acknowledge, acknowledge, run, force 9": {
        "move 8, acknowledge, force 9 | active | 9 N": (W, E)
    },
    "deaf, force 8, send, fault, hear, wait": {"force 8, lost | command lost | 8 N": (W, E)},
    "fault, run, deaf, wait, wait, acknowledge, run": {" | no reply | no force": (W, E)},
    "fault, run, activate, wait, wait": {
        "acknowledge, activate | active | no force": (W,),
        "activate | no_power | no force": (E,),
    },
}
"""What is sent, the state, and the force in effect, after each script, on each gripper."""


@pytest.mark.parametrize("script", ENDINGS)
def test_A6_D4_a_script_ends_with_these_commands_this_state_and_this_force(script: str) -> None:
    for expected, devices in ENDINGS[script].items():
        for device in devices:
            assert ending(ready(device).play(script).run(0.25)) == expected, device


@pytest.mark.parametrize("device", PEERS)
def test_no_more_force_is_sent_than_requested_except_the_smallest_and_its_answer_counts(device: str) -> None:
    talk = ready(device)
    session, (least, most) = talk.session, talk.session.force_range_n
    for requested, applied in ((least / 2, least), (most * 2, most), (least + 1.0, least + 1.0)):
        assert talk.ask("force", requested)
        assert session.force_sent_n == session.applied_n(applied) <= max(requested, least)
        assert talk.run(0.25).session.force_acknowledged_n == session.force_sent_n


NAN, INF = math.nan, math.inf
IMPOSSIBLE = {
    "a permit of kind 'move' must have a force": [Permit("move", 0.05)],
    "a permit of kind 'set_force' must have a force": [Permit("set_force")],
    "a permit of kind 'move' must have a width": [Permit("move", force_n=5.0)],
    "a force must be finite, got nan N": [Permit("move", 0.05, None, NAN), Permit("set_force", force_n=NAN)],
    "a force must be finite, got -?inf N": [Permit("move", 0.05, None, -INF), Permit("set_force", force_n=INF)],
    "the width must be": [Permit("move", wrong, None, 5.0) for wrong in (NAN, INF, -INF, -0.001, 0.9)],
    "the speed must be": [Permit("move", 0.02, wrong, 5.0) for wrong in (NAN, INF, -INF, -0.001, 0.9)],
}


@pytest.mark.parametrize("device", PEERS)
@pytest.mark.parametrize("words", IMPOSSIBLE)
def test_N2_a_permit_that_is_incomplete_or_that_no_gripper_can_obey_is_refused_and_nothing_is_sent(
    device: str, words: str
) -> None:
    talk = ready(device)
    for permit in IMPOSSIBLE[words]:
        with pytest.raises(ValueError, match=words):
            talk.session.execute(permit, talk.now_ns)
    assert sent(talk.run(0.25)) == ""


def test_no_table_gives_a_force_that_is_not_finite() -> None:
    with pytest.raises(ValueError, match="must be finite"):
        robotiq_2f.Session().applied_n(NAN)
