"""State machines of the gripper sessions: the tables, each permit in each state on the wire, and random walks."""

from __future__ import annotations

from typing import Any

import pytest
from gripper_peers import PEERS
from gripper_talk import STATES, Talk
from gripper_walks import walk

from slipd.devices import external_gripper
from slipd.devices.robotiq_2f import robotiq_commands
from slipd.devices.wsg import wsg_commands

MODULES: dict[str, Any] = {
    "robotiq_2f": robotiq_commands,
    "wsg": wsg_commands,
    "external_gripper": external_gripper,
}
WALKS = 24


KINDS = ("activate", "move", "force", "halt", "drop")

READY = {"activate": ["activate"], "move": ["move"], "force": ["force"], "halt": ["stop"]}
IDLE = {"activate": ["activate"]}
FAULTY = {"activate": ["activate"], "halt": ["stop"]}
OUTCOMES: dict[str, dict[str, dict[str, list[str]]]] = {
    "robotiq_2f": {
        "closed": {},
        "waiting": IDLE,
        "inactive": IDLE,
        "active": READY,
        "activation queued": {"activate": ["activate"], "halt": [], "drop": []},
        "cleared": {"activate": ["activate"], "halt": [], "drop": []},
        "activating": IDLE,
    },
    "wsg": {
        "closed": {},
        "waiting": {},
        "silent": {},
        "inactive": IDLE,
        "active": READY | {"move": ["force", "move"]},
        "faulty": {"activate": ["acknowledge", "activate"], "halt": ["stop"]},
        "activation queued": {"activate": ["activate"], "halt": ["stop"], "drop": []},
        "activating": FAULTY,
        "reactivation queued": {"activate": ["activate"], "halt": ["stop"], "drop": []},
        "settling": FAULTY,
    },
    "external_gripper": {
        "closed": {},
        "unregistered": {},
        "waiting": {},
        "silent": {},
        "inactive": IDLE,
        "active": READY,
        "faulty": FAULTY,
        "activation queued": {"activate": ["activate"], "halt": ["stop"], "drop": []},
        "activating": FAULTY,
    },
}
"""For each state, the permits that it accepts and the first commands that they send to the gripper.

A "halt" or "drop" of an unsent activation sends nothing to a gripper that was not active before.
"""


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("device", "state"), [(device, state) for device, outcomes in OUTCOMES.items() for state in outcomes]
)
def test_a_permit_is_sent_in_states_that_accept_it_and_changes_nothing_in_others(
    device: str, state: str, kind: str
) -> None:
    module = MODULES[device]
    assert set(OUTCOMES[device]) == {each.value for each in module.TRANSITIONS}
    talk, untouched = (Talk(device, STATES[device][state]) for _ in range(2))
    session = talk.session
    assert session._state.value == state
    assert session.activating is (session._state in module.ACTIVATION)
    outcomes = OUTCOMES[device][state]
    sent = len(talk.commands)
    assert talk.ask(kind) is (kind in outcomes)
    if kind in outcomes:
        assert session.activating or kind != "activate"
        talk.mute = False
        commands = talk.run(0.2).commands[sent:]
        assert [each.kind for each in commands[: len(outcomes[kind])]] == outcomes[kind]
        assert outcomes[kind] or not commands
        return
    assert session._state is untouched.session._state
    if kind != "drop":  # an unanswered command is not repeated after a drop
        assert talk.run(0.3).sent == untouched.run(0.3).sent
        assert session.state == untouched.session.state


@pytest.mark.parametrize(
    "device", [pytest.param(name, marks=() if name == "external_gripper" else pytest.mark.uncovered) for name in PEERS]
)
def test_only_the_last_permit_is_ever_on_the_wire(device: str) -> None:
    walk(device, range(WALKS))
