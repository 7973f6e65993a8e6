"""Goals of the gripper action beside a real daemon and an emulated gripper; only ROS itself is missing.

The sensors are silent, so that no force may be raised, and nothing opened.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from emulation_thread import emulation
from grip_goals import GoalError, Joint, Outcome, carry_out
from gripper_table import external_gripper_table
from rig_parts import PATIENCE_S, endpoints_of, part, wait_for
from service_rig import Rig
from viewed_rig import leased

from slipd.tools.sim.emulators import make_emulator
from slipd_client.errors import ClientError
from slipd_client.grip import GripClient
from slipd_client.subscriber import Subscriber

pytestmark = pytest.mark.process

JOINT = Joint("jaw")
PART_M = 0.04
"""Width of the part between the jaws of the emulated gripper."""


Move = Callable[..., Any]


@pytest.fixture
def move(rig: Rig, tmp_path: Path) -> Iterator[Move]:
    """Carries out a goal; returns its outcome, and the state of the gripper at its end."""
    gripper = external_gripper_table(tmp_path, step_n=5.0)
    rig.file.write_text(rig.file.read_text(encoding="utf-8") + gripper, encoding="utf-8")
    devices = [("external_gripper", make_emulator("external_gripper"), f"unix://{tmp_path}/gripper")]
    with part(tmp_path, "slipd", "run", str(rig.file)) as daemon, emulation(devices):
        endpoints = endpoints_of(daemon)
        with (
            GripClient(endpoints.requests, timeout_s=PATIENCE_S) as client,
            Subscriber(endpoints.publish, ("gripper",)) as messages,
        ):
            wait_for(lambda: leased(client, lambda: client.gripper_activate(drop=True)))
            wait_for(lambda: client.status()["gripper"]["active"])

            def move(position: float, effort: float, *, cancelled: bool = False) -> Any:
                goal = SimpleNamespace(name=["jaw"], position=[position], effort=[effort], velocity=[])
                return carry_out(client, messages, goal, JOINT, cancelled=lambda: cancelled, feedback=id)

            yield move


def tried(work: Callable[[], Any], refusal: str = "nothing") -> Any:
    """Do it until it succeeds, or is refused as expected: on a busy machine requests come too late, and leases end."""
    until_s = time.monotonic() + PATIENCE_S
    while True:
        try:
            return work()
        except (GoalError, ClientError) as error:
            if refusal in str(error):
                return str(error)
            if time.monotonic() > until_s:
                raise


def test_a_goal_grips_keeps_its_force_and_is_refused_by_the_rules_of_slipd(move: Move) -> None:
    assert tried(lambda: move(0.0, 8.0, cancelled=True))[0] is None
    outcome, state = tried(lambda: move(0.0, 8.0))
    assert outcome == Outcome(stalled=True, reached_goal=False)
    assert (state["width_m"], state["force_command_n"]) == (pytest.approx(PART_M), 8.0)
    outcome, state = tried(lambda: move(0.0, 6.0))
    assert (outcome.stalled, state["force_command_n"]) == (True, 6.0)
    stale = "force_n must not be raised while sensors are stale"
    assert stale in tried(lambda: move(0.0, 8.0), stale)
    assert "in_contact" in tried(lambda: move(0.06, 0.0), "in_contact")
