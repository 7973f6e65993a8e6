"""A daemon that dies in a grasp and starts again: nothing moves, levels within 1 s, and a raise within 2 s."""

from __future__ import annotations

import json
from typing import Any

import pytest
from motions.cell import Cell, brought_up
from motions.jaws import GRIPPERS, Jaws, Sent

from slipd.events import StateRestored
from slipd.grasp.stored_state import seal
from slipd_client.messages.names import GRIP_UNKNOWN

HELD_N = 8.0
MOVES = {"move", "force", "activate", "halt"}


def kept(cell: Cell) -> StateRestored:
    """What the run keeps, as the one of another boot that was killed now."""
    state: dict[str, Any] = json.loads(cell.kept().text.partition(" ")[2])
    return StateRestored(seal(json.dumps(state | {"boot": "earlier"})))


@pytest.mark.parametrize("state", ["kept", "kept while the gripper was silent", "lost"])
@pytest.mark.parametrize("jaws", GRIPPERS.values(), ids=GRIPPERS.keys())
def test_F6_a_restart_in_a_grasp_moves_nothing_and_goes_on_within_two_seconds(jaws: type[Jaws], state: str) -> None:
    cell = brought_up(jaws, HELD_N)
    sent: list[Sent] = []
    cell.mute = state == "kept while the gripper was silent"
    cell.run(1000 if cell.mute else 0)
    before_n, text = cell.jaws.grip_n, kept(cell)
    cell.mute = False
    cell.stall(300)
    cell.on_sent = sent.append
    cell.restart(None if state == "lost" else text)
    cell.run(1000)
    assert set(cell.levels.values()) <= {"stable", "unknown"}
    assert cell.levels.keys() == {"left", "right"}, "known or unknown within 1 s"
    cell.run(800)
    assert (cell.jaws.grip_n, [each for each in sent if each.kind in MOVES]) == (before_n, [])
    cell.lease()
    cell.run(100)
    assert cell.code("grip.adjust", delta_n=1.0) is None, "possible within 2 s"
    cell.run(500)
    assert cell.jaws.grip_n == pytest.approx(before_n + 1.0, abs=0.2)
    status = cell.ask("status")["result"]
    assert GRIP_UNKNOWN not in status["streams"]["gripper"]["message"]
    assert status["uptime_s"] == pytest.approx(2.4, abs=0.1)
